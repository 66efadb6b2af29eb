"""Plain sentences on what a model is good for, from its metrics.

One rule decides, of stability and of slips: `_use`.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from holdfast.metrics import Metrics, SampleMetrics
from holdfast.metrics.slip_curves import SlipSummary
from holdfast.metrics.statistics import Interval
from holdfast.metrics.truth_labels import ORIGINS

CHANCE_AUC = 0.55
"""An AUC up to this is no better than chance, for the few recordings that users have."""
MIN_EVENTS, MIN_MINUTES, MIN_JUDGED_RECORDINGS = 20, 10.0, 5
"""Evidence that a positive verdict needs: events, held time [min] and recordings.

With 20 of 20 events found, the true share may be 86 % (95 % confidence). Recordings are what the
intervals are drawn over."""
RULE_OF_THREE = 3.0
"""Without an alarm in T minutes, the true rate is at most 3 / T a minute (95 % confidence)."""
USES = (
    ("good for an automatic reaction", 1.0, 10.0),
    ("good for a person who watches", 10.0, 30.0),
)
"""Maximum false alarms per minute, and events missed within 0.2 s [%], of each use."""
SLIP_USES = (("good for an automatic reaction to slips", 1.5, 10.0),)
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

    def alarms(self) -> str:
        """Return the rate in words."""
        if not self.value:
            return f"at most {_rate(self.upper)} false alarms a minute"
        upper = f" (up to {_rate(self.upper)})" if self.upper > self.value else ""
        return f"{_rate(self.value)}{upper} false alarms a minute"


def _rate(value: float) -> str:
    """Return a number a minute with two digits or more, and without an exponent."""
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
    """Return what a model is good for: a sentence, and another about slips if they are scored.

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
    # What is not usable at all has no rates worth a sentence.
    sentence = _unusable(metrics.pooled) or _by_events(metrics, n, in_sample=in_sample)
    ending = f"; {tares}: see --tare." if tares is not None and tares.loaded else "."
    slips = metrics.slips
    if slips is None:
        return sentence + ending
    if reports_slips:
        return f"{sentence}{ending} {_by_slips(slips, n, in_sample=in_sample)}"
    auc = "" if slips.pooled.auc is None else f"; P(slip) has an AUC of {slips.pooled.auc:.2f}"
    silent = "none is reported until the model is calibrated (holdfast calibrate)"
    return f"{sentence}{ending} Slips: {silent}{auc}."


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


def _use(
    uses: Sequence[tuple[str, float, float]],
    alarms: Bounded,
    missed: Bounded,
    support: Support,
    *,
    in_sample: bool,
    by_rule: bool,
) -> str:
    """Return the first use whose limits hold; a positive one needs support.

    What fails by its value is not good enough, with any support. The upper ends decide.
    """
    *_, (_, most_alarms, most_missed) = uses
    fits = [use for use, a, m in uses if alarms.upper <= a and missed.upper <= m]
    lacking = support.missing()
    if alarms.value > most_alarms or missed.value > most_missed or not (fits or lacking):
        use = "not good enough"
    elif lacking:
        use = f"not enough data: {lacking}"
    else:
        use = fits[0]
    notes = ["in sample"] * in_sample + ["labels by rule"] * by_rule
    return use + (f" ({', '.join(notes)})" if notes else "")


def _by_events(metrics: Metrics, n_recordings: int, *, in_sample: bool) -> str:
    events, intervals = metrics.events.hand, metrics.intervals
    limits = None if intervals is None else intervals.hand
    minutes = events.stable_minutes
    alarms = Bounded.rate(
        events.false_alarms_per_minute,
        minutes,
        None if limits is None else limits.false_alarms_per_minute,
    )
    missed = Bounded.of(events.missed["0.2"], None if limits is None else limits.missed["0.2"])
    support = Support(events.n_events, "events", minutes, n_recordings)
    by_rule = events.onsets == "rule"
    use = _use(USES, alarms, missed, support, in_sample=in_sample, by_rule=by_rule)
    hint = " at this threshold (see holdfast tune)" if alarms.value > USES[-1][1] else ""
    rate = alarms.alarms() if minutes else "the hand is never labelled stable"
    misses = "no instability after a stable hold in these recordings"
    if events.n_events:
        what = f"{events.n_events} onset{'s' * (events.n_events != 1)} of instability"
        upper = f" (up to {missed.upper:.0f} %)" if missed.upper > missed.value else ""
        misses = f"{missed.value:.0f} %{upper} of {what} missed within 0.2 s"
    # The accuracy stands beside that of always deciding the commoner class: labels are rarely half
    # and half, and 90 % may be worse than no detector.
    samples = metrics.pooled
    (tn, fp), (fn, tp) = samples.confusion
    constant = 100 * max(fn + tp, tn + fp) / samples.n
    name = "always STABLE" if fn + tp >= tn + fp else "never STABLE"
    right = f"{samples.accuracy:.0f} % of the samples right ({name}: {constant:.0f} %)"
    if samples.accuracy is not None and samples.accuracy <= constant:
        right = f"only {right}"
    return f"{use[0].upper()}{use[1:]}: {rate}{hint}, {misses}; {right}"


def _by_slips(summary: SlipSummary, n_recordings: int, *, in_sample: bool) -> str:
    """Return what share of the slips is found in time, and what that is good for."""
    slips, limits = summary.pooled, summary.intervals
    alarms = Bounded.rate(
        slips.false_alarms_per_minute["held"],
        slips.held_minutes,
        None if limits is None else limits.false_alarms_per_minute["held"],
    )
    rate = f", {alarms.alarms()} of held time" if slips.held_minutes else ""
    if not slips.n:
        return f"Slips: none in these recordings{rate}."
    by_rule = slips.onsets == "rule"
    has_distance = slips.onsets in ("truth", "mixed")
    n, found, how = slips.n, slips.incipient["0.1"], "within 0.1 s"
    interval = None if limits is None else limits.incipient["0.1"]
    if has_distance:
        n, found, how = slips.n_over_1mm, slips.before_1mm, "before 1 mm"
        interval = None if limits is None else limits.before_1mm
    low = None if interval is None else interval[0]
    missed = Bounded.of(
        None if found is None else 100 - found, None if low is None else (0.0, 100 - low)
    )
    what = "slips over 1 mm" if has_distance else "slips"
    support = Support(n, what, slips.held_minutes, n_recordings)
    use = _use(SLIP_USES, alarms, missed, support, in_sample=in_sample, by_rule=by_rule)
    if use.startswith("not good enough"):
        _, most_alarms, most_missed = SLIP_USES[-1]
        least = f" (down to {100 - missed.upper:.0f} %)" if missed.upper > missed.value else ""
        use += (
            f" for an automatic reaction to slips: {how} {100 - missed.value:.0f} %{least}, "
            f"{100 - most_missed:g} % needed at {most_alarms:g} false alarms a minute"
        )
    origin = "" if slips.onsets == "truth" else f" ({ORIGINS[slips.onsets]})"
    return (
        f"Slips: {slips.incipient['0.1']:.0f} % of {slips.n} slip{'s' * (slips.n != 1)} of "
        f"fingers{origin} found within 0.1 s{rate}; {use}."
    )


def _unusable(samples: SampleMetrics) -> str:
    """Return why a model is not usable; empty if it may be."""
    (tn, fp), (fn, tp) = samples.confusion
    if not samples.n:
        return "Not usable: no labelled sample has a decision (tare, warm-up, gaps or faults)"
    if tp + fp == 0:
        return "Not usable: it never says STABLE"
    if tn + fn == 0:
        return "Not usable: it always says STABLE"
    auc = samples.auc_contact if samples.auc_contact is not None else samples.auc
    if auc is not None and auc <= CHANCE_AUC:
        return f"Not usable: it orders stable and unstable samples like chance (AUC {auc:.2f})"
    return ""
