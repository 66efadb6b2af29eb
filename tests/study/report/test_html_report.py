import json
import re
from collections import Counter
from html.parser import HTMLParser

import pytest
from matplotlib.figure import Figure

from holdfast.errors import OutputError
from holdfast.study.report import images
from holdfast.study.report.folder import check_output_folder, write_study
from holdfast.study.report.html_report import ReportFigure, Section, html_report
from holdfast.study.report.result_tables import ResultTable, Row

VOID = {"meta", "br", "img", "link", "hr", "input"}


class Page(HTMLParser):
    """Every tag is closed in order; ids, references and texts are kept."""

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.targets, self.sources, self.text = [], [], [], [], ""
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.note(attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.note(attrs)

    def note(self, attrs):
        for name, value in attrs:
            assert value is not None, name
            if name == "id":
                self.ids.append(value)
            elif name == "href":
                self.targets.append(value)
            elif name == "src":
                self.sources.append(value)
            self.targets += [f"#{found}" for found in re.findall(r"url\(#([^)]*)\)", value)]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def drawn(n=3):
    figure = Figure(layout="constrained")
    axes = figure.subplots()
    axes.plot(range(n), "o-", label="a <b> & $\\sigma$")
    axes.fill_between(range(n), 1, 2)
    axes.legend()
    return figure


def sections():
    tables = [
        ResultTable(
            name, "Some & <table>", "N_w", [Row({"m": "a", "figure": "x"}, 1.0, 2.0)], ("m",)
        )
        for name in ("first", "second")
    ]
    return [
        Section("One & <b>", "Of sigma.\nStill.\n\n- a\n- <i>b</i>\n\nEnd.", tables[:1],
                [ReportFigure("curve", 'What "it" is. And more & so.', drawn())]),
        Section("Two", "", tables[1:], [ReportFigure("curve-2", "Other", drawn())]),
    ]  # fmt: skip


def page(**facts):
    return html_report("Study <1>", facts, sections())


def test_it_is_html_that_needs_nothing_else():
    text = page(seed=0)
    assert text.startswith("<!DOCTYPE html>")
    assert not re.search(r"https?:|<script|<link|@import|xmlns", text)
    read = Page(text)
    assert not read.sources
    assert all(target.startswith("#") for target in read.targets)


def test_ids_are_unique_and_every_reference_is_met():
    """Two figures that are drawn alike have the same ids in their own files."""
    read = Page(page())
    assert [name for name, n in Counter(read.ids).items() if n > 1] == []
    assert {target[1:] for target in read.targets} <= set(read.ids)


def test_text_is_escaped_and_laid_out():
    text = page(versions={"numpy": "2 <3>"}, data=["a & b", "c"], seed=0)
    assert "<h1>Study &lt;1&gt;</h1>" in text
    assert "<h2>1. One &amp; &lt;b&gt;</h2>" in text
    assert (
        "<p>Of <i>σ</i>. Still.</p>\n<ul>\n<li>a</li>\n<li>&lt;i&gt;b&lt;/i&gt;</li>\n</ul>\n"
        in text
    )
    assert "<dt>versions</dt><dd>numpy: 2 &lt;3&gt;</dd>" in text
    assert "<dd>a &amp; b<br>c</dd>" in text and "<dd>0</dd>" in text


def test_tables_and_figures_are_numbered_through_and_listed():
    text = page()
    for k, name in ((1, "first"), (2, "second")):
        assert (
            f'<a href="#table-{name}"><span>Table {k}</span> Some &amp; &lt;table&gt;</a>' in text
        )
        assert f'<span class="number">Table {k}.</span>' in text
    assert '<a href="#figure-curve"><span>Figure 1</span> What &#34;it&#34; is</a>' in text
    assert '<span class="number">Figure 2.</span> Other' in text


def test_it_is_the_same_every_time():
    assert page() == page()


def test_a_large_figure_comes_as_png(monkeypatch):
    monkeypatch.setattr(images, "MAX_INLINE_SVG", 1000)
    read = Page(page())
    assert [source[:22] for source in read.sources] == ["data:image/png;base64,"] * 2


def test_names_are_used_once():
    one, two = sections()
    with pytest.raises(ValueError, match=r"^two tables of the report are called 'first'$"):
        html_report("x", {}, [one, one._replace(figures=[])])
    with pytest.raises(ValueError, match=r"^two figures of the report are called 'curve-2'$"):
        html_report("x", {}, [two._replace(tables=[]), two])
    with pytest.raises(
        ValueError, match=r"^a figure's name is letters, digits, - and _; 'a b' given$"
    ):
        html_report("x", {}, [Section("x", "", [], [ReportFigure("a b", "", drawn())])])


def write(out, **options):
    write_study(out, "Study", {"seed": 0}, sections(), {"seed": 0, "data": {}}, **options)


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_the_folder(tmp_path):
    out = tmp_path / "out"
    write(out)
    assert files(out) == [
        "figures/curve-2.png",
        "figures/curve-2.svg",
        "figures/curve.png",
        "figures/curve.svg",
        "report.html",
        "study.json",
        *(
            f"tables/{name}.{kind}"
            for name in ("first", "second")
            for kind in ("csv", "json", "md", "tex")
        ),
    ]
    told = json.loads((out / "study.json").read_text())
    assert told["seed"] == 0
    assert told["tables"]["first"][0] == {
        "m": "a", "figure": "x", "ours": 1.0, "paper": 2.0, "difference": -1.0, "n": None,
        "interval": None,
    }  # fmt: skip
    assert json.loads((out / "tables/first.json").read_text())["rows"] == told["tables"]["first"]
    assert (out / "figures/curve.png").read_bytes()[:4] == b"\x89PNG"
    assert (out / "figures/curve.svg").read_text().startswith("<?xml")


def test_work_that_is_kept_from_a_stopped_study_stays(tmp_path):
    (tmp_path / "out/work").mkdir(parents=True)
    (tmp_path / "out/work/a.msgpack").write_bytes(b"x")
    check_output_folder(tmp_path / "out")
    write(tmp_path / "out")
    assert (tmp_path / "out/work/a.msgpack").read_bytes() == b"x"


def test_a_study_is_replaced_by_force_alone(tmp_path):
    out = tmp_path / "out"
    write(out)
    (out / "tables/old.csv").touch()
    (out / "notes.txt").write_text("mine")
    with pytest.raises(
        OutputError, match=r"already holds a study: choose another name, or give --force$"
    ):
        write(out)
    write(out, force=True)
    assert "tables/old.csv" not in files(out) and "notes.txt" in files(out)


def test_a_folder_of_other_things_is_left_alone(tmp_path):
    (tmp_path / "notes.txt").touch()
    message = (
        r"holds other files \(notes.txt, ...\) and no study: "
        "choose a folder that is empty or does not exist$"
    )
    with pytest.raises(OutputError, match=message):
        write(tmp_path, force=True)
    with pytest.raises(OutputError, match=r"is a file; a study is written to a folder$"):
        check_output_folder(tmp_path / "notes.txt", force=True)
    with pytest.raises(OutputError, match=r"no does not exist$"):
        check_output_folder(tmp_path / "no/out")


def test_nothing_is_left_where_it_fails(tmp_path):
    out = tmp_path / "out"
    write(out)
    before = {name: (out / name).read_bytes() for name in files(out)}
    broken = [Section("x", "", [], [ReportFigure("a b", "", drawn())])]
    with pytest.raises(ValueError, match="figure's name"):
        write_study(out, "Other", {}, broken, {}, force=True)
    assert {name: (out / name).read_bytes() for name in files(out)} == before
