"""Templates of the report: text is escaped, and the paper's symbols are typeset."""

import re
import unicodedata
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

SYMBOL = re.compile(r"\b([FN])_(tip|[axyzwst])\b|\bsigma\b")
"""The paper's symbols as plain text spells them: F_a, F_tip, N_w, sigma."""

_LATEX_CHARACTERS = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "%": r"\%",
    "#": r"\#",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",
    "[": "{[}",  # after a line break LaTeX would read it as a length
    "]": "{]}",
    "−": "$-$",
    "–": "--",
    "—": "---",
    "…": r"\ldots{}",
    "×": r"$\times$",
    "±": r"$\pm$",
    "·": r"$\cdot$",
    "≤": r"$\leq$",
    "≥": r"$\geq$",
    "≈": r"$\approx$",
    "→": r"$\rightarrow$",
    "°": r"$^\circ$",
    "∞": r"$\infty$",
    "µ": r"$\mu$",
    "μ": r"$\mu$",
    "σ": r"$\sigma$",
    "«": "``",
    "»": "''",
    "“": "``",
    "”": "''",
    "‘": "`",
    "’": "'",
    "\u00a0": "~",
    "\u202f": r"\,",
}
_LATIN = {chr(k) for k in range(0x20, 0x100)} - set("ÐðÞþ")
"""Letters that LaTeX can print with every input encoding."""


def render(template: str, **values: Any) -> str:  # noqa: ANN401 (whatever the template uses)
    """Render a template of the folder `templates`, by the rules of its suffix.

    Args:
        template: name of the file; `.html` is escaped as HTML, `.tex` as LaTeX.
        values: that the template uses.
    """
    environment = _latex_environment() if template.endswith(".tex") else _html_environment()
    return environment.get_template(template).render(**values)


def escape_html(text: str) -> Markup:
    """Escape text for HTML, with F_a as a symbol with its index.

    Example:
        >>> print(escape_html("F_a & sigma < 3"))
        <i>F</i><sub>a</sub> &amp; <i>σ</i> &lt; 3
    """

    def symbol(match: re.Match[str]) -> str:
        letter, index = match.groups()
        return f"<i>{letter}</i><sub>{index}</sub>" if letter else "<i>σ</i>"

    # Escaped first, or the elements of the symbols would be escaped too.
    return Markup(SYMBOL.sub(symbol, str(Markup.escape(text))))


def escape_latex(text: str) -> str:
    r"""Escape text for LaTeX, with F_a as mathematics.

    A letter that LaTeX cannot print becomes the nearest letters that it can print.

    Example:
        >>> print(escape_latex("F_a at 5 % & my_file"))
        $F_{a}$ at 5 \% \& my\_file
    """
    # Symbols are not escaped, the text between them is: `_` and `{` would lose their meaning.
    pieces: list[str] = []
    end = 0
    for match in SYMBOL.finditer(text):
        letter, index = match.groups()
        pieces += map(_latex_character, text[end : match.start()])
        if not letter:
            pieces.append(r"$\sigma$")
        else:  # an index of several letters is a word, not a product of variables
            word = index if len(index) == 1 else rf"\mathrm{{{index}}}"
            pieces.append(f"${letter}_{{{word}}}$")
        end = match.end()
    return "".join([*pieces, *map(_latex_character, text[end:])])


def escape_markdown(text: str) -> str:
    r"""Escape text for a cell of a Markdown table, on one line.

    Example:
        >>> print(escape_markdown("a|b <c> F_a [%]"))
        a\|b \<c\> F\_a [%]
    """
    return re.sub(r"([\\`*_|<>&~#]|\](?=[\[(:]))", r"\\\1", " ".join(text.split()))


@cache
def _html_environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("holdfast_lab.report"),
        autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["symbols"] = escape_html
    return environment


@cache
def _latex_environment() -> Environment:
    """Return an environment whose delimiters LaTeX does not use; every value is escaped."""
    return Environment(
        loader=PackageLoader("holdfast_lab.report"),
        # Jinja escapes for HTML only: LaTeX is escaped by the last function on each value.
        autoescape=True,
        finalize=lambda value: (
            value if isinstance(value, Markup) else Markup(escape_latex(str(value)))
        ),
        undefined=StrictUndefined,
        block_start_string="<%",
        block_end_string="%>",
        variable_start_string="<<",
        variable_end_string=">>",
        comment_start_string="<#",
        comment_end_string="#>",
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def _latex_character(letter: str) -> str:
    if letter in _LATEX_CHARACTERS:
        return _LATEX_CHARACTERS[letter]
    if letter.isspace():
        return " "
    if letter in _LATIN and letter.isprintable():
        return letter
    # The letter without its accent; a letter that has no such form is a question mark.
    nearest = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode()
    return (
        "".join(_LATEX_CHARACTERS.get(each, each) for each in nearest if each.isprintable()) or "?"
    )
