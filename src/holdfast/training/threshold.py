"""Choice of the threshold of a model for a wanted rate of false alarms.

The decision rule is replayed with each threshold, from probabilities that are computed once.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.detector.arrays import CANDIDATE, FILTERED, LAST_UNSTABLE, STATE
from holdfast.detector.decision_rule import (
    classify_contact,
    debounce,
    filter_probability,
    hold_unstable,
    new_decision_memory,
)
from holdfast.errors import ModelError, TrainingError
from holdfast.metrics import (
    AlarmMatch,
    Decisions,
    EventMetrics,
    FingerDecisions,
    hand_decisions,
    match_decisions,
    pool_events,
)
from holdfast.metrics.decisions import Codes
from holdfast.model import Choice, Debounce, FingerModel, HeadName, Model, ThresholdPoint
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Integers
from holdfast.training.evaluation import compute_decisions

LOG_ODDS = np.arange(-40, 41) * 0.2
"""Log odds of the thresholds that are tried first."""
FINE_STEPS = np.arange(-9, 10) * 0.02
"""Steps in log odds around the best of them."""
USABLE_SHARE = 0.5
"""A threshold is usable if the hand is STABLE in at least this share of the stable samples in
which it is STABLE at the lowest threshold: a hand that is never STABLE gives no false alarm."""
N_SHOWN = 3
"""Thresholds that are shown on either side of the chosen one."""


def with_threshold(model: Model, threshold: float) -> Model:
    """Return the model with another threshold of the probability for all fingers and sensors."""
    return with_head_threshold(model, "stable", threshold)


def with_head_threshold(
    model: Model, name: HeadName, threshold: float, choice: Choice | None = None
) -> Model:
    """Return the model with another threshold of a head, for all fingers and sensors."""

    def changed(part: FingerModel) -> FingerModel:
        head = part.head(name)
        part = part.without_thresholds(name)
        return part if head is None else part.with_heads(head.at(threshold, choice))

    return model.changed(changed)


@dataclass(frozen=True)
class ThresholdReplay:
    """Decisions about one recording, for any threshold.

    Attributes:
        raw: decisions without debouncing, hold and hysteresis, at the threshold 0: what is UNSTABLE
            then is so by its force, whatever the threshold.
        debounce: of the model.
        period: of the samples [s].
        n_model_fingers: number of fingers of the model.
    """

    raw: Decisions
    debounce: Debounce
    period: float
    n_model_fingers: int

    @classmethod
    def of(cls, model: Model, recording: Recording) -> "ThresholdReplay":
        """Compute the probabilities of a recording.

        Raises:
            ModelError: the recording has other fingers or sensors.
        """
        plain = msgspec.structs.replace(with_threshold(model, 0.0), debounce=Debounce())
        raw = compute_decisions(plain, recording)
        n_fingers = len(raw.fingers) if "*" in model.fingers else len(model.fingers)
        period = 1 / (model.rate or recording.rate)
        return cls(raw, model.debounce, period, n_fingers)

    def hand(self, threshold: float) -> FingerDecisions:
        """Return the decisions about the hand at a threshold."""
        fingers = {
            name: replace(finger, states=self.states(finger, threshold))
            for name, finger in self.raw.fingers.items()
        }
        return hand_decisions(fingers, self.n_model_fingers)

    def states(self, finger: FingerDecisions, threshold: float) -> Codes:
        """Return the states of a finger at a threshold."""
        out = np.zeros(len(finger.times), dtype=np.int8)
        rule = self.debounce
        memory = new_decision_memory(1)
        limits = np.array([
            threshold, rule.hysteresis, rule.hold, rule.min_duration, self.period,
            rule.switching_rate,
        ])  # fmt: skip
        _replay(
            np.array(finger.times), np.array(finger.stable_probability), np.array(finger.states),
            limits, memory.codes[0], memory.values[0], out,
        )  # fmt: skip
        return out


Steps = Callable[[Iterable[Recording]], Iterable[Recording]]


class ThresholdMetrics(msgspec.Struct, frozen=True):
    """Metrics of the hand at one threshold.

    Attributes:
        threshold: probability of stability from which on a contact is stable.
        stable: share of the samples labelled STABLE that are decided STABLE [%].
        events: false alarms, missed events and delays.
    """

    threshold: float
    stable: float
    events: EventMetrics

    @property
    def false_alarms(self) -> float:
        """False alarms per minute of stable label."""
        return self.events.false_alarms_per_minute or 0.0

    @property
    def missed(self) -> float:
        """Mean of the missed events over all `post` [%]; 0 without events."""
        return float(np.mean([share or 0.0 for share in self.events.missed.values()]))


@dataclass(frozen=True)
class Tuned:
    """Result of tuning.

    Attributes:
        model: with the chosen threshold.
        chosen: its metrics, by the detector itself.
        before: metrics of the model that was given, by replay.
        points: thresholds around it, by replay, lowest first; the chosen one is among them.
    """

    model: Model
    chosen: ThresholdMetrics
    before: ThresholdMetrics
    points: tuple[ThresholdMetrics, ...]


def tune(
    model: Model,
    recordings: Iterable[Recording],
    false_alarms: float,
    *,
    progress: Steps = lambda recordings: recordings,
) -> Tuned:
    """Choose the threshold with the fewest missed events for a rate of false alarms of the hand.

    The probabilities are computed once. The decision rule, with contact, hysteresis, hold and
    minimum duration, is replayed for every threshold. The detector itself confirms the chosen
    one.

    Args:
        model: to tune.
        recordings: labelled; are read once for the probabilities and once to confirm.
        false_alarms: maximum number per minute of stable label.
        progress: iterates over the recordings.

    Raises:
        ValueError: the rate is negative or not finite.
        TrainingError: the recordings have no labels, no stable labels, or no threshold gives
            so few false alarms.
        ModelError: the hand is never STABLE, whatever the threshold; or a recording has other
            fingers or sensors.
    """
    if not (math.isfinite(false_alarms) and false_alarms >= 0):
        raise ValueError(f"false alarms per minute of at least 0 expected, {false_alarms:g} given")
    recordings = list(recordings) if not isinstance(recordings, Sequence) else recordings
    digests: dict[str, str] = {}
    replays, before = [], 0.0
    for recording in progress(recordings):
        digests[recording.name] = recording.readings_digest
        before = max(before, _threshold_before(model, recording))
        replays.append(ThresholdReplay.of(model, recording))
    points = _usable([_point(replays, t) for t in _probabilities(LOG_ODDS)])
    first = _best(points, false_alarms)
    fine = [_point(replays, t) for t in _probabilities(_log_odds(first.threshold) + FINE_STEPS)]
    every = _in_order(_usable([*points, *fine]))
    chosen = _confirm(model, recordings, _ranked(every, false_alarms), false_alarms)
    choice = _record(chosen, points, digests, false_alarms)
    tuned = with_head_threshold(model, "stable", chosen.threshold, choice)
    return Tuned(
        msgspec.structs.replace(tuned, name=f"{model.name}, tuned" if model.name else ""),
        chosen,
        _point(replays, before),
        _around(points, chosen),
    )


def _threshold_before(model: Model, recording: Recording) -> float:
    """Return the highest threshold of the fingers on their sensors."""
    sensors = model.fingers_of({name: m.sensor for name, m in recording.modules.items()})
    return max(model.finger(*finger).stable.threshold for finger in sensors.items())


def _probabilities(log_odds: npt.NDArray[np.floating[Any]]) -> list[float]:
    return [float(f"{p:.5g}") for p in 1 / (1 + np.exp(-log_odds))]


def _log_odds(probability: float) -> float:
    return math.log(probability / (1 - probability))


def _point(replays: Sequence[ThresholdReplay], threshold: float) -> ThresholdMetrics:
    return _measure([replay.hand(threshold) for replay in replays], threshold)


def _measure(hands: Sequence[FingerDecisions], threshold: float) -> ThresholdMetrics:
    matches: list[AlarmMatch] = [alarms(hand) for hand in hands]
    counts = [stable_counts(hand) for hand in hands]
    labelled = sum(count["labelled"] for count in counts)
    if not any(hand.labels.any() for hand in hands):
        raise TrainingError(f"none of the recordings ({len(hands)}) has labels; labels expected")
    events = pool_events(matches)
    if not events.stable_minutes or not labelled:
        raise TrainingError(
            "no time in which the hand is labelled stable; false alarms are counted per minute "
            "of it"
        )
    decided = sum(count["decided"] for count in counts)
    return ThresholdMetrics(threshold, 100 * decided / labelled, events)


def _usable(points: list[ThresholdMetrics]) -> list[ThresholdMetrics]:
    """Return the thresholds at which the hand is STABLE often enough, and not for ever.

    Below the hysteresis of the model a stable contact stays stable, so that every event is missed.
    """
    most = max(point.stable for point in points)
    if most == 0:
        raise ModelError(
            "the model cannot be tuned: the hand is never STABLE at any threshold while it is "
            "labelled stable (see holdfast detect --summary)"
        )
    usable = [point for point in points if point.stable >= USABLE_SHARE * most]
    return [point for point in usable if (point.events.missed["0.2"] or 0.0) < 100] or usable


def _ranked(points: Sequence[ThresholdMetrics], false_alarms: float) -> list[ThresholdMetrics]:
    """Return the points with few enough false alarms, those that miss least first.

    Without events, the most sensitive first.
    """
    quiet = [point for point in points if point.false_alarms <= false_alarms]
    if points[0].events.n_events:
        return sorted(quiet, key=lambda point: (point.missed, point.false_alarms))
    return sorted(quiet, key=lambda point: -point.threshold)


def _best(points: Sequence[ThresholdMetrics], false_alarms: float) -> ThresholdMetrics:
    ranked = _ranked(points, false_alarms)
    if ranked:
        return ranked[0]
    least = min(points, key=lambda point: (point.false_alarms, point.missed))
    raise TrainingError(
        f"no threshold gives at most {false_alarms:g} false alarms a minute on these "
        f"recordings; the least is {least.false_alarms:.2g} at the threshold "
        f"{least.threshold:.3g}, which {_cost(least)}"
    )


def _cost(point: ThresholdMetrics) -> str:
    n = point.events.n_events
    if not n:
        return "has no event to miss"
    return f"misses {point.events.missed['0.2']:.0f} % of {n} events within 0.2 s"


def _confirm(
    model: Model,
    recordings: Sequence[Recording],
    ranked: Sequence[ThresholdMetrics],
    false_alarms: float,
) -> ThresholdMetrics:
    """Return the first point that the detector confirms; a long debouncing can differ a little."""
    for point in ranked:
        candidate = with_threshold(model, point.threshold)
        hands = [compute_decisions(candidate, recording).hand for recording in recordings]
        confirmed = _measure([hand for hand in hands if hand is not None], point.threshold)
        if confirmed.false_alarms <= false_alarms:
            return confirmed
    raise TrainingError(f"no threshold gives at most {false_alarms:g} false alarms a minute")


def _in_order(points: Iterable[ThresholdMetrics]) -> list[ThresholdMetrics]:
    return sorted({point.threshold: point for point in points}.values(), key=lambda p: p.threshold)


def _around(
    points: Sequence[ThresholdMetrics], chosen: ThresholdMetrics
) -> tuple[ThresholdMetrics, ...]:
    """Return the chosen point and its neighbours among the first thresholds."""
    others = [p for p in points if p.threshold != chosen.threshold]
    below = [p for p in others if p.threshold < chosen.threshold][-N_SHOWN:]
    above = [p for p in others if p.threshold > chosen.threshold][:N_SHOWN]
    return (*below, chosen, *above)


def _record(
    chosen: ThresholdMetrics,
    points: Sequence[ThresholdMetrics],
    digests: dict[str, str],
    false_alarms: float,
) -> Choice:
    events, missed = chosen.events, chosen.events.missed["0.2"]
    return Choice(
        recordings=digests,
        requested=false_alarms,
        false_alarms_per_minute=chosen.false_alarms,
        found=None if missed is None else 100 - missed,
        n=events.n_events,
        minutes=events.stable_minutes,
        points=tuple(_threshold_point(point) for point in _in_order([*points, chosen])),
    )


def _threshold_point(point: ThresholdMetrics) -> ThresholdPoint:
    return ThresholdPoint(point.threshold, round(point.false_alarms, 3), point.events.missed["0.2"])


@compiled
def _replay(
    times: Array,
    probability: Array,
    raw: Codes,
    limits: Array,
    codes: Integers,
    decided: Array,
    out: Codes,
) -> None:
    """Fill the states of a finger, by the steps of the detector.

    Args:
        times: (n,) [s].
        probability: (n,) of stability.
        raw: (n,) states without debouncing at the threshold 0: UNKNOWN, NO_CONTACT, STABLE, or
            UNSTABLE of a force that leaves.
        limits: threshold, hysteresis, hold [s], minimum duration [s], period [s] and switching
            [1/s].
        codes: as in `DecisionMemory`; is changed.
        decided: as in `DecisionMemory`; is changed.
        out: (n,) is filled.
    """
    threshold, hysteresis, hold, min_duration, period, switching = limits
    for k in range(len(times)):
        if raw[k] == UNKNOWN:
            codes[STATE] = codes[CANDIDATE] = UNKNOWN
            decided[LAST_UNSTABLE] = decided[FILTERED] = np.nan
        else:
            state = NO_CONTACT
            if raw[k] == NO_CONTACT:
                decided[FILTERED] = np.nan
            else:
                stable = probability[k]
                if switching > 0.0:
                    stable = filter_probability(decided, stable, threshold, switching, times[k])
                state = classify_contact(stable, threshold, hysteresis, codes[STATE])
                if raw[k] == UNSTABLE:
                    state = UNSTABLE
                state = hold_unstable(state, codes[CANDIDATE], decided, hold, times[k], period)
            debounce(codes, decided, state, min_duration, times[k], period)
        out[k] = codes[STATE]


def alarms(hand: FingerDecisions) -> AlarmMatch:
    """Return the events and alarms of the hand; none without labels."""
    return match_decisions(hand) if hand.labels.any() else AlarmMatch((), (), 0.0)


def stable_counts(hand: FingerDecisions) -> Mapping[str, int]:
    """Return the number of samples labelled STABLE, and of these decided STABLE."""
    labelled = hand.labels == STABLE
    return {
        "labelled": int(labelled.sum()),
        "decided": int((labelled & (hand.states == STABLE)).sum()),
    }
