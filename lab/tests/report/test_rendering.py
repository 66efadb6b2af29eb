import re
from html.parser import HTMLParser

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast_lab.report.rendering import escape_html, escape_latex, escape_markdown


@pytest.mark.parametrize(
    ("text", "latex"),
    [
        (
            "50 % & $3 #1 a_b {x} ~ ^",
            r"50 \% \& \$3 \#1 a\_b \{x\} \textasciitilde{} \textasciicircum{}",
        ),
        ("\\", r"\textbackslash{}"),
        ("F_a, F_tip, N_w, sigma", r"$F_{a}$, $F_{\mathrm{tip}}$, $N_{w}$, $\sigma$"),
        ("my_F_a.mcap sigmas", r"my\_F\_a.mcap sigmas"),
        ("−1 – σ ≤ µs", r"$-$1 -- $\sigma$ $\leq$ $\mu$s"),
        ("[2mm]", "{[}2mm{]}"),
        ("ł漢 é", "?? é"),
        ("ﬁ\u2076\u0160", "fi6S"),
        ("a\n\tb", "a  b"),
    ],
)
def test_latex(text, latex):
    assert escape_latex(text) == latex


@given(st.text())
def test_latex_holds_no_bare_special_character(text):
    bare = re.sub(
        r"\\(text\w+\{\}|ldots\{\}|[{}$&%#_,])|\$[^$]*\$|\{[][]\}", "", escape_latex(text)
    )
    assert not re.search(r"[\\{}$&%#_^\n]", bare.replace("~", ""))


class Text(HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags, self.text = set(), ""

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)

    def handle_data(self, data):
        self.text += data


@given(st.text(alphabet=st.characters(exclude_characters="\r\0", exclude_categories=["Cs"])))
def test_html_is_parsed_to_the_original_text(text):
    parser = Text()
    parser.feed(escape_html(text.replace("_", "-").replace("sigma", "")))
    parser.close()
    assert parser.text == text.replace("_", "-").replace("sigma", "")
    assert not parser.tags


def test_html_has_symbols():
    assert escape_html("F_a < F_tip, sigma") == (
        "<i>F</i><sub>a</sub> &lt; <i>F</i><sub>tip</sub>, <i>σ</i>"
    )


def test_markdown_escapes_a_cell():
    assert escape_markdown("a|b\n*c* [x](y) <br> `z`") == r"a\|b \*c\* [x\](y) \<br\> \`z\`"
