import math
import re
import shutil
import subprocess

import pytest

from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.report.table_layouts import notes, to_html, to_latex, to_markdown


def confusion(**options):
    rows = [
        Row(
            {"classifier": "LogReg", "on": "fresh & new", "figure": "Acc [%]"},
            94.25,
            95.3,
            60,
            (92.0, 96.04),
        ),
        Row(
            {"classifier": "LogReg", "on": "fresh & new", "figure": "delay [s]"},
            math.inf,
            None,
            60,
            (0.2, math.inf),
        ),
        Row({"classifier": "LogReg", "on": "held out", "figure": "Acc [%]"}, 95.3, 95.3, 60),
        Row(
            {"classifier": "SVM", "on": "held out", "figure": "delay [s]"},
            0.0123,
            None,
            60,
            (-0.01, 0.02),
        ),
    ]
    given = {"note": "Of <all> N_w = 14.", "digits_of": {"delay [s]": 3}} | options
    return ResultTable(
        "confusion", "Table I & more", rows=rows, lines=("classifier", "on"), **given
    )


def test_markdown_by_hand():
    assert to_markdown(confusion()) == (
        "**Table I \\& more**\n\n"
        "| classifier | on | Acc [%] | delay [s] |\n"
        "| --- | --- | --: | --: |\n"
        "| LogReg | fresh \\& new | 94.2<br><sub>92.0–96.0</sub><br>*paper 95.3 (−1.1)* "
        "| infinite<br><sub>0.200–∞</sub> |\n"
        "| LogReg | held out | 95.3<br>*paper 95.3 (0.0)* | – |\n"
        "| SVM | held out | – | 0.012<br><sub>−0.010 to 0.020</sub> |\n\n"
        "Of \\<all\\> N\\_w = 14. On 60 recordings. Small print: 95 % interval, by bootstrap over "
        "recordings. Paper: the value in the paper, and our value minus it.\n"
    )


def test_latex_by_hand():
    lines = to_latex(confusion()).splitlines()
    body = lines[lines.index(r"\midrule") + 1 : lines.index(r"\bottomrule")]
    assert body == [
        r"LogReg & fresh \& new & 94.2 & infinite \\",
        r" &  & \scriptsize 92.0--96.0 & \scriptsize 0.200--$\infty$ \\",
        r" & \quad\scriptsize\itshape paper & \scriptsize\itshape 95.3 ($-$1.1) &  \\",
        r" & held out & 95.3 & -- \\",
        r" & \quad\scriptsize\itshape paper & \scriptsize\itshape 95.3 (0.0) &  \\",
        r"\addlinespace",
        r"SVM & held out & -- & 0.012 \\",
        r" &  &  & \scriptsize $-$0.010 to 0.020 \\",
    ]
    assert r"\label{tab:confusion}" in lines
    assert lines[4].startswith(r"\caption{Table I \& more. Of \textless{}all\textgreater{} $N_{w}$")


def test_every_line_of_latex_has_as_many_cells():
    lines = to_latex(confusion()).splitlines()
    rows = [line for line in lines if line.endswith(r"\\")]
    assert {len(re.findall(r"(?<!\\)&", line)) for line in rows} == {3}


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no LaTeX here")
def test_latex_compiles(tmp_path):
    odd = "".join(map(chr, range(32, 256))) + "−–—…×±·≤≥≈→°∞µσ“”ł漢 F_tip sigma"
    rows = [Row({f"[k]{odd}": f"[2mm]{odd}", "N_w": n}, 1.0) for n in range(9)]
    tables = [confusion(), ResultTable("odd", odd, odd, rows, (f"[k]{odd}",), column="N_w")]
    text = "".join(map(to_latex, tables))
    (tmp_path / "t.tex").write_text(
        r"\documentclass{article}\usepackage{booktabs,graphicx}\begin{document}"
        f"\n{text}\\end{{document}}\n",
        encoding="utf-8",
    )
    command = ["pdflatex", "-halt-on-error", "-interaction=nonstopmode", "t.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:]


def test_html_cells():
    html = to_html(confusion(), number=3)
    assert '<span class="number">Table 3.</span> Table I &amp; more' in html
    assert (
        '<td><span class="ours">94.2</span><span class="interval">92.0–96.0</span>'
        '<span class="paper">paper 95.3 <b title="difference">−1.1</b></span></td>'
    ) in html
    assert html.count('<td class="none">–</td>') == 2
    assert html.count('class="repeated">LogReg') == 1
    assert "<all>" not in html and "&lt;all&gt; <i>N</i><sub>w</sub>" in html


def test_columns_have_a_common_head():
    rows = [Row({"figure": "Acc", "N_w": n}, 95.0) for n in (4, 6)]
    made = ResultTable("window", "By window", "", rows, ("figure",), column="N_w")
    assert '<th colspan="2" scope="colgroup" class="over"><i>N</i><sub>w</sub></th>' in to_html(
        made
    )
    assert r"& \multicolumn{2}{c}{$N_{w}$} \\" in to_latex(made)
    assert "| figure | N\\_w 4 | N\\_w 6 |" in to_markdown(made)
    assert notes(made) == []


def test_the_number_of_recordings_has_a_column_if_it_varies():
    rows = [
        Row({"m": "a", "figure": "x"}, 1.0, n=60),
        Row({"m": "b", "figure": "x"}, 1.0, n=48),
        Row({"m": "b", "figure": "y"}, 1.0, n=12),
        Row({"m": "c", "figure": "y"}, 1.0),
    ]
    made = ResultTable("t", "T", "", rows, ("m",))
    assert to_markdown(made).splitlines()[2:] == [
        "| m | x | y | recordings |",
        "| --- | --: | --: | --: |",
        "| a | 1.0 | – | 60 |",
        "| b | 1.0 | 1.0 | 12–48 |",
        "| c | – | 1.0 | – |",
    ]
    assert to_html(made).count('<td class="n">') == 3
    assert r"\begin{tabular}{lrrr}" in to_latex(made)


def test_an_unknown_interval_is_left_out():
    rows = [Row({"m": "a", "figure": "x"}, math.inf, interval=(math.inf, math.inf)),
            Row({"m": "a", "figure": "y"}, 1.0, interval=(None, None))]  # fmt: skip
    text = to_markdown(ResultTable("t", "T", "", rows, ("m",)))
    assert "| a | infinite | 1.0 |" in text


def test_an_interval_with_one_end():
    rows = [Row({"m": "a", "figure": "x"}, 1.0, interval=(0.5, None)),
            Row({"m": "a", "figure": "y"}, 1.0, interval=(None, 2.0))]  # fmt: skip
    text = to_html(ResultTable("t", "T", "", rows, ("m",)))
    assert '<span class="interval">from 0.5</span>' in text
    assert '<span class="interval">to 2.0</span>' in text


def test_an_empty_table_is_laid_out():
    made = ResultTable("t", "T", "", [], ("m",))
    assert "<tbody>" in to_html(made)
    assert "| m |" in to_markdown(made)
    assert r"\begin{tabular}{l}" in to_latex(made)


def test_a_value_of_the_paper_alone_has_no_difference():
    rows = [Row({"where": "Table II", "figure": "printed"}, None, 95.3)]
    alone = ResultTable("said", "What is said", "", rows, ("where",))
    assert "| Table II | *paper 95.3* |" in to_markdown(alone)
    assert "95.3</span>" in to_html(alone)
    assert "95.3 (" not in to_latex(alone)


def test_notes_name_what_is_counted():
    rows = [Row({"law": "a", "figure": "x"}, 1.0, n=n, interval=(0.0, 2.0)) for n in (4, 1)]
    rows = [Row({**row.keys, "law": str(k)}, row.ours, n=row.n, interval=row.interval)
            for k, row in enumerate(rows)]  # fmt: skip
    table = ResultTable("t", "T", "", rows, ("law",), counted="trials", has_paper=False)
    assert notes(table) == ["Small print: 95 % interval, by bootstrap over trials."]
    assert "trials" in to_markdown(table).splitlines()[2]
    one = ResultTable("t", "T", "", rows[1:], ("law",), counted="trials", has_paper=False)
    assert notes(one)[0].startswith("On 1 trial. ")
