"""The report: one HTML file that needs no other file, to read on a screen or on paper."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import count
from typing import NamedTuple, Self

from matplotlib.figure import Figure

from holdfast_lab.report.images import InlineImage, inline_image, png_of, svg_of
from holdfast_lab.report.rendering import render
from holdfast_lab.report.result_tables import FILE_NAME, ResultTable
from holdfast_lab.report.table_layouts import TableText, table_text

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
