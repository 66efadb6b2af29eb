"""Plain sentences on what a model is good for, from its metrics."""

from typing import NamedTuple

from holdfast.metrics import EventMetrics, Metrics, SampleMetrics
from holdfast.metrics.slips import SlipMetrics

CHANCE_AUC = 0.55
"""An AUC up to this is no better than chance, for the few recordings that users have."""
REACTION = (1.0, 10.0)
"""Maximum false alarms per minute, and events missed within 0.2 s [%], to react by itself."""
WATCHING = (10.0, 30.0)
"""The same for a person who watches."""
SLIP_REACTION = (1.5, 90.0)
"""Maximum false alarms per minute of held time, and minimum share of slips over 1 mm found before
they slid 1 mm [%], to react to slips by itself.

Thresholds are set for 1 false alarm a minute; 1.5 leaves room for other recordings. A grip that is
tightened before 1 mm still holds the object; one slip of ten may be too fast for that, as in
`REACTION`."""
MIN_JUDGED_SLIPS = 20
"""Fewer slips are not judged: with 20 of 20 found, the true share may be 86 % (95 % confidence)."""


class LoadedTares(NamedTuple):
    """Number of recordings whose tare was taken under load, and of all recordings."""

    loaded: int
    total: int

    def __str__(self) -> str:
        return f"tare taken under load in {self.loaded} of {self.total} recordings"


def verdict(metrics: Metrics, tares: LoadedTares | None = None) -> str:
    """Return what a model is good for: a sentence, and another about slips if they are scored.

    Args:
        metrics: of the model on labelled recordings.
        tares: recordings whose tare was taken under load; None if that is not known.
    """
    ending = "."
    if tares is not None and tares.loaded:
        ending = f"; {tares}: see --tare."
    events = metrics.events.hand
    sentence = (_unusable(metrics.pooled) or _by_events(metrics.pooled, events)) + ending
    if metrics.slips is None:
        return sentence
    return f"{sentence} {verdict_of_slips(metrics.slips.pooled)}"


def no_verdict(n_seen: int, n_recordings: int, model: str = "the model") -> str:
    """Return why there is no verdict: the model was trained on these recordings.

    Args:
        n_seen: number of recordings that it was trained on.
        n_recordings: number of all recordings.
        model: its name in the sentence.
    """
    return (
        f"No verdict: {model} was trained on {n_seen} of these {n_recordings} recordings. It "
        "needs labelled recordings that the model has not seen."
    )


def verdict_of_events(events: EventMetrics) -> str:
    """Return what a threshold is good for, in one sentence, without metrics by sample."""
    return f"{_use(events)}: {_alarms(events)}, {_missed(events)}."


def verdict_of_slips(slips: SlipMetrics) -> str:
    """Return what share of the slips is found in time, and what that is good for."""
    rate = slips.false_alarms_per_minute["held"]
    alarms = "" if rate is None else f" at {rate:.2g} false alarms a minute of held time"
    if not slips.n:
        return f"Slips: none in these recordings{alarms and f',{alarms}'}."
    origin = {"truth": "", "labels": " (by labels)", "mixed": " (by truth or labels)"}[slips.onsets]
    slips_word = f"slip{'s' * (slips.n != 1)}"
    return (
        f"Slips: {slips.incipient['0.1']:.0f} % of {slips.n} {slips_word} of fingers{origin} found "
        f"within 0.1 s{alarms}; {_slip_use(slips)}."
    )


def _slip_use(slips: SlipMetrics) -> str:
    """Return whether slips are found well enough to react to them."""
    rate = slips.false_alarms_per_minute["held"]
    n, share, found = slips.n_over_1mm, slips.before_1mm, "before 1 mm"
    if slips.onsets == "labels":  # they have no distance
        n, share, found = slips.n, slips.incipient["0.1"], "within 0.1 s"
    if share is None or rate is None or n < MIN_JUDGED_SLIPS:
        return f"too few to judge an automatic reaction ({n} of {MIN_JUDGED_SLIPS} needed)"
    max_rate, min_share = SLIP_REACTION
    if rate <= max_rate and share >= min_share:
        return "good for an automatic reaction to slips"
    return (
        f"not good enough for an automatic reaction to slips ({found}: {share:.0f} %, "
        f"{min_share:g} % needed at {max_rate:g} false alarms a minute)"
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


def _by_events(samples: SampleMetrics, events: EventMetrics) -> str:
    right = _right(samples)
    if events.false_alarms_per_minute is None:
        return f"Not enough labels for a verdict: the hand is never labelled stable; {right}"
    too_many = events.false_alarms_per_minute > WATCHING[0]
    if too_many:
        return f"{_use(events)}: {_alarms(events)} at this threshold (see holdfast tune); {right}"
    return f"{_use(events)}: {_alarms(events)}, {_missed(events)}; {right}"


def _use(events: EventMetrics) -> str:
    """Return what the false alarms and missed events allow."""
    alarms = events.false_alarms_per_minute or 0.0
    missed = events.missed["0.2"]
    if alarms > WATCHING[0]:
        return "Not good enough"
    if missed is None:
        return "No event to judge by"
    for use, (most_alarms, most_missed) in (
        ("Good for an automatic reaction", REACTION),
        ("Good for a person who watches", WATCHING),
    ):
        if alarms <= most_alarms and missed <= most_missed:
            return use
    return "Not good enough"


def _alarms(events: EventMetrics) -> str:
    alarms = events.false_alarms_per_minute or 0.0
    return f"{alarms:.{0 if alarms >= 10 else 1}f} false alarms a minute"


def _missed(events: EventMetrics) -> str:
    missed = events.missed["0.2"]
    if missed is None:
        return "no instability after a stable hold in these recordings"
    what = f"{events.n_events} onset{'s' * (events.n_events != 1)} of instability"
    return f"{missed:.0f} % of {what} missed within 0.2 s"


def _right(samples: SampleMetrics) -> str:
    """Return the accuracy, beside that of always deciding the commoner class."""
    (tn, fp), (fn, tp) = samples.confusion
    stable = fn + tp >= tn + fp
    constant = 100 * max(fn + tp, tn + fp) / samples.n
    name = "always STABLE" if stable else "never STABLE"
    text = f"{samples.accuracy:.0f} % of the samples right ({name}: {constant:.0f} %)"
    if samples.accuracy is not None and samples.accuracy <= constant:
        return f"only {text}"
    return text
