"""Curves of heads, and the choice of a threshold from them (`holdfast tune`).

A curve has the errors of a head at thresholds: false alarms per minute of the time that counts,
and events without an alarm in time.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Self

import msgspec
import numpy as np

from holdfast.contact import STABLE
from holdfast.detection import Choice, Model, ThresholdPoint
from holdfast.errors import ModelError, TrainingError
from holdfast.metrics import (
    EventMetrics,
    match_decisions,
    pool_events,
)
from holdfast.metrics.slip_thresholds import MAX_RAISED_QUIET, SLIP_THRESHOLDS, THRESHOLDS
from holdfast.metrics.slips import SlipCounter, SlipCounts, SlipMetrics, slip_metrics
from holdfast.recordings import Recording
from holdfast.training.evaluation import compute_decisions
from holdfast.training.replay import ThresholdReplay

COARSE_STEP = 4
"""Every fourth threshold is looked at first."""
USABLE_SHARE = 0.5
"""A threshold is usable if the hand is STABLE in at least this share of the stable samples in
which it is STABLE at the lowest threshold: a hand that is never STABLE gives no false alarm."""
N_SHOWN = 3
"""Thresholds that are shown on either side of the chosen one."""

TunedHead = Literal["stable", "slip"]
Steps = Callable[[Iterable[Recording]], Iterable[Recording]]


class CurvePoint(msgspec.Struct, frozen=True):
    """Errors of a head at one threshold.

    Attributes:
        threshold: of the probability.
        false_alarms: per minute of the time that counts.
        missed: share of the events without an alarm in time [%], by that time [s].
        in_time: the time of `missed` that the record of a choice has.
        n: number of events: onsets of instability of the hand, or slips of the fingers.
        minutes: duration of the time that counts [min]: labelled stable, or held by a finger.
        events: all metrics of the hand; None for slips.
        stable: share of the samples labelled STABLE that are decided STABLE [%]; None for slips.
        slips: all metrics of slips; None for stability.
    """

    threshold: float
    false_alarms: float
    missed: dict[str, float | None]
    in_time: str
    n: int
    minutes: float
    events: EventMetrics | None = None
    stable: float | None = None
    slips: SlipMetrics | None = None

    @classmethod
    def of_events(cls, threshold: float, events: EventMetrics, stable: float) -> Self:
        """Return the point of the events of the hand, missed without an alarm in 0.2 s."""
        return cls(
            threshold, events.false_alarms_per_minute or 0.0, events.missed, "0.2",
            events.n_events, events.stable_minutes, events=events, stable=stable,
        )  # fmt: skip

    @classmethod
    def of_slips(cls, threshold: float, slips: SlipMetrics) -> Self:
        """Return the point of the slips of fingers, missed without an alarm in 0.1 s."""
        missed = {t: None if found is None else 100 - found for t, found in slips.incipient.items()}
        return cls(
            threshold, slips.false_alarms_per_minute["held"] or 0.0, missed, "0.1",
            slips.n, slips.held_minutes, slips=slips,
        )  # fmt: skip

    def cost(self, false_alarms: float) -> tuple[float, ...]:
        """Return what the best point has least of.

        Few enough false alarms come first, then few missed events (the sum over all times within
        which they are counted), then few false alarms.
        """
        excess = max(self.false_alarms - false_alarms, 0.0)
        missed = sum(share or 0.0 for share in self.missed.values())
        return excess, missed, self.false_alarms if self.n else 0.0

    def choice(
        self,
        requested: float,
        recordings: Mapping[str, str] = {},
        points: "Sequence[CurvePoint]" = (),
    ) -> Choice:
        """Return the record of a choice of this threshold, for the model file."""
        missed = self.missed[self.in_time]
        return Choice(
            requested=requested,
            false_alarms_per_minute=self.false_alarms,
            found=None if missed is None else 100 - missed,
            n=self.n,
            minutes=self.minutes,
            recordings=dict(recordings),
            points=tuple(
                ThresholdPoint(p.threshold, round(p.false_alarms, 3), p.missed[p.in_time])
                for p in points
            ),
        )


@dataclass(frozen=True)
class Curve:
    """Errors of a head on recordings, at thresholds of its probability.

    Attributes:
        thresholds: from the quietest to the most sensitive.
        at: returns the point of a threshold.
        is_usable: whether a point may be chosen, whatever its false alarms.
    """

    thresholds: Sequence[float]
    at: Callable[[float], CurvePoint]
    is_usable: Callable[[CurvePoint], bool]

    def choose(self, false_alarms: float) -> tuple[CurvePoint, list[CurvePoint]]:
        """Return the best point with few enough false alarms, and all usable points in order.

        Raises:
            TrainingError: no point has few enough false alarms.
        """

        def best_of(points: list[CurvePoint]) -> CurvePoint:
            # Without events the most sensitive is the best.
            order = 1 if points[0].n else -1
            ordered = sorted(points, key=lambda p: order * self.thresholds.index(p.threshold))
            return min(ordered, key=lambda point: point.cost(false_alarms))

        points = self._usable(self.thresholds[::COARSE_STEP])
        best = best_of(points)
        if best.false_alarms > false_alarms:
            missed = best.missed[best.in_time]
            misses = "has no event to miss"
            if missed is not None:
                misses = f"misses {missed:.0f} % of {best.n} within {best.in_time} s"
            raise TrainingError(
                f"no threshold gives at most {false_alarms:g} false alarms a minute on these "
                f"recordings; the least is {best.false_alarms:.2g} at the threshold "
                f"{best.threshold:.3g}, which {misses}"
            )
        # All neighbours up to the next threshold that was looked at on either side.
        index = self.thresholds.index(best.threshold)
        around = self.thresholds[max(index - COARSE_STEP + 1, 0) : index + COARSE_STEP]
        points += self._usable([t for t in around if t != best.threshold])
        return best_of(points), sorted(points, key=lambda point: point.threshold)

    def _usable(self, thresholds: Sequence[float]) -> list[CurvePoint]:
        points = [self.at(threshold) for threshold in thresholds]
        return [point for point in points if self.is_usable(point)] or points


@dataclass(frozen=True)
class Tuned:
    """Result of tuning.

    Attributes:
        model: with the chosen threshold.
        chosen: its errors.
        before: errors of the model that was given.
        points: thresholds around it, lowest first; the chosen one is among them.
    """

    model: Model
    chosen: CurvePoint
    before: CurvePoint
    points: tuple[CurvePoint, ...]

    def document(self) -> dict[str, Any]:
        """Return the chosen threshold, with the errors before it and around it, for JSON."""
        if self.chosen.slips is not None:
            return {
                "for": "slip",
                "threshold": self.chosen.threshold,
                "chosen": self.chosen.slips,
                "before": self.before.slips,
                "around": [
                    {"threshold": point.threshold, **msgspec.to_builtins(point.slips)}
                    for point in self.points
                ],
            }
        points = (
            {"threshold": point.threshold, "stable": point.stable, "events": point.events}
            for point in (self.chosen, self.before, *self.points)
        )
        chosen, before, *around = points
        threshold = self.chosen.threshold
        return {"threshold": threshold, "chosen": chosen, "before": before, "around": around}


def tune(
    model: Model,
    recordings: Iterable[Recording],
    false_alarms: float,
    head: TunedHead = "stable",
    *,
    progress: Steps = lambda recordings: recordings,
) -> Tuned:
    """Choose the threshold of a head for a rate of false alarms.

    The probabilities are computed once, and the decisions replayed for every threshold: of
    stability, with contact, hysteresis, hold and minimum duration.

    Args:
        model: to tune.
        recordings: labelled; of slips, with a truth or labels of slips.
        false_alarms: maximum number per minute of stable label of the hand; of slips, per minute
            of held time of one finger.
        head: whose threshold is chosen.
        progress: iterates over the recordings.

    Raises:
        ValueError: the rate is negative or not finite; of slips, not above 0.
        TrainingError: the recordings have no labels, no time that counts, too little of it for
            the rate, or no threshold gives so few false alarms.
        ModelError: the model has no such head, or is never STABLE; or a recording has other
            fingers or sensors.
    """
    is_slip = head == "slip"
    if not math.isfinite(false_alarms) or false_alarms < 0 or (is_slip and false_alarms == 0):
        least = "above 0" if is_slip else "of at least 0"
        raise ValueError(f"false alarms per minute {least} expected, {false_alarms:g} given")
    digests: dict[str, str] = {}
    highest = 0.0

    def read() -> Iterator[Recording]:
        nonlocal highest
        for recording in progress(recordings):
            digests[recording.name] = recording.readings_digest
            sensors = model.fingers_of({name: m.sensor for name, m in recording.modules.items()})
            heads = [model.finger(*finger).head(head) for finger in sensors.items()]
            highest = max([highest, *(known.threshold for known in heads if known is not None)])
            yield recording

    curve = (_of_slips if is_slip else _of_stability)(model, read())
    before = curve.at(highest)
    if is_slip and before.minutes * false_alarms < 1:
        raise TrainingError(
            f"{before.minutes:.2g} min of held time given; {false_alarms:g} false alarms a minute "
            f"need at least {1 / false_alarms:.2g} min"
        )
    chosen, points = curve.choose(false_alarms)
    index = points.index(chosen)
    shown = points[max(index - N_SHOWN, 0) : index + N_SHOWN + 1]
    # The live page shows the errors at any threshold of stability.
    choice = chosen.choice(false_alarms, digests, shown if is_slip else points)
    tuned = model.with_threshold(head, chosen.threshold, choice)
    return Tuned(
        msgspec.structs.replace(tuned, name=f"{model.name}, tuned" if model.name else ""),
        chosen,
        before,
        tuple(shown),
    )


def _of_stability(model: Model, recordings: Iterable[Recording]) -> Curve:
    """Return the curve of the onsets of instability of the hand.

    The decision rule is replayed at each threshold, with contact, hysteresis, hold and minimum
    duration. Points are usable at which the hand is STABLE often enough, but not for ever.

    Raises:
        TrainingError: nothing is labelled, or not as stable.
        ModelError: the hand is never STABLE.
    """
    replays = [ThresholdReplay.of(model, recording) for recording in recordings]

    def at(threshold: float) -> CurvePoint:
        hands = [replay.hand(threshold) for replay in replays]
        labelled = [hand for hand in hands if hand.labels.any()]
        if not labelled:
            raise TrainingError(
                f"none of the recordings ({len(hands)}) has labels; labels expected"
            )
        events = pool_events([match_decisions(hand) for hand in labelled])
        stable = np.concatenate([hand.states[hand.labels == STABLE] == STABLE for hand in labelled])
        if not events.stable_minutes or not len(stable):
            raise TrainingError(
                "no time in which the hand is labelled stable; false alarms are counted per "
                "minute of it"
            )
        return CurvePoint.of_events(threshold, events, 100 * int(stable.sum()) / len(stable))

    most = at(float(THRESHOLDS[0])).stable or 0.0
    if most == 0:
        raise ModelError(
            "the model cannot be tuned: the hand is never STABLE at any threshold while it is "
            "labelled stable (see holdfast detect --summary)"
        )

    def is_usable(point: CurvePoint) -> bool:
        # Below the hysteresis a stable contact stays stable, so that every event is missed.
        return (point.stable or 0.0) >= USABLE_SHARE * most and (point.missed["0.2"] or 0.0) < 100

    return Curve(THRESHOLDS.tolist(), at, is_usable)


def _of_slips(model: Model, recordings: Iterable[Recording]) -> Curve:
    """Return the curve of the slips of all fingers.

    Points are usable at which a slip is reported in at most 2 % of quiet hold.

    Raises:
        ModelError: the model has no slip rule.
        TrainingError: no slips are known.
    """
    if not model.has_slip_rule:
        raise ModelError(
            f"{model.name or 'the model'} has no slip rule; train one on recordings whose slips "
            "are known"
        )
    decisions = [compute_decisions(model, recording) for recording in recordings]
    slips = [finger.slip for made in decisions for finger in made.fingers.values()]
    counters = [(slip, SlipCounter.of(slip)) for slip in slips if slip and slip.truth]
    if not counters:
        raise TrainingError(f"{len(decisions)} recordings without slips that are known")

    def at(threshold: float) -> CurvePoint:
        counts = [
            counter.count(slip.raised_at(np.array([threshold])))[0] for slip, counter in counters
        ]
        return CurvePoint.of_slips(threshold, slip_metrics(SlipCounts.total(counts)))

    def is_usable(point: CurvePoint) -> bool:
        raised = None if point.slips is None else point.slips.raised_quiet
        return (raised or 0.0) <= MAX_RAISED_QUIET

    return Curve(SLIP_THRESHOLDS[::-1].tolist(), at, is_usable)
