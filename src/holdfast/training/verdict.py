"""One word on what a model is worth, with the four numbers that decide it.

One rule decides, of stability and of slips: `_line`. The words are "good", "usable", "weak" and
"not enough data".
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from holdfast.metrics import Metrics
from holdfast.metrics.slip_curves import SlipSummary
from holdfast.metrics.statistics import Interval
from holdfast.metrics.truth_labels import ORIGINS

MIN_EVENTS, MIN_MINUTES, MIN_JUDGED_RECORDINGS = 20, 10.0, 5
"""Evidence that a positive verdict needs: events, held time [min] and recordings.

With 20 of 20 events found, the true share may be 86 % (95 % confidence). Recordings are what the
intervals are drawn over."""
RULE_OF_THREE = 3.0
"""Without an alarm in T minutes, the true rate is at most 3 / T a minute (95 % confidence)."""
USES = (("good", 1.0, 10.0), ("usable", 10.0, 30.0))
"""Maximum false alarms per minute, and events missed within 0.2 s [%], of each word.

An automatic reaction needs "good"; a person who watches can work with "usable"."""
SLIP_USES = (("good", 1.5, 10.0), ("usable", 3.0, 50.0))
"""Maximum false alarms per minute of held time, and slips over 1 mm not found before they slid
1 mm [%].

Thresholds are set for 1 false alarm a minute; 1.5 leaves room for other recordings. A grip that is
tightened before 1 mm still holds the object; one slip of ten may be too fast for that."""


class LoadedTares(NamedTuple):
    """Number of recordings whose tare was taken under load, and of all recordings."""

    loaded: int
    total: int

    def __str__(self) -> str:
        return f"tare taken under load in {self.loaded} of {self.total} recordings"


class Bounded(NamedTuple):
    """A measured value, and the upper end of its interval, which decides."""

    value: float
    upper: float

    @classmethod
    def of(cls, value: float | None, interval: Interval | None, least: float = 0.0) -> "Bounded":
        """Return a value, 0 if it is None, with its upper end, which is at least `least`."""
        known, upper = value or 0.0, interval[1] if interval is not None else None
        return cls(known, max(known, least if upper is None else max(upper, least)))

    @classmethod
    def rate(cls, rate: float | None, minutes: float, interval: Interval | None) -> "Bounded":
        """Return the bound of a rate of false alarms [1/min]."""
        return cls.of(rate, interval, RULE_OF_THREE / minutes if minutes else 0.0)

    def text(self) -> str:
        """Return the value and its upper end, without an exponent."""
        if self.upper > self.value:
            upper = _number(self.upper)
            return f"{_number(self.value)} (up to {upper})" if self.value else f"at most {upper}"
        return _number(self.value)


def _number(value: float) -> str:
    """Return a number with two digits or more, and without an exponent."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


class Support(NamedTuple):
    """Evidence of a verdict.

    Attributes:
        n_events: number of events.
        what: the events are.
        minutes: held time [min].
        n_recordings: number of recordings with labels, without copies.
    """

    n_events: int
    what: str
    minutes: float
    n_recordings: int

    def missing(self) -> str:
        """Return what a positive verdict lacks; empty if it lacks nothing."""
        parts = [
            (self.n_events, MIN_EVENTS, self.what),
            (math.floor(10 * self.minutes) / 10, MIN_MINUTES, "held minutes"),
            (self.n_recordings, MIN_JUDGED_RECORDINGS, "recordings"),
        ]
        return ", ".join(f"{n:g} of {least:g} {name}" for n, least, name in parts if n < least)


def verdict(
    metrics: Metrics,
    tares: LoadedTares | None = None,
    *,
    in_sample: bool = False,
    reports_slips: bool = True,
) -> str:
    """Return the word and the numbers of stability, and of slips if they are scored.

    Args:
        metrics: of the model on labelled recordings, without copies.
        tares: recordings whose tare was taken under load; None if that is not known.
        in_sample: a threshold of the model was chosen on some of the recordings.
        reports_slips: the model has a threshold of slips that is ever reached.
    """
    n = sum(
        any(finger.n + finger.n_undecided for finger in recording.fingers.values())
        for recording in metrics.recordings
    )
    lines = [_of_stability(metrics, n, in_sample=in_sample)]
    if tares is not None and tares.loaded:
        lines.append(f"{tares}: see --tare.".capitalize())
    slips = metrics.slips
    if slips is not None and reports_slips:
        lines.append(slips_verdict(slips, n, in_sample=in_sample))
    elif slips is not None:
        auc = "" if slips.pooled.auc is None else f"; P(slip) has an AUC of {slips.pooled.auc:.2f}"
        silent = "none is reported until the model is calibrated (holdfast calibrate)"
        lines.append(f"Slips: {silent}{auc}.")
    return " ".join(lines)


def no_verdict(n_seen: int, n_recordings: int, model: str = "the model") -> str:
    """Return why there is no verdict: the model was trained on these recordings.

    Args:
        n_seen: number of recordings that it was trained on.
        n_recordings: number of all recordings.
        model: its name in the sentence.
    """
    return (
        f"No verdict: in sample, {model} was trained on {n_seen} of these {n_recordings} "
        "recordings. It needs labelled recordings that the model has not seen."
    )


def _line(
    uses: Sequence[tuple[str, float, float]],
    alarms: Bounded,
    missed: Bounded,
    how: str,
    support: Support,
    notes: Sequence[str],
) -> str:
    """Return the word whose limits hold, with rate, misses, events and held time.

    What fails by its value is weak, with any support; the upper ends decide about all other words,
    and these need support.
    """
    *_, (_, most_alarms, most_missed) = uses
    lacking = support.missing()
    if alarms.value > most_alarms or missed.value > most_missed:
        word = "weak"
    elif lacking:
        word, notes = "not enough data", [lacking, *notes]
    else:
        fits = [use for use, a, m in uses if alarms.upper <= a and missed.upper <= m]
        word = fits[0] if fits else "weak"
    note = f" ({', '.join(notes)})" if notes else ""
    return (
        f"{word}{note}: {alarms.text()} false alarms a minute, {missed.text()} % missed {how}; "
        f"{support.what}: {support.n_events}, held minutes: {_number(support.minutes)}."
    )


def _of_stability(metrics: Metrics, n_recordings: int, *, in_sample: bool) -> str:
    events = metrics.events.hand
    limits = None if metrics.intervals is None else metrics.intervals.hand
    alarms = Bounded.rate(
        events.false_alarms_per_minute,
        events.stable_minutes,
        None if limits is None else limits.false_alarms_per_minute,
    )
    missed = Bounded.of(events.missed["0.2"], None if limits is None else limits.missed["0.2"])
    support = Support(events.n_events, "onsets", events.stable_minutes, n_recordings)
    notes = ["in sample"] * in_sample + ["labels by rule"] * (events.onsets == "rule")
    return f"Stability: {_line(USES, alarms, missed, 'within 0.2 s', support, notes)}"


def slips_verdict(summary: SlipSummary, n_recordings: int, *, in_sample: bool = False) -> str:
    """Return the word and the numbers of slips.

    Args:
        summary: of the slips.
        n_recordings: number of recordings with labels, without copies.
        in_sample: the threshold was chosen on some of the recordings.
    """
    slips, limits = summary.pooled, summary.intervals
    alarms = Bounded.rate(
        slips.false_alarms_per_minute["held"],
        slips.held_minutes,
        None if limits is None else limits.false_alarms_per_minute["held"],
    )
    n, found, how, what = slips.n, slips.incipient["0.1"], "within 0.1 s", "slips"
    interval = None if limits is None else limits.incipient["0.1"]
    if slips.onsets in ("truth", "mixed"):
        n, found, how, what = slips.n_over_1mm, slips.before_1mm, "before 1 mm", "slips over 1 mm"
        interval = None if limits is None else limits.before_1mm
    low = None if interval is None else interval[0]
    missed = Bounded.of(
        None if found is None else 100 - found, None if low is None else (0.0, 100 - low)
    )
    support = Support(n, what, slips.held_minutes, n_recordings)
    notes = ["in sample"] * in_sample
    notes += [ORIGINS[slips.onsets]] * (slips.onsets != "truth")
    return f"Slips: {_line(SLIP_USES, alarms, missed, how, support, notes)}"
