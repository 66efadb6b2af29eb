"""Text as HTML, LaTeX and Markdown take it: escaped, with the paper's symbols set as such."""

import html
import re
import unicodedata

SYMBOL = re.compile(r"\b([FN])_(tip|[axyzwst])\b|\bsigma\b")
"""The paper's symbols as plain text spells them: F_a, F_tip, N_w, sigma."""

_TEX = {
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
    "[": "{[}",  # or the line break before it takes it for a length
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
"""Letters that any LaTeX of today knows in any encoding."""


def as_html(text: str) -> str:
    """Escaped, with F_a as a symbol with its index.

    Example:
        >>> as_html("F_a & sigma < 3")
        '<i>F</i><sub>a</sub> &amp; <i>σ</i> &lt; 3'
    """
    return SYMBOL.sub(_html_symbol, html.escape(text))


def as_latex(text: str) -> str:
    r"""Escaped, with F_a as mathematics; what LaTeX does not know becomes its nearest letters.

    Example:
        >>> print(as_latex("F_a at 5 % & my_file"))
        $F_{a}$ at 5 \% \& my\_file
    """
    pieces, end = [], 0
    for match in SYMBOL.finditer(text):
        pieces += [*map(_tex, text[end : match.start()]), _latex_symbol(match)]
        end = match.end()
    return "".join([*pieces, *map(_tex, text[end:])])


def as_markdown(text: str) -> str:
    r"""Escaped for a cell of a table, on one line.

    Example:
        >>> print(as_markdown("a|b <c> F_a [%]"))
        a\|b \<c\> F\_a [%]
    """
    return re.sub(r"([\\`*_|<>&~#]|\](?=[\[(:]))", r"\\\1", " ".join(text.split()))


def _html_symbol(match: re.Match[str]) -> str:
    letter, index = match.groups()
    return f"<i>{letter}</i><sub>{index}</sub>" if letter else "<i>σ</i>"


def _latex_symbol(match: re.Match[str]) -> str:
    letter, index = match.groups()
    if not letter:
        return r"$\sigma$"
    return f"${letter}_{{{index}}}$" if len(index) == 1 else rf"${letter}_{{\mathrm{{{index}}}}}$"


def _tex(letter: str) -> str:
    if letter in _TEX:
        return _TEX[letter]
    if letter.isspace():
        return " "
    if letter in _LATIN and letter.isprintable():
        return letter
    nearest = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode()
    return "".join(_TEX.get(each, each) for each in nearest if each.isprintable()) or "?"
