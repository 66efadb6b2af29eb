"""The end of `holdfast teach`: what was found out of fold, beside doing nothing."""

from typing import TYPE_CHECKING

from holdfast.cli.scores import (
    SHARES_HEADER,
    SHARES_NOTE,
    format_intervals,
    never_cells,
    share_cells,
)
from holdfast.cli.terminal.console import (
    format_number,
    print_line,
    print_paragraph,
    print_table,
)

if TYPE_CHECKING:
    from holdfast.training.teaching import Taught

CURVE_HEADER = ("--false-alarms", "threshold", "before 1 mm", "0.1", "finger", "hand")
CURVE_NOTE = (
    "Other thresholds, out of fold: found before 1 mm and within 0.1 s [%], and false alarms a "
    "minute of a finger and of the hand. Teach again with the option to move along them."
)
NO_SLIPS = (
    "calibrated by your handling; no slip was measured, so its slips stay those of another hand "
    "(--camera 0 and stickers: holdfast label markers)"
)
"""Verdict of a protocol without a camera."""


def print_taught(taught: "Taught", base: str) -> None:
    """Print what was found out of fold, beside the model that was given and beside nothing."""
    pooled = taught.slips.pooled
    print_paragraph(taught.verdict)
    print_line()
    rows = [("taught", *share_cells(pooled))]
    if taught.base is not None:
        rows.append((base, *share_cells(taught.base.pooled)))
    rows.append(("never", *never_cells(pooled)))
    print_table(("", *SHARES_HEADER), rows)
    print_paragraph(SHARES_NOTE)
    if taught.slips.intervals is not None:
        print_paragraph(format_intervals(taught.slips.intervals, chosen=False))
    print_line()
    points = [
        (
            f"{point.wanted:g}", f"{point.threshold:.3f}", format_number(point.before_1mm, 0),
            format_number(point.found, 0), format_number(point.false_alarms, 2),
            f"{point.hand_false_alarms:.2f}",
        )
        for point in taught.curve
    ]  # fmt: skip
    print_table(CURVE_HEADER, points)
    print_paragraph(CURVE_NOTE)
