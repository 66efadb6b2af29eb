"""The end of `holdfast teach`: what was found out of fold, beside doing nothing."""

from typing import TYPE_CHECKING

from holdfast.cli.scores import (
    SHARES_HEADER,
    SHARES_NOTE,
    format_intervals,
    never_cells,
    share_cells,
)
from holdfast.cli.terminal.console import print_line, print_paragraph, print_table

if TYPE_CHECKING:
    from holdfast.training.teaching import Taught

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
