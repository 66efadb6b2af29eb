"""Tables of the scores of slips, for `holdfast evaluate`, `train` and `tune`."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from holdfast.cli.terminal.console import format_number, print_line, print_paragraph, print_table

if TYPE_CHECKING:
    from holdfast.metrics.slip_thresholds import SlipIntervals, SlipSummary
    from holdfast.metrics.slips import SlipMetrics
    from holdfast.metrics.statistics import Interval

NO_RULE = "slips of fingers: the model has no slip rule"
UNKNOWN_SLIPS = "slips of fingers: not known in these recordings; the slip rule is not scored"
KEPT_RULE = "slips of fingers: the slip rule of --init is kept; holdfast evaluate scores it"
SHARES_NOTE = (
    "Shares found [%]: before the onset; within 0.03, 0.05 and 0.1 s of it; of the slips over "
    "1 mm, within 0.1 s and before they slid 1 mm. False alarms per minute of quiet hold and of "
    "all held time."
)
"""Explanation of the columns of the scores of slips."""
NEVER_NOTE = ' The row "never" is a model that never reports a slip.'
SHARES_HEADER = (
    "by onset", "0.03", "0.05", "0.1", "0.1, 1 mm", "before 1 mm", "quiet", "held",
)  # fmt: skip


def print_slips(
    summary: "SlipSummary | None", *, has_rule: bool, unscored: str = UNKNOWN_SLIPS
) -> None:
    """Print the table of slips, or one line that says why there is none.

    Args:
        summary: of the slips of all fingers; None if no slips are known.
        has_rule: whether the model has a slip rule.
        unscored: the line for a rule without scores.
    """
    print_line()
    if not has_rule or summary is None:
        print_line(unscored if has_rule else NO_RULE)
        return
    print_line(f"slips of fingers ({slips_origin(summary.pooled)})")
    rows = [_finger_row(name, finger) for name, finger in summary.fingers.items()]
    print_table(
        ("", "slips", "over 1 mm", *SHARES_HEADER, "AUC"),
        [*rows, _finger_row("all", summary.pooled), _never_a_slip(summary.pooled)],
    )
    print_paragraph(SHARES_NOTE)
    print_paragraph(_support(summary.pooled) + NEVER_NOTE)
    if summary.intervals is not None:
        print_line()
        print_paragraph(_intervals(summary.intervals, chosen=summary.threshold_chosen))


def slips_origin(metrics: "SlipMetrics") -> str:
    """Return where the slips come from."""
    return {"truth": "by the truth", "mixed": "by truth or labels"}.get(metrics.onsets, "by labels")


def share_cells(metrics: "SlipMetrics") -> tuple[str, ...]:
    """Return the cells below `SHARES_HEADER`."""
    rates = metrics.false_alarms_per_minute
    shares = (*metrics.incipient.values(), metrics.over_1mm["0.1"], metrics.before_1mm)
    return (
        *(format_number(share, 0) for share in shares),
        *(format_number(rates[time], 2) for time in ("quiet", "held")),
    )


def _finger_row(name: str, metrics: "SlipMetrics") -> tuple[str, ...]:
    n_over = "-" if metrics.onsets in ("labels", "rule") else str(metrics.n_over_1mm)
    return (
        name, str(metrics.n), n_over, *share_cells(metrics), format_number(metrics.auc, 3)
    )  # fmt: skip


def _never_a_slip(metrics: "SlipMetrics") -> tuple[str, ...]:
    """Return the row of a model that never reports a slip."""
    n, n_over = _finger_row("", metrics)[1:3]
    shares = ["0"] * (len(SHARES_HEADER) - 2) if metrics.n else ["-"] * (len(SHARES_HEADER) - 2)
    return "never", n, n_over, *shares, "0.00", "0.00", "0.500"


def _support(metrics: "SlipMetrics") -> str:
    """Return of how much time the rates are, and how long a slip is reported in quiet hold."""
    minutes = f"{metrics.quiet_minutes:.1f} min quiet of {metrics.held_minutes:.1f} min held"
    if metrics.raised_quiet is None:
        return f"Of one finger: {minutes}."
    return (
        f"Of one finger: {minutes}; a slip is reported in {metrics.raised_quiet:.2f} % of quiet "
        "hold."
    )


def _intervals(intervals: "SlipIntervals", *, chosen: bool) -> str:
    """Return the intervals of the row of all fingers, and whether they include the choice."""
    from holdfast.metrics.summary import LEVEL

    shares = {
        "before the onset": intervals.incipient["before"],
        "within 0.1 s": intervals.incipient["0.1"],
        "over 1 mm within 0.1 s": intervals.over_1mm["0.1"],
        "before 1 mm": intervals.before_1mm,
    }
    rates = {
        f"false alarms of {name}": intervals.false_alarms_per_minute[name]
        for name in ("quiet", "held")
    }
    parts = [*_ranges(shares, "{:.0f} to {:.0f} %"), *_ranges(rates, "{:.2f} to {:.2f}")]
    choice = "with the choice of the threshold" if chosen else "without a choice of the threshold"
    return f"{100 * LEVEL:g} % intervals of all slips, {choice}: " + ", ".join(parts)


def _ranges(intervals: "Mapping[str, Interval | None]", form: str) -> list[str]:
    known = {name: interval for name, interval in intervals.items() if interval is not None}
    return [f"{name} {form.format(*interval)}" for name, interval in known.items()]


def print_slip_points(
    points: Iterable[tuple[float, "SlipMetrics"]], notes: dict[float, str], origin: str
) -> None:
    """Print the scores at several thresholds of the probability of a slip.

    Args:
        points: thresholds and their metrics, lowest first.
        notes: word beside a threshold.
        origin: where the slips come from.
    """
    print_line(f"slips of fingers at each threshold ({origin})")
    rows = [
        (f"{threshold:.4g}", *share_cells(metrics), notes.get(threshold, ""))
        for threshold, metrics in points
    ]
    print_table(("threshold", *SHARES_HEADER, ""), rows)
    print_paragraph(SHARES_NOTE)
