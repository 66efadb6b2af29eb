"""Metrics for a person: two tables, by sample and by event."""

from typing import TYPE_CHECKING

from holdfast.cli.console import print_table, show

if TYPE_CHECKING:
    from holdfast.metrics import EventMetrics, Intervals, Metrics, SampleMetrics

PERCENT = ("accuracy", "fdr", "fpr", "fnr")


def show_metrics(metrics: "Metrics") -> None:
    """Prints the figures by sample and by event, with the intervals of the whole."""
    rows = [_sample_row(name, finger) for name, finger in metrics.fingers.items()]
    show("by sample")
    print_table(
        ("", "n", "accuracy %", "FDR %", "FPR %", "FNR %", "AUC", "AUC in contact"),
        [*rows, _sample_row("all", metrics.pooled)],
    )
    show("\nby event (onset of instability in a held contact)")
    events = [*metrics.events.fingers.items(), ("hand", metrics.events.hand)]
    print_table(
        ("", "events", "missed in 0.05 s %", "0.1 s %", "0.2 s %", "median delay s", "p95 s",
         "false alarms/min"),
        [_event_row(name, each) for name, each in events],
    )  # fmt: skip
    if metrics.intervals is not None:
        _show_intervals(metrics.intervals)


def _sample_row(name: str, each: "SampleMetrics") -> tuple[str, ...]:
    shares = (_number(getattr(each, field), 1) for field in PERCENT)
    return name, str(each.n), *shares, _number(each.auc, 3), _number(each.auc_contact, 3)


def _event_row(name: str, each: "EventMetrics") -> tuple[str, ...]:
    missed = (_number(share, 1) for share in each.missed.values())
    delays = (
        _number(delay, 3) if delay is not None or not each.n_events else "never"
        for delay in (each.delay_median, each.delay_p95)
    )
    return name, str(each.n_events), *missed, *delays, _number(each.false_alarms_per_minute, 1)


def _show_intervals(intervals: "Intervals") -> None:
    parts = [
        f"{name} {_number(low, digits)} to {_number(high, digits)}"
        for name, digits in (("accuracy", 1), ("fdr", 1), ("fnr", 1), ("auc", 3))
        if (interval := getattr(intervals, name)) is not None
        for low, high in [interval]
    ]
    show(
        f"\n{100 * intervals.level:g} % intervals over {intervals.n_recordings} recordings: "
        + ", ".join(parts)
    )


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
