import re
from collections import Counter
from html.parser import HTMLParser

import pytest
from matplotlib.figure import Figure

import holdfast_lab.report.html_report as report_module
from holdfast_lab.report.html_report import ReportFigure, Section, html_report
from holdfast_lab.report.result_tables import ResultTable, Row

pytestmark = pytest.mark.slow

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


def test_the_report_is_html_without_external_references():
    text = page(seed=0)
    assert text.startswith("<!DOCTYPE html>")
    assert not re.search(r"https?:|<script|<link|@import|xmlns", text)
    read = Page(text)
    assert not read.sources
    assert all(target.startswith("#") for target in read.targets)


def test_ids_are_unique_and_every_reference_exists():
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


def test_tables_and_figures_are_numbered_and_listed():
    text = page()
    for k, name in ((1, "first"), (2, "second")):
        assert (
            f'<a href="#table-{name}"><span>Table {k}</span> Some &amp; &lt;table&gt;</a>' in text
        )
        assert f'<span class="number">Table {k}.</span>' in text
    assert '<a href="#figure-curve"><span>Figure 1</span> What &#34;it&#34; is</a>' in text
    assert '<span class="number">Figure 2.</span> Other' in text


def test_the_summary_comes_before_the_contents():
    with_summary = html_report("T", {}, [Section("Summary", "- one\n- two"), *sections()])
    head, rest = with_summary.split("<nav")
    assert "<h2>Summary</h2>" in head
    assert "<li>two</li>" in head
    assert "Summary" not in rest
    assert rest == html_report("T", {}, sections()).split("<nav")[1]


def test_the_report_is_reproducible():
    assert page() == page()


def test_a_large_figure_is_a_png(monkeypatch):
    monkeypatch.setattr(report_module, "MAX_INLINE_SVG", 1000)
    read = Page(page())
    assert [source[:22] for source in read.sources] == ["data:image/png;base64,"] * 2


def test_repeated_names_are_rejected():
    one, two = sections()
    with pytest.raises(ValueError, match=r"^two tables of the report are called 'first'$"):
        html_report("x", {}, [one, one._replace(figures=[])])
    with pytest.raises(ValueError, match=r"^two figures of the report are called 'curve-2'$"):
        html_report("x", {}, [two._replace(tables=[]), two])
    with pytest.raises(
        ValueError, match=r"^a figure's name is letters, digits, - and _; 'a b' given$"
    ):
        html_report("x", {}, [Section("x", "", [], [ReportFigure("a b", "", drawn())])])
