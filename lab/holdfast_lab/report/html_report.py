"""The report: one HTML file that needs no other file, to read on a screen or on paper.

Its Matplotlib figures are elements of the document, and files beside it.
"""

import base64
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import count
from typing import NamedTuple, Self

import matplotlib as mpl
from matplotlib.figure import Figure

from holdfast.plots.style import default_settings
from holdfast_lab.report.rendering import render
from holdfast_lab.report.result_tables import FILE_NAME, ResultTable
from holdfast_lab.report.table_layouts import TableText, table_text

MAX_INLINE_SVG = 400_000
"""A larger SVG [bytes] is replaced by a PNG in the report."""
PNG_RESOLUTION = 200
"""Of a PNG [dots per inch]."""

_ID = re.compile(r'(?<= id=")(?=[^"]+")')
_REFERENCE = re.compile(r'(?<=url\(#)|(?<=href="#)')
_OPENING = re.compile(r'<svg [^>]*?viewBox="([^"]*)"[^>]*>')
_PATH = re.compile(r' d="[^"]*"')
_EXTRA_DIGITS = re.compile(r"(?<=\.\d\d)\d+")
"""Digits beyond 0.01 pt."""
_NOT_NEEDED = re.compile(r"<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->", re.DOTALL)


def svg_of(figure: Figure, name: str) -> str:
    """Return the figure as an SVG document, the same for the same figure and name.

    Args:
        figure: to write.
        name: from which the ids of its elements are made.
    """
    # Letters as paths look alike without the font. With a fixed salt and no date, the same study
    # gives the same file.
    file = io.StringIO()
    # `savefig` of our figures has the default salt, which is random.
    with default_settings(), mpl.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure.canvas.print_figure(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()


def png_of(figure: Figure) -> bytes:
    """Return the figure as a PNG file."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=PNG_RESOLUTION, metadata={"Software": None})
    return file.getvalue()


class InlineImage(NamedTuple):
    """A figure inside an HTML document.

    Attributes:
        view_box: of the `svg` element.
        svg: contents of the `svg` element and its end; empty if the image is of another kind.
        data: of an `img` element, in base64; empty if the image is an SVG.
        kind: of the data: "png" or "webp".
    """

    view_box: str
    svg: str
    data: str
    kind: str = "png"

    @classmethod
    def of(cls, data: bytes, kind: str) -> Self:
        """Return the image for the content of a file."""
        return cls("", "", base64.b64encode(data).decode(), kind)


def inline_image(figure: Figure, name: str) -> InlineImage:
    """Return the figure for an HTML document: as SVG, or as PNG if the SVG would be large.

    Args:
        figure: to draw.
        name: begins every id of the SVG, so that ids of two figures differ.
    """
    # The viewBox and the contents of an SVG document, without metadata.
    document = svg_of(figure, name)
    opening = _OPENING.search(document)
    if opening is None:
        raise ValueError(f"figure {name}: an SVG with a viewBox expected, none given")
    inner = _NOT_NEEDED.sub("", document[opening.end() :]).replace("xlink:href", "href")
    inner = re.sub(r"\n\s*", "\n", inner)
    inner = _PATH.sub(lambda path: _EXTRA_DIGITS.sub("", path[0]), inner)
    view_box, svg = opening[1], _REFERENCE.sub(f"{name}-", _ID.sub(f"{name}-", inner))
    if len(svg) <= MAX_INLINE_SVG:
        return InlineImage(view_box, svg, "")
    return InlineImage.of(png_of(figure), "png")


SUMMARY = "Summary"
"""Title of the section that comes before the contents."""


class ReportFigure(NamedTuple):
    """A figure of the report.

    Attributes:
        name: of its files: letters, digits, "-" and "_".
        caption: what it shows; the first sentence is its title in the contents.
        figure: drawn.
    """

    name: str
    caption: str
    figure: Figure

    @property
    def title(self) -> str:
        """First sentence of the caption."""
        return _first_sentence(self.caption)

    def image(self) -> InlineImage:
        """Draw the figure for an HTML document."""
        return inline_image(self.figure, self.name)

    def files(self) -> dict[str, bytes]:
        """Return the content of each file of the figure, by suffix."""
        return {"svg": svg_of(self.figure, self.name).encode(), "png": png_of(self.figure)}


class ReportFilm(NamedTuple):
    """A film of the report, which plays again and again.

    Attributes:
        name: of its file: letters, digits, "-" and "_".
        caption: what it shows; the first sentence is its title in the contents.
        film: content of an animated WebP file.
    """

    name: str
    caption: str
    film: bytes

    @property
    def title(self) -> str:
        """First sentence of the caption."""
        return _first_sentence(self.caption)

    def image(self) -> InlineImage:
        """Return the film for an HTML document."""
        return InlineImage.of(self.film, "webp")

    def files(self) -> dict[str, bytes]:
        """Return the content of its file, by suffix."""
        return {"webp": self.film}


class Section(NamedTuple):
    """A section of the report.

    Attributes:
        title: of one line.
        text: plain paragraphs, separated by empty lines; lines that all begin with "- " are a
            list.
        tables: of this section.
        figures: of this section; they follow the tables.
    """

    title: str
    text: str
    tables: Sequence[ResultTable] = ()
    figures: Sequence[ReportFigure | ReportFilm] = ()


class Paragraph(NamedTuple):
    """A paragraph of a section, or a list with an item in each line."""

    lines: list[str]
    is_list: bool

    @classmethod
    def of(cls, text: str) -> Self:
        """Return the paragraph of a text; it is a list if all lines begin with "- "."""
        lines = [line.strip() for line in text.strip().splitlines()]
        if all(line.startswith("- ") for line in lines):
            return cls([line[2:] for line in lines], is_list=True)
        return cls(lines, is_list=False)


class NumberedSection(NamedTuple):
    """A section whose tables and figures are numbered through the report."""

    title: str
    paragraphs: list[Paragraph]
    tables: list[tuple[int, TableText]]
    figures: list[tuple[int, ReportFigure | ReportFilm]]


def html_report(title: str, facts: Mapping[str, object], sections: Sequence[Section]) -> str:
    """Return the whole report as one HTML document, without scripts and external links.

    Args:
        title: of the report.
        facts: how it was made: versions, seed, data, machine, time. A list becomes lines, a
            mapping becomes "name: value" lines.
        sections: in order; the one called `SUMMARY` comes before the contents.

    Raises:
        ValueError: two tables or two figures have the same name, or a name is no file name.
    """
    check_names(sections)
    # Numbered apart: tables and figures of the body begin at 1 whatever the summary has.
    summary = [section for section in sections if section.title == SUMMARY]
    return render(
        "report.html",
        title=title,
        facts={name: _fact_lines(value) for name, value in facts.items()},
        summary=_numbered(summary)[0] if summary else None,
        sections=_numbered([section for section in sections if section.title != SUMMARY]),
    )


def check_names(sections: Sequence[Section]) -> None:
    """Check that the names of all tables and figures are different file names.

    Raises:
        ValueError: two have the same name, or the name of a figure is no file name.
    """
    tables = [table.name for section in sections for table in section.tables]
    figures = [figure.name for section in sections for figure in section.figures]
    for kind, names in (("tables", tables), ("figures", figures)):
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ValueError(f"two {kind} of the report are called {twice[0]!r}")
    for name in figures:
        if not FILE_NAME.fullmatch(name):
            raise ValueError(f"a figure's name is letters, digits, - and _; {name!r} given")


def _first_sentence(text: str) -> str:
    return text.split(". ", maxsplit=1)[0].rstrip(".")


def _numbered(sections: Sequence[Section]) -> list[NumberedSection]:
    table_numbers, figure_numbers = count(1), count(1)
    return [
        NumberedSection(
            section.title,
            [Paragraph.of(text) for text in section.text.split("\n\n") if text.strip()],
            [(next(table_numbers), table_text(table)) for table in section.tables],
            [(next(figure_numbers), figure) for figure in section.figures],
        )
        for section in sections
    ]


def join_lines(text: str) -> str:
    """Join the lines of each paragraph and of each item of a list."""
    paragraphs = []
    for part in text.split("\n\n"):
        breaks = ("\n" if line.startswith("- ") else " " for line in part.splitlines())
        lines = zip(breaks, part.splitlines(), strict=True)
        paragraphs.append("".join(f"{before}{line}" for before, line in lines).strip())
    return "\n\n".join(paragraphs)


def _fact_lines(value: object) -> list[str]:
    if isinstance(value, Mapping):
        return [f"{name}: {text}" for name, text in value.items()]
    if isinstance(value, Iterable) and not isinstance(value, str):
        return [str(item) for item in value]
    return [str(value)]
