"""Text of CSV tables that a spreadsheet takes as text, not as formulas."""

import csv
import re
from collections.abc import Iterable
from io import StringIO

_FORMULA = re.compile(r"'*[=+\-@\t\r]")
"""Begin of a text that a spreadsheet takes as a formula, or that was marked as text before."""


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    r"""Return the text of a CSV table, the cells that are text made by `text_cell`.

    Example:
        >>> csv_text([("finger", "start"), ("=1+1", -0.5)])
        "finger,start\n'=1+1,-0.5\n"
    """
    file = StringIO()
    writer = csv.writer(file, lineterminator="\n")
    quoting = csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_NONNUMERIC)
    for row in rows:
        cells = [text_cell(cell) if isinstance(cell, str) else cell for cell in row]
        # csv quotes no carriage return, and refuses to read one that is not quoted
        with_return = any(isinstance(cell, str) and "\r" in cell for cell in cells)
        (quoting if with_return else writer).writerow(cells)
    return file.getvalue()


def text_cell(text: str) -> str:
    """Return the cell of a text, with an apostrophe before what looks like a formula.

    Example:
        >>> text_cell("thumb"), text_cell("=1+1")
        ('thumb', "'=1+1")
    """
    return f"'{text}" if _FORMULA.match(text) else text


def cell_text(cell: str) -> str:
    """Return the text of a cell that `text_cell` made; other cells are their own text.

    Example:
        >>> cell_text("'=1+1"), cell_text("=1+1"), cell_text("'thumb'")
        ('=1+1', '=1+1', "'thumb'")
    """
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell
