"""Tables of the scores of a model, for `holdfast evaluate`, `train` and `tune`."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from holdfast.cli.terminal.console import (
    format_number,
    print_line,
    print_message,
    print_paragraph,
    print_table,
)

if TYPE_CHECKING:
    from holdfast.metrics import EventMetrics, Intervals, Metrics, SampleMetrics
    from holdfast.metrics.slip_curves import SlipIntervals, SlipSummary
    from holdfast.metrics.slips import SlipMetrics
    from holdfast.training import CurvePoint
    from holdfast.training.evaluation import Evaluation

PERCENT_FIELDS = ("accuracy", "fdr", "fpr", "fnr")
AUC_NOTE = (
    "AUC in contact: stable against unstable. AUC of all: also against no contact, "
    "where the force decides, not the probability."
)
"""Explanation of the two AUCs below their table."""
NO_RULE = "slips of fingers: the model has no slip rule"
UNKNOWN_SLIPS = "slips of fingers: not known in these recordings; the slip rule is not scored"
KEPT_RULE = "slips of fingers: the slip rule of --init is kept; holdfast evaluate scores it"
SHARES_NOTE = (
    "Micro: slips of at most 1 mm [%]. Shares found [%]: of the slips over 1 mm, before they slid "
    "1 mm; of all slips, within 0.05 and 0.1 s of the onset, where alarms up to 0.5 s early count, "
    "and before it. False alarms per minute of quiet hold and of all held time."
)
"""Explanation of the columns of the scores of slips."""
NEVER_NOTE = ' The row "never" is a model that never reports a slip.'
SHARES_HEADER = ("micro", "before 1 mm", "0.05", "0.1", "by onset", "quiet", "held")


def warn_about_recordings(evaluation: "Evaluation", n_recordings: int) -> None:
    """Print the names of recordings on which the model was trained, and of copies."""
    pairs = [f"{name} of {original}" for name, original in evaluation.copies]
    trained_on = evaluation.trained_on
    # Five names say which recordings are meant; a folder may have hundreds.
    copies, names = (", ".join(x[:5]) + (" ..." if len(x) > 5 else "") for x in (pairs, trained_on))
    if copies:
        print_message(f"copies, with the same readings: {copies}; the verdict counts them once")
    if trained_on:
        print_message(
            f"the model was trained on {len(trained_on)} of these {n_recordings} recordings "
            f"({names}): their metrics are optimistic"
        )


def print_verdict(sentence: str) -> None:
    """Print what a model is worth."""
    print_paragraph(sentence)
    print_line()


def print_metrics(metrics: "Metrics") -> None:
    """Print two tables, by sample and by event, and the intervals of all fingers together.

    The last row of each is of a model that decides every sample STABLE.
    """
    pooled, hand = metrics.pooled, metrics.events.hand
    (tn, fp), (fn, tp) = pooled.confusion
    # A model that says nothing but STABLE is right wherever the label is: the least to beat.
    shares = [format_number(100 * k / max(pooled.n, 1), 1) for k in (fn + tp, tn + fp)]
    print_line("by sample")
    print_table(
        ("", "n", "accuracy %", "FDR %", "FPR %", "FNR %", "AUC in contact", "AUC of all"),
        [
            *(_sample_row(name, finger) for name, finger in metrics.fingers.items()),
            _sample_row("all", pooled),
            ("always STABLE", str(pooled.n), *shares, "100.0", "0.0", "0.500", "0.500"),
        ],
    )
    print_paragraph(AUC_NOTE)
    print_line()
    margin = ", without their margin" if hand.onsets == "rule" else ""
    print_line(f"by event (onset of instability in a held contact, {origin_of(hand)}{margin})")
    missed = ["100.0" if hand.n_events else "-"] * len(hand.missed)
    print_table(
        (
            "",
            "events",
            "missed 0.05 s",
            "0.1 s",
            "0.2 s %",
            "delay s",
            "alarms /min",
            "UNSTABLE %",
            "rises /min",
        ),
        [
            *(_event_row(name, finger) for name, finger in metrics.events.fingers.items()),
            _event_row("hand", hand),
            ("always STABLE", str(hand.n_events), *missed, "never", "0.0", "0.0", "0.0"),
            ("always UNSTABLE", str(hand.n_events), *missed, "never", "0.0", "100.0", "0.0"),
        ],
    )
    if metrics.intervals is not None:
        _print_intervals(metrics.intervals)
    if metrics.score_bins is not None:
        print_line(f"AUC from {metrics.score_bins} bins of probability, because of many samples")


def _sample_row(name: str, metrics: "SampleMetrics") -> tuple[str, ...]:
    percents = (format_number(getattr(metrics, field), 1) for field in PERCENT_FIELDS)
    aucs = (format_number(metrics.auc_contact, 3), format_number(metrics.auc, 3))
    return name, str(metrics.n), *percents, *aucs


def _event_row(name: str, metrics: "EventMetrics") -> tuple[str, ...]:
    missed = (format_number(share, 1) for share in metrics.missed.values())
    is_never = metrics.delay_median is None and metrics.n_events > 0  # half or more were missed
    delay = "never" if is_never else format_number(metrics.delay_median, 3)
    rates = (metrics.false_alarms_per_minute, metrics.held_unstable, metrics.rises_per_minute)
    numbers = (format_number(rate, 1) for rate in rates)
    return name, str(metrics.n_events), *missed, delay, *numbers


def _print_intervals(intervals: "Intervals") -> None:
    parts = [
        f"{name} {format_number(low, digits)} to {format_number(high, digits)}"
        for name, field, digits in (
            ("accuracy", "accuracy", 1),
            ("FDR", "fdr", 1),
            ("FNR", "fnr", 1),
            ("AUC in contact", "auc_contact", 3),
        )
        if (interval := getattr(intervals, field)) is not None
        for low, high in [interval]
    ]
    groups = "" if intervals.n_groups is None else f" in {intervals.n_groups} groups"
    of = f"{intervals.n_recordings} recordings{groups}"
    print_line()
    print_paragraph(f"{100 * intervals.level:g} % intervals over {of}: " + ", ".join(parts))


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
    print_line(f"slips of fingers ({origin_of(summary.pooled)})")
    pooled = summary.pooled
    rows = [_finger_row(name, finger) for name, finger in summary.fingers.items()]
    rows.append(_finger_row("all", pooled))
    rows.append(("never", str(pooled.n), *never_cells(pooled), "0.500"))
    print_table(("", "slips", *SHARES_HEADER, "AUC"), rows)
    print_paragraph(SHARES_NOTE)
    support = f"{pooled.quiet_minutes:.1f} min quiet of {pooled.held_minutes:.1f} min held"
    if pooled.raised_quiet is not None:
        support += f"; a slip is reported in {pooled.raised_quiet:.2f} % of quiet hold"
    if pooled.unknown is not None:
        support += (
            f"; {pooled.unknown:.0f} % of the held time is unknown: no label says what slides"
        )
    print_paragraph(f"Of one finger: {support}.{NEVER_NOTE}")
    if (impacts := pooled.impacts) is not None:
        print_paragraph(
            "Knocks, taps and bumps without a slip: "
            f"{impacts.false_alarms_per_impact:.2f} false alarms for each, of one finger "
            f"({impacts.n})."
        )
    if summary.intervals is not None:
        print_line()
        print_paragraph(format_intervals(summary.intervals, chosen=summary.threshold_chosen))


def origin_of(metrics: "EventMetrics | SlipMetrics") -> str:
    """Return where the onsets come from, in words."""
    from holdfast.metrics.truth_labels import ORIGINS

    return ORIGINS[metrics.onsets]


def share_cells(metrics: "SlipMetrics") -> tuple[str, ...]:
    """Return the cells below `SHARES_HEADER`."""
    rates, found = metrics.false_alarms_per_minute, metrics.incipient
    shares = (metrics.before_1mm, found["0.05"], found["0.1"], found["before"])
    return (
        _micro_cell(metrics),
        *(format_number(share, 0) for share in shares),
        *(format_number(rates[time], 2) for time in ("quiet", "held")),
    )


def _micro_cell(metrics: "SlipMetrics") -> str:
    # A label says when a finger slides, not how far.
    if not metrics.n or metrics.onsets in ("labels", "rule"):
        return "-"
    return format_number(100 * (1 - metrics.n_over_1mm / metrics.n), 0)


def never_cells(metrics: "SlipMetrics") -> tuple[str, ...]:
    """Return the cells below `SHARES_HEADER` of a model that never reports one of these slips."""
    shares = ["0" if metrics.n else "-"] * (len(SHARES_HEADER) - 3)  # two are rates of false alarms
    return (_micro_cell(metrics), *shares, "0.00", "0.00")


def _finger_row(name: str, metrics: "SlipMetrics") -> tuple[str, ...]:
    return name, str(metrics.n), *share_cells(metrics), format_number(metrics.auc, 3)


def format_intervals(intervals: "SlipIntervals", *, chosen: bool) -> str:
    """Return the intervals of the row of all fingers, and whether they include the choice."""
    from holdfast.metrics.summary import LEVEL

    shares = {
        "before 1 mm": intervals.before_1mm,
        "within 0.05 s": intervals.incipient["0.05"],
        "within 0.1 s": intervals.incipient["0.1"],
        "before the onset": intervals.incipient["before"],
    }
    rates = {
        f"false alarms of {name}": intervals.false_alarms_per_minute[name]
        for name in ("quiet", "held")
    }
    parts = [
        f"{name} {form.format(*interval)}"
        for known, form in ((shares, "{:.0f} to {:.0f} %"), (rates, "{:.2f} to {:.2f}"))
        for name, interval in known.items()
        if interval is not None
    ]
    choice = "with the choice of the threshold" if chosen else "without a choice of the threshold"
    return f"{100 * LEVEL:g} % intervals of all slips, {choice}: " + ", ".join(parts)


def print_points(points: "Sequence[CurvePoint]", notes: dict[float, str]) -> None:
    """Print the scores at several thresholds of the probability of stability, or of a slip.

    Args:
        points: lowest threshold first.
        notes: word beside a threshold.
    """
    # The points are of one question: all have the scores of slips, or none has.
    slips = {point.threshold: point.slips for point in points if point.slips is not None}
    if slips:
        print_line(f"slips of fingers at each threshold ({origin_of(next(iter(slips.values())))})")
        print_table(
            ("threshold", *SHARES_HEADER, ""),
            [(f"{t:.4g}", *share_cells(x), notes.get(t, "")) for t, x in slips.items()],
        )
        print_paragraph(SHARES_NOTE)
        return
    print_line("of the hand; missed events within 0.05, 0.1 and 0.2 s of their onset")
    rows = []
    for point, events in ((point, point.events) for point in points if point.events is not None):
        missed = (format_number(share, 1) for share in events.missed.values())
        never = events.delay_median is None and events.n_events
        delay = "never" if never else format_number(events.delay_median, 3)
        rates = f"{point.stable:.1f}", f"{point.false_alarms:.2f}"
        note = notes.get(point.threshold, "")
        rows.append((f"{point.threshold:.4g}", *rates, *missed, delay, note))
    header = ("threshold", "STABLE %", "false/min", "0.05 s %", "0.1 s %", "0.2 s %",
              "delay s", "")  # fmt: skip
    print_table(header, rows)
