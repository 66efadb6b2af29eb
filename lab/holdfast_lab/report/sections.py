"""Sections of a report, each with a text, tables and figures; as one Markdown file."""

import io
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from matplotlib.figure import Figure

from holdfast_lab.report.result_tables import FILE_NAME, ResultTable
from holdfast_lab.report.table_layouts import escape_markdown, to_markdown

PNG_RESOLUTION = 200
"""Of a PNG [dots per inch]."""


class ReportFigure(NamedTuple):
    """A figure of the report.

    Attributes:
        name: of its file: letters, digits, "-" and "_".
        caption: what it shows.
        figure: drawn.
    """

    name: str
    caption: str
    figure: Figure


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
    figures: Sequence[ReportFigure] = ()


def png_of(figure: Figure) -> bytes:
    """Return the figure as a PNG file."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=PNG_RESOLUTION, metadata={"Software": None})
    return file.getvalue()


def markdown_report(title: str, facts: Mapping[str, str], sections: Sequence[Section]) -> str:
    """Return the whole report, which shows the figures of the folder beside it.

    Args:
        title: of the report.
        facts: how it was made: versions, seed, data, machine, time.
        sections: in order.
    """
    parts = [f"# {escape_markdown(title)}"]
    parts.append("\n".join(f"- {name}: {escape_markdown(text)}" for name, text in facts.items()))
    for section in sections:
        parts += [f"## {escape_markdown(section.title)}", section.text]
        parts += [to_markdown(table).strip() for table in section.tables]
        for figure in section.figures:
            parts.append(f"![{figure.name}](figures/{figure.name}.png)")
            parts.append(escape_markdown(figure.caption))
    return "\n\n".join(part for part in parts if part) + "\n"


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
