"""Tables laid out for people: HTML, LaTeX and Markdown.

Each cell holds ours, the interval, and where there is one the paper's figure with the
difference, ours less the paper's.
"""

import html
from collections.abc import Callable, Iterable, Sequence

from holdfast.study.report.escape import as_html, as_latex, as_markdown
from holdfast.study.report.result_tables import (
    INFINITE,
    MINUS,
    NOTHING,
    ResultTable,
    Row,
    TableLine,
    digits_of,
    number_text,
    pivot,
)

N = "recordings"
"""Head of the column that says how many recordings a line rests on."""
PAPER = "paper"
DIFFERENCE = "difference"
INTERVALS = "Small print: 95 % interval, by bootstrap over recordings."
PAPERS = "Paper: what it prints, and ours less that."
WIDE = 7
"""A LaTeX table with more columns goes over both columns of a page."""


def to_html(table: ResultTable, number: int | None = None) -> str:
    """The table as an HTML `figure`: caption above, note below.

    Args:
        table: to lay out.
        number: in a report, told in the caption.
    """
    grid = pivot(table)
    counted = _n_varies(table)
    heads = [f'<th scope="col">{as_html(key)}</th>' for key in table.lines]
    columns = [*grid.columns, *[N] * counted]
    heads += [f'<th scope="col" class="value">{as_html(column)}</th>' for column in columns]
    body: list[str] = []
    for before, line in zip((None, *grid.lines), grid.lines, strict=False):
        cells = [
            _html_cell(row, digits_of(table, column))
            for column, row in zip(grid.columns, line.cells, strict=True)
        ]
        cells += [f'<td class="n">{_n_text(line.cells)}</td>'] * counted
        body.append(_html_line(line, before, cells))
    label = "" if number is None else f'<span class="number">Table {number}.</span> '
    return (
        f'<figure class="table" id="table-{table.name}">\n'
        f"<figcaption>{label}{as_html(table.title)}</figcaption>\n"
        f'<div class="scroll" tabindex="0" role="region" aria-label="{html.escape(table.title)}">\n'
        f"<table>\n<thead>{_html_over(table, len(grid.columns))}<tr>{''.join(heads)}</tr></thead>\n"
        "<tbody>\n"
        + "\n".join(body)
        + "\n</tbody>\n</table>\n</div>\n"
        + "".join(f'<p class="note">{as_html(note)}</p>\n' for note in notes(table))
        + "</figure>\n"
    )


def to_latex(table: ResultTable) -> str:
    r"""The table as a LaTeX `table`; it needs the packages booktabs and graphicx.

    The interval, and the paper's figure with the difference, stand in lines of their own. What
    is wider than the text is made smaller.
    """
    grid = pivot(table)
    counted = _n_varies(table)
    heads = [as_latex(text) for text in (*table.lines, *grid.columns, *[N] * counted)]
    body: list[str] = []
    for before, line in zip((None, *grid.lines), grid.lines, strict=False):
        if before is not None and before.heads[:1] != line.heads[:1]:
            body.append(r"\addlinespace")
        body += _latex_lines(table, line, before, grid.columns, counted)
    place = "table*" if len(heads) > WIDE else "table"
    caption = " ".join(f"{_sentence(text)}" for text in (table.title, *notes(table)))
    align = "l" * len(table.lines) + "r" * (len(grid.columns) + counted)
    return "\n".join(
        [
            rf"\begin{{{place}}}[tb]",
            r"\centering",
            r"\small",
            r"\setlength{\tabcolsep}{4pt}",
            rf"\caption{{{as_latex(caption)}}}",
            rf"\label{{tab:{table.name}}}",
            r"\vspace{4pt}",
            r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%",
            rf"\begin{{tabular}}{{{align}}}",
            r"\toprule",
            *_latex_over(table, len(grid.columns)),
            rf"{' & '.join(heads)} \\",
            r"\midrule",
            *body,
            r"\bottomrule",
            r"\end{tabular}}",
            rf"\end{{{place}}}",
            "",
        ]
    )


def to_markdown(table: ResultTable) -> str:
    """The table as GitHub's Markdown, with its title above and its notes below."""
    grid = pivot(table)
    counted = _n_varies(table)
    columns = [f"{_over(table)} {column}".strip() for column in grid.columns]
    lines = [[as_markdown(text) for text in (*table.lines, *columns, *[N] * counted)]]
    lines.append(["---"] * len(table.lines) + ["--:"] * (len(grid.columns) + counted))
    for line in grid.lines:
        cells = [
            _markdown_cell(row, digits_of(table, column))
            for column, row in zip(grid.columns, line.cells, strict=True)
        ]
        lines.append([*map(as_markdown, line.heads), *cells, *[_n_text(line.cells)] * counted])
    below = " ".join(as_markdown(_sentence(note)) for note in notes(table))
    body = "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
    return f"**{as_markdown(table.title)}**\n\n{body}\n" + f"\n{below}\n" * bool(below)


def notes(table: ResultTable) -> list[str]:
    """What stands below the table: its own note; what its cells rest on and mean."""
    counts = {row.n for row in table.rows if row.n is not None}
    found = []
    if len(counts) == 1:
        (n,) = counts
        found.append(f"On {n} recording{'s' * (n != 1)}.")
    if any(row.interval for row in table.rows):
        found.append(INTERVALS)
    if any(row.paper is not None for row in table.rows):
        found.append(PAPERS)
    return [note for note in (table.note.strip(), " ".join(found)) if note]


def _over(table: ResultTable) -> str:
    """What the columns are, where they do not say it themselves."""
    return "" if table.column == "figure" else table.column


def _html_over(table: ResultTable, n_columns: int) -> str:
    if not _over(table):
        return ""
    blank = "<td></td>" * len(table.lines)
    over = f'<th colspan="{n_columns}" scope="colgroup" class="over">{as_html(_over(table))}</th>'
    return f"<tr>{blank}{over}</tr>\n"


def _latex_over(table: ResultTable, n_columns: int) -> list[str]:
    if not _over(table):
        return []
    first = len(table.lines) + 1
    return [
        "& " * len(table.lines)
        + rf"\multicolumn{{{n_columns}}}{{c}}{{{as_latex(_over(table))}}} \\",
        rf"\cmidrule(lr){{{first}-{first + n_columns - 1}}}",
    ]


def _html_line(line: TableLine, before: TableLine | None, cells: Iterable[str]) -> str:
    """A line of the body; what it repeats of the line before is marked."""
    same = _n_same(line, before)
    again = ' class="again"'
    heads = (
        f'<th scope="row"{again * (k < same)}>{as_html(head)}</th>'
        for k, head in enumerate(line.heads)
    )
    kind = ' class="begins"' if before is not None and same == 0 and len(line.heads) > 1 else ""
    return f"<tr{kind}>{''.join(heads)}{''.join(cells)}</tr>"


def _html_cell(row: Row | None, digits: int) -> str:
    if row is None:
        return f'<td class="none">{number_text(None, 0)}</td>'
    text = f'<span class="ours">{number_text(row.ours, digits)}</span>'
    if interval := _interval_text(row, digits):
        text += f'<span class="interval">{interval}</span>'
    if row.paper is not None:
        text += f'<span class="paper">{PAPER} {number_text(row.paper, digits)}'
        if row.ours is not None:
            text += f' <b title="{DIFFERENCE}">{_difference_text(row, digits)}</b>'
        text += "</span>"
    return f"<td>{text}</td>"


def _latex_lines(
    table: ResultTable,
    line: TableLine,
    before: TableLine | None,
    columns: Sequence[str],
    counted: bool,
) -> list[str]:
    """A line of the body, and under it those of the intervals and of the paper."""
    same = _n_same(line, before)
    heads = ["" if k < same else as_latex(head) for k, head in enumerate(line.heads)]
    digits = [digits_of(table, column) for column in columns]

    def texts(text: Callable[[Row, int], str]) -> list[str]:
        pairs = zip(line.cells, digits, strict=True)
        return [as_latex(text(row, n)) if row is not None else "" for row, n in pairs]

    ours = [text or "--" for text in texts(lambda row, n: number_text(row.ours, n))]
    lines = [[*heads, *ours, *[as_latex(_n_text(line.cells))] * counted]]
    blank = [""] * (len(heads) - 1)
    intervals = [rf"\scriptsize {text}" if text else "" for text in texts(_interval_text)]
    if any(intervals):
        lines.append([*blank, "", *intervals, *[""] * counted])
    papers = [rf"\scriptsize\itshape {text}" if text else "" for text in texts(_paper_text)]
    if any(papers):
        lines.append([*blank, rf"\quad\scriptsize\itshape {PAPER}", *papers, *[""] * counted])
    return [rf"{' & '.join(cells)} \\" for cells in lines]


def _markdown_cell(row: Row | None, digits: int) -> str:
    if row is None:
        return number_text(None, digits)
    told = row.ours is not None or row.paper is None
    parts = [number_text(row.ours, digits)] if told else []
    if interval := _interval_text(row, digits):
        parts.append(f"<sub>{interval}</sub>")
    if row.paper is not None:
        parts.append(f"*{PAPER} {_paper_text(row, digits)}*")
    return "<br>".join(parts)


def _interval_text(row: Row, digits: int) -> str:
    if row.interval is None:
        return ""
    low, high = (number_text(end, digits).replace(INFINITE, "∞") for end in row.interval)
    if (low, high) in ((NOTHING, NOTHING), ("∞", "∞")):
        return ""
    if NOTHING in (low, high):
        return f"from {low}" if high == NOTHING else f"to {high}"
    return f"{low} to {high}" if MINUS in low + high else f"{low}–{high}"


def _paper_text(row: Row, digits: int) -> str:
    """The paper's figure, and in brackets the difference."""
    if row.paper is None:
        return ""
    paper = number_text(row.paper, digits)
    return paper if row.ours is None else f"{paper} ({_difference_text(row, digits)})"


def _difference_text(row: Row, digits: int) -> str:
    return number_text(row.difference, digits, signed=True)


def _n_varies(table: ResultTable) -> bool:
    return len({row.n for row in table.rows if row.n is not None}) > 1


def _n_text(cells: Iterable[Row | None]) -> str:
    counts = sorted({row.n for row in cells if row is not None and row.n is not None})
    return "–".join(str(n) for n in dict.fromkeys([*counts[:1], *counts[-1:]])) or "–"


def _n_same(line: TableLine, before: TableLine | None) -> int:
    """How many of the first heads the line repeats; the last is always told."""
    if before is None:
        return 0
    pairs = zip(line.heads[:-1], before.heads[:-1], strict=True)
    return next((k for k, (a, b) in enumerate(pairs) if a != b), max(len(line.heads) - 1, 0))


def _sentence(text: str) -> str:
    return text if text.endswith((".", "!", "?", ":")) else f"{text}."
