"""The paper's Table II as curves: figures by window, beside the paper's."""

from collections.abc import Sequence

import numpy as np

from holdfast.study.report.curves import Curve, draw_lines
from holdfast.study.report.page import Picture
from holdfast.study.report.style import PAPER
from holdfast.study.report.tables import Row, Table


def sweep(window: Table) -> Picture:
    """The deployed features by window, one panel a figure.

    Args:
        window: Table II, as `paper.tables` makes it.
    """
    rows = [row for row in window.rows if row.keys["features"] == "deployed"]
    names = list(dict.fromkeys(str(row.keys["figure"]) for row in rows))
    groups = {
        f"{name} [%]": _curves([r for r in rows if r.keys["figure"] == name]) for name in names
    }
    caption = (
        "The paper's Table II as curves: LogReg on the deployed features by window. Bands are 95 % "
        "intervals, by bootstrap over recordings; the line 'held out' is the paper's protocol, "
        "the others are recordings and objects that did not train."
    )
    return Picture("window", caption, draw_lines(groups, "$N_w$ [samples]", per_row=2))


def _curves(rows: Sequence[Row]) -> dict[str, Curve]:
    """Of one figure: ours by what it was measured on, and the paper's."""
    places = dict.fromkeys(str(row.keys["on"]) for row in rows)
    curves = {on: _curve([row for row in rows if row.keys["on"] == on]) for on in places}
    printed = {_window(row): row.paper for row in rows if row.paper is not None}
    if printed:
        curves[PAPER] = Curve(np.array(list(printed)), np.array(list(printed.values())))
    return curves


def _curve(rows: Sequence[Row]) -> Curve:
    ends = [row.interval or (None, None) for row in rows]
    low, high = (np.array([_number(end[k]) for end in ends]) for k in (0, 1))
    x = np.array([_window(row) for row in rows])
    return Curve(x, np.array([_number(row.ours) for row in rows]), low, high)


def _window(row: Row) -> float:
    return float(row.keys["N_w"])


def _number(value: float | None) -> float:
    return np.nan if value is None else value
