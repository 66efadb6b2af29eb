"""The report: one HTML file that needs nothing else, to read on a screen or on paper."""

import html
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from itertools import count
from typing import NamedTuple

from matplotlib.figure import Figure

from holdfast.study.report.escape import as_html
from holdfast.study.report.images import inline_image
from holdfast.study.report.result_tables import FILE_NAME, ResultTable
from holdfast.study.report.table_layouts import to_html


class ReportFigure(NamedTuple):
    """A figure of the report.

    Attributes:
        name: of its files: letters, digits, "-" and "_".
        caption: what it shows; its first sentence is its title in the contents.
        figure: drawn.
    """

    name: str
    caption: str
    figure: Figure


class Section(NamedTuple):
    """A part of the report.

    Attributes:
        title: of one line.
        text: plain paragraphs, set apart by empty lines; lines that all begin with "- " make
            a list.
        tables: of this part.
        figures: of this part; they follow the tables.
    """

    title: str
    text: str
    tables: Sequence[ResultTable] = ()
    figures: Sequence[ReportFigure] = ()


def report(title: str, facts: Mapping[str, object], sections: Sequence[Section]) -> str:
    """The whole report as one HTML document, without scripts and without links to elsewhere.

    Args:
        title: of the report.
        facts: what was run: versions, seed, data, machine, time. A list becomes lines, a
            mapping becomes "name: value" lines.
        sections: in order.

    Raises:
        ValueError: two tables or two figures have one name, or a name is no file name.
    """
    check_names(sections)
    tables, pictures = count(1), count(1)
    body = [
        _section(number, section, tables, pictures) for number, section in enumerate(sections, 1)
    ]
    style = (
        resources.files("holdfast.study.report").joinpath("page.css").read_text(encoding="utf-8")
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{html.escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        f"<header>\n<h1>{as_html(title)}</h1>\n{_facts(facts)}</header>\n"
        f"{_contents(sections)}<main>\n{''.join(body)}</main>\n</body>\n</html>\n"
    )


def check_names(sections: Sequence[Section]) -> None:
    """Does nothing where every table and every figure has a name of its own.

    Raises:
        ValueError: two have the same, or a figure's is no file name.
    """
    tables = [table.name for section in sections for table in section.tables]
    figures = [picture.name for section in sections for picture in section.figures]
    for kind, names in (("tables", tables), ("figures", figures)):
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ValueError(f"two {kind} of the report are called {twice[0]!r}")
    for name in figures:
        if not FILE_NAME.fullmatch(name):
            raise ValueError(f"a figure's name is letters, digits, - and _; {name!r} given")


def _contents(sections: Sequence[Section]) -> str:
    """Links to the sections, and under each to its tables and figures."""
    tables, pictures = count(1), count(1)
    items = []
    for number, section in enumerate(sections, 1):
        links = [
            _link(f"table-{table.name}", f"Table {next(tables)}", table.title)
            for table in section.tables
        ]
        links += [
            _link(f"figure-{name}", f"Figure {next(pictures)}", _first_sentence(caption))
            for name, caption, _ in section.figures
        ]
        inner = f"\n<ul>\n{''.join(links)}</ul>\n" if links else ""
        items.append(f'<li><a href="#section-{number}">{as_html(section.title)}</a>{inner}</li>\n')
    return (
        '<nav aria-labelledby="contents">\n<h2 id="contents">Contents</h2>\n'
        f"<ol>\n{''.join(items)}</ol>\n</nav>\n"
    )


def _link(target: str, label: str, text: str) -> str:
    return f'<li><a href="#{target}"><span>{label}</span> {as_html(text)}</a></li>\n'


def _first_sentence(caption: str) -> str:
    return caption.split(". ", maxsplit=1)[0].rstrip(".")


def _facts(facts: Mapping[str, object]) -> str:
    lines = (
        f"<div><dt>{as_html(name)}</dt><dd>{_fact(value)}</dd></div>\n"
        for name, value in facts.items()
    )
    return f'<dl class="facts">\n{"".join(lines)}</dl>\n' if facts else ""


def _fact(value: object) -> str:
    if isinstance(value, Mapping):
        return _fact([f"{name}: {each}" for name, each in value.items()])
    if isinstance(value, Iterable) and not isinstance(value, str):
        return "<br>".join(html.escape(str(each)) for each in value)
    return html.escape(str(value))


def _section(number: int, section: Section, tables: Iterable[int], pictures: Iterable[int]) -> str:
    parts = [f'<section id="section-{number}">\n<h2>{number}. {as_html(section.title)}</h2>\n']
    parts += [_paragraph(text) for text in section.text.split("\n\n") if text.strip()]
    parts += [to_html(table, k) for table, k in zip(section.tables, tables, strict=False)]
    parts += [_picture(each, k) for each, k in zip(section.figures, pictures, strict=False)]
    return "".join([*parts, "</section>\n"])


def _paragraph(text: str) -> str:
    lines = text.strip().splitlines()
    if all(line.startswith("- ") for line in lines):
        items = "".join(f"<li>{as_html(line[2:])}</li>\n" for line in lines)
        return f"<ul>\n{items}</ul>\n"
    return f"<p>{as_html(' '.join(line.strip() for line in lines))}</p>\n"


def _picture(picture: ReportFigure, number: int) -> str:
    name, caption, figure = picture
    return (
        f'<figure class="picture" id="figure-{name}">\n'
        f"{inline_image(figure, name, _first_sentence(caption))}"
        f'<figcaption><span class="number">Figure {number}.</span> {as_html(caption)}'
        "</figcaption>\n</figure>\n"
    )
