"""Thresholds of heads: the curve of a head over recordings, and the choice on it.

A curve has, at each threshold, the false alarms per minute and the events that are found in time.
`tune` makes one of labelled recordings, `train` and `teach` of decisions out of fold, `calibrate`
of handling without labels, in which there are only alarms.

All but `tune` choose the most sensitive threshold from which on all quieter ones are quiet enough:
a lucky one beyond a bad one is not taken. `tune`, whose recordings have events of the user's own,
takes the one with the fewest missed events among all that are quiet enough.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import takewhile
from typing import Any, Literal, NamedTuple, Self

import msgspec
import numpy as np

from holdfast.contact import STABLE, UNSTABLE
from holdfast.detection import Choice, Debounce, FingerModel, HeadName, Model, ThresholdPoint
from holdfast.errors import ModelError, TrainingError
from holdfast.kernel import _extension
from holdfast.metrics import (
    Decisions,
    EventMetrics,
    FingerDecisions,
    hand_decisions,
    match_decisions,
    pool_events,
)
from holdfast.metrics.decisions import Codes
from holdfast.metrics.masks import runs
from holdfast.metrics.slip_curves import (
    MAX_RAISED_QUIET,
    SLIP_THRESHOLDS,
    THRESHOLDS,
    SlipSummary,
    choose_threshold,
    slip_curve,
    slip_summary,
    summarise_choice,
)
from holdfast.metrics.slip_truth import NOT_HELD, STILL, SlipDecisions, SlipTruth
from holdfast.metrics.slips import SlipCounter, SlipCounts, SlipMetrics, count_slips, slip_metrics
from holdfast.metrics.statistics import poisson_limit
from holdfast.recordings import Recording
from holdfast.sensors.types import Flags
from holdfast.training.evaluation import compute_decisions
from holdfast.training.own_handling import grasped_durations, location_and_scale

COARSE_STEP = 4
"""Every fourth threshold is looked at first."""
USABLE_SHARE = 0.5
"""A threshold is usable if the hand is STABLE in at least this share of the stable samples in
which it is STABLE at the lowest threshold: a hand that is never STABLE gives no false alarm."""
N_SHOWN = 3
"""Thresholds that are shown on either side of the chosen one."""
SLIP_FALSE_ALARMS = 1.0
"""False alarms per minute of all held time of a finger for which `train` sets the threshold."""
STABLE_SHARE = 0.95
"""Share of the held samples of own handling that is STABLE."""
MAX_DISTANCE = 3.0
"""A threshold is at most this many scales of the log odds from their location: what is further
away is taken for slip, and the share is not reached then."""
MIN_FOUND = 0.1
"""Share of the training's slips that a threshold finds, below which own handling sets none."""
MORE_MINUTES = 3.0
"""Further held time for which the upper end of a rate is shown [min]."""
N_HIGHEST, APART = 5, 0.5
"""Number of the highest probabilities that are shown, and their least distance in time [s]."""
HIGHEST_THRESHOLD = 0.9
"""Highest threshold of stability that own handling sets."""

TunedHead = Literal["stable", "slip"]
Steps = Callable[[Iterable[Recording]], Iterable[Recording]]


@dataclass(frozen=True)
class ThresholdReplay:
    """Decisions about one recording, for any threshold of stability.

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
    def of(cls, model: Model, recording: Recording) -> Self:
        """Compute the probabilities of a recording.

        Raises:
            ModelError: the recording has other fingers or sensors.
        """
        plain = msgspec.structs.replace(model.with_threshold("stable", 0.0), debounce=Debounce())
        raw = compute_decisions(plain, recording)
        period = 1 / (model.rate or recording.rate)
        return cls(raw, model.debounce, period, model.n_fingers(raw.fingers))

    def hand(self, threshold: float) -> FingerDecisions:
        """Return the decisions about the hand at a threshold."""
        fingers = {
            name: replace(finger, states=self.states(finger, threshold))
            for name, finger in self.raw.fingers.items()
        }
        return hand_decisions(fingers, self.n_model_fingers)

    def states(self, finger: FingerDecisions, threshold: float) -> Codes:
        """Return the states of a finger at a threshold."""
        # In C: every threshold is tried on every recording.
        out = np.zeros(len(finger.times), dtype=np.int8)
        rule = self.debounce
        limits = np.array([
            threshold, rule.hysteresis, rule.hold, rule.min_duration, self.period,
            rule.switching_rate,
        ])  # fmt: skip
        times, probability = np.array(finger.times), np.array(finger.stable_probability)
        _extension.replay(times, probability, np.array(finger.states, dtype=np.int8), limits, out)
        return out


class CurvePoint(msgspec.Struct, frozen=True):
    """Errors of a head at one threshold.

    Attributes:
        threshold: of the probability.
        false_alarms: per minute of the time that counts.
        missed: share of the events without an alarm in time [%], by that time [s].
        in_time: the time of `missed` that the record of a choice has.
        n: number of events: onsets of instability of the hand, or slips of the fingers.
        minutes: duration of the time that counts [min]: labelled stable, or held by a finger.
        is_usable: whether it may be chosen, whatever its false alarms: the hand is STABLE often
            enough, but not for ever; a slip is reported in at most 2 % of quiet hold.
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
    is_usable: bool
    events: EventMetrics | None = None
    stable: float | None = None
    slips: SlipMetrics | None = None

    @classmethod
    def of_hands(
        cls, threshold: float, hands: Sequence[FingerDecisions], most: float = 0.0
    ) -> Self:
        """Return the point of the events of the hand, missed without an alarm in 0.2 s.

        Args:
            threshold: of the probability.
            hands: decisions about each recording.
            most: share of the samples labelled STABLE that are so at the lowest threshold [%].

        Raises:
            TrainingError: nothing is labelled, or not as stable.
        """
        labelled = [hand for hand in hands if hand.labels.any()]
        if not labelled:
            raise TrainingError(
                f"none of the recordings ({len(hands)}) has labels; labels expected"
            )
        events = pool_events([match_decisions(hand) for hand in labelled])
        states = np.concatenate([hand.states[hand.labels == STABLE] for hand in labelled])
        if not events.stable_minutes or not len(states):
            raise TrainingError(
                "no time in which the hand is labelled stable; false alarms are counted per "
                "minute of it"
            )
        stable = 100 * int((states == STABLE).sum()) / len(states)
        # Below the hysteresis a stable contact stays stable, so that every event is missed.
        is_usable = stable >= USABLE_SHARE * most and (events.missed["0.2"] or 0.0) < 100
        return cls(
            threshold, events.false_alarms_per_minute or 0.0, events.missed, "0.2",
            events.n_events, events.stable_minutes, is_usable, events=events, stable=stable,
        )  # fmt: skip

    @classmethod
    def of_slips(cls, threshold: float, counts: SlipCounts) -> Self:
        """Return the point of the slips of fingers, missed without an alarm in 0.1 s."""
        slips = slip_metrics(counts)
        missed = {t: None if share is None else 100 - share for t, share in slips.incipient.items()}
        return cls(
            threshold, slips.false_alarms_per_minute["held"] or 0.0, missed, "0.1",
            slips.n, slips.held_minutes, (slips.raised_quiet or 0.0) <= MAX_RAISED_QUIET,
            slips=slips,
        )  # fmt: skip

    @property
    def scores(self) -> SlipMetrics | dict[str, Any]:
        """The scores of the point, for JSON."""
        stable = {"threshold": self.threshold, "stable": self.stable, "events": self.events}
        return stable if self.slips is None else self.slips

    def cost(self, false_alarms: float) -> tuple[float, ...]:
        """Return the cost of the point, in order of importance.

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
    """

    thresholds: Sequence[float]
    at: Callable[[float], CurvePoint]

    @classmethod
    def of_stability(cls, model: Model, recordings: Iterable[Recording]) -> Self:
        """Return the curve of the onsets of instability of the hand.

        The decision rule is replayed at each threshold, with contact, hysteresis, hold and minimum
        duration.

        Raises:
            TrainingError: nothing is labelled, or not as stable.
            ModelError: the hand is never STABLE.
        """
        replays = [ThresholdReplay.of(model, recording) for recording in recordings]

        def at(threshold: float, most: float = 0.0) -> CurvePoint:
            hands = [replay.hand(threshold) for replay in replays]
            return CurvePoint.of_hands(threshold, hands, most)

        most = at(float(THRESHOLDS[0])).stable or 0.0
        if most == 0:
            raise ModelError(
                "the model cannot be tuned: the hand is never STABLE at any threshold while it is "
                "labelled stable (see holdfast detect --summary)"
            )

        return cls(THRESHOLDS.tolist(), partial(at, most=most))

    @classmethod
    def of_slips(cls, model: Model, recordings: Iterable[Recording]) -> dict[HeadName, Self]:
        """Return the curve of the slips of all fingers, for each head that decides about some.

        Raises:
            ModelError: the model has no slip rule.
            TrainingError: no slips are known.
        """
        if not model.has_slip_rule:
            raise ModelError(
                f"{model.name or 'the model'} has no slip rule; train one on recordings whose "
                "slips are known"
            )
        counters: dict[HeadName, list[tuple[SlipDecisions, SlipCounter]]] = {}
        n = 0
        for recording in recordings:
            n += 1
            for finger, slip in compute_decisions(model, recording).known_slips.items():
                head = slip_head_of(model, recording, finger)
                counters.setdefault(head, []).append((slip, SlipCounter.of(slip)))
        if not counters:
            raise TrainingError(f"{n} recordings without slips that are known")

        def at(head: HeadName, threshold: float) -> CurvePoint:
            only = np.array([threshold])
            counts = [counter.count(slip.raised_at(only))[0] for slip, counter in counters[head]]
            return CurvePoint.of_slips(threshold, SlipCounts.total(counts))

        thresholds = SLIP_THRESHOLDS[::-1].tolist()
        return {name: cls(thresholds, partial(at, name)) for name in sorted(counters)}

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
            misses = f"misses {missed or 0:.0f} % of {best.n} within {best.in_time} s"
            raise TrainingError(
                f"no threshold gives at most {false_alarms:g} false alarms a minute on these "
                f"recordings; the least is {best.false_alarms:.2g} at the threshold "
                f"{best.threshold:.3g}, which {misses if best.n else 'has no event to miss'}"
            )
        # All neighbours up to the next threshold that was looked at on either side.
        index = self.thresholds.index(best.threshold)
        around = self.thresholds[max(index - COARSE_STEP + 1, 0) : index + COARSE_STEP]
        points += self._usable([t for t in around if t != best.threshold])
        return best_of(points), sorted(points, key=lambda point: point.threshold)

    def _usable(self, thresholds: Sequence[float]) -> list[CurvePoint]:
        points = [self.at(threshold) for threshold in thresholds]
        return [point for point in points if point.is_usable] or points


@dataclass(frozen=True)
class Tuned:
    """Result of tuning.

    Attributes:
        model: with the chosen threshold.
        chosen: its errors.
        before: errors of the model that was given.
        points: thresholds around it, lowest first; the chosen one is among them.
        head: whose threshold it is.
        changes: the same of `slip_changes`, with the model that has both; None if no recording
            begins in contact.
    """

    model: Model
    chosen: CurvePoint
    before: CurvePoint
    points: tuple[CurvePoint, ...]
    head: HeadName
    changes: "Tuned | None" = None

    def document(self) -> dict[str, Any]:
        """Return the chosen threshold, with the errors before it and around it, for JSON."""
        around = [
            {"threshold": point.threshold, **msgspec.to_builtins(point.scores)}
            for point in self.points
        ]
        changes = {} if self.changes is None else {"slip_changes": self.changes.document()}
        return (
            ({} if self.chosen.slips is None else {"for": self.head})
            | {
                "threshold": self.chosen.threshold,
                "chosen": self.chosen.scores,
                "before": self.before.scores,
                "around": around,
            }
            | changes
        )

    @property
    def other_head(self) -> str:
        """Line about the slip head whose threshold was not chosen; empty without such a head."""
        if self.chosen.slips is None or self.changes is not None:
            return ""
        if self.head == "slip_changes":
            return "slip keeps its threshold: all recordings begin in contact"
        if any(part.head("slip_changes") for part in self.model.fingers.values()):
            return "slip_changes keeps its threshold: no recording begins in contact"
        return "no slip_changes: slip decides on what begins in contact, too"


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
        head: whose threshold is chosen; of `slip`, that of `slip_changes` too, each by the
            recordings on which it decides.
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
    highest: dict[HeadName, float] = {}

    def read() -> Iterator[Recording]:
        for recording in progress(recordings):
            digests[recording.name] = recording.readings_digest
            sensors = model.fingers_of({name: m.sensor for name, m in recording.modules.items()})
            for finger in sensors.items():
                for rule in model.finger(*finger).heads:
                    highest[rule.name] = max(highest.get(rule.name, 0.0), rule.threshold)
            yield recording

    curves: dict[HeadName, Curve] = (
        Curve.of_slips(model, read()) if is_slip else {"stable": Curve.of_stability(model, read())}
    )
    title = f"{model.name}, tuned" if model.name else ""
    model = msgspec.structs.replace(model, name=title)
    parts: list[Tuned] = []
    for name, curve in curves.items():
        before = curve.at(highest[name])
        if is_slip and (refusal := too_short(before.minutes, false_alarms)):
            raise TrainingError(f"{name}: {refusal}")
        chosen, points = curve.choose(false_alarms)
        index = points.index(chosen)
        shown = points[max(index - N_SHOWN, 0) : index + N_SHOWN + 1]
        # The live page shows the errors at any threshold of stability.
        choice = chosen.choice(false_alarms, digests, shown if is_slip else points)
        model = model.with_threshold(name, chosen.threshold, choice)
        parts.append(Tuned(model, chosen, before, tuple(shown), name))
    first, *others = parts
    return replace(first, model=model, changes=others[0] if others else None)


def slip_head_of(model: Model, recording: Recording, finger: str) -> HeadName:
    """Return the name of the head that decides about the slips of a finger of a recording."""
    sensor = recording.modules[finger].sensor
    plan = model.plan({finger: sensor}, recording.rate).for_recording(recording)
    head = model.finger(finger, sensor).deciding("slip", zero_unknown=plan.zero_unknown)
    return "slip" if head is None else head.name


def too_short(minutes: float, false_alarms: float) -> str:
    """Return why a held time is too short to choose a threshold of slips by; empty if it is not."""
    if minutes * false_alarms >= 1:
        return ""
    return (
        f"{minutes:.2g} min of held time given; {false_alarms:g} false alarms a minute need at "
        f"least {1 / false_alarms:.2g} min"
    )


class SlipThreshold(NamedTuple):
    """Threshold of the slip rules of a model, chosen out of fold.

    Attributes:
        point: errors of all recordings at this threshold; None if none has few enough false alarms.
        metrics: each recording by the threshold of the others; None if no slips are known.
        reason: why there is no threshold; empty if there is one.
    """

    point: CurvePoint | None
    metrics: SlipSummary | None
    reason: str = ""


def choose_slip_threshold(
    curves: Sequence[Mapping[str, SlipCounts]], groups: Sequence[int], seed: int
) -> SlipThreshold:
    """Choose the threshold of slips from decisions out of fold.

    Args:
        curves: of each finger, of each recording.
        groups: unit of each recording; the threshold of its metrics is chosen without it.
        seed: of the bootstrap.
    """
    used = [(fingers, unit) for fingers, unit in zip(curves, groups, strict=True) if fingers]
    if not used:
        return SlipThreshold(None, None, "no decision about a slip out of fold")
    curves_by_finger, units = [fingers for fingers, _ in used], [unit for _, unit in used]
    pooled = SlipCounts.total([SlipCounts.total(fingers.values()) for fingers in curves_by_finger])
    index = choose_threshold(pooled, SLIP_FALSE_ALARMS)
    if len(set(units)) > 1:
        metrics = summarise_choice(curves_by_finger, SLIP_FALSE_ALARMS, groups=units, seed=seed)
    else:
        shown = len(SLIP_THRESHOLDS) - 1 if index is None else index
        metrics = slip_summary(
            [{name: of[shown] for name, of in f.items()} for f in curves_by_finger]
        )
    minutes = pooled.held_seconds / 60
    if (reason := too_short(minutes, SLIP_FALSE_ALARMS)) or index is None:
        return SlipThreshold(None, metrics, reason or (
            f"no threshold of slips has at most {SLIP_FALSE_ALARMS:g} false alarms a minute in "
            f"{minutes:.2g} min of held time"
        ))  # fmt: skip
    return SlipThreshold(CurvePoint.of_slips(float(SLIP_THRESHOLDS[index]), pooled[index]), metrics)


def with_slip_threshold(model: Model, point: CurvePoint | None) -> Model:
    """Return the model whose slip rules have a threshold; without slip rules if there is none."""
    if point is None:
        return model.changed(
            lambda part: part.without_thresholds("slip").without_heads(
                "slip", "slip_changes", "slip_speed"
            )
        )
    return model.with_threshold("slip", point.threshold, point.choice(SLIP_FALSE_ALARMS))


@dataclass(frozen=True, eq=False)
class GraspingFinger:
    """One finger of one recording of own handling, decided with any threshold.

    Attributes:
        name: of the finger.
        replay: of the recording.
        grasped: (n,) True where the finger holds something.
        zero_unknown: whether the recording begins in contact, and its zero is not known.
    """

    name: str
    replay: ThresholdReplay
    grasped: Flags
    zero_unknown: bool = False

    @property
    def decisions(self) -> FingerDecisions:
        """Decisions about the finger without debouncing."""
        return self.replay.raw.fingers[self.name]

    @property
    def seconds(self) -> float:
        """Held time [s]."""
        return float(grasped_durations(self.decisions.times)[self.grasped].sum())

    def stable(self, threshold: float) -> Flags:
        """Return (n,) the held samples that are STABLE at a threshold."""
        states = self.replay.states(self.decisions, threshold)
        return np.asarray((states == STABLE) & self.grasped)

    @property
    def n_raised(self) -> int:
        """Number of held samples in which a slip is reported, at the threshold of the model."""
        slip = self.decisions.slip
        return 0 if slip is None else int((slip.raised & self.grasped).sum())

    def n_alarms(self, threshold: float) -> int:
        """Return the number of alarms of a threshold: UNSTABLE between STABLE and STABLE.

        An alarm that ends with the release of the object is right in ordinary handling.
        """
        states = self.replay.states(self.decisions, threshold)
        spells = runs(states == UNSTABLE)
        inside = [(a, b) for a, b in spells if self.grasped[a] and a > 0 and b < len(states)]
        return sum(bool(states[a - 1] == states[b] == STABLE) for a, b in inside)

    @property
    def slips(self) -> SlipDecisions | None:
        """Decisions about slips, by a truth in which all that is held is still; None without."""
        slip = self.decisions.slip
        if slip is None:
            return None
        codes = np.where(self.grasped, STILL, NOT_HELD).astype(np.int8)
        return replace(slip, truth=SlipTruth(codes, self.grasped, (), "labels"))


@dataclass(frozen=True, eq=False)
class GraspingFingers:
    """All fingers of one sensor in own handling."""

    fingers: Sequence[GraspingFinger]

    @property
    def seconds(self) -> float:
        """Held time of the finger that holds longest [s]."""
        totals: dict[str, float] = {}
        for finger in self.fingers:
            totals[finger.name] = totals.get(finger.name, 0.0) + finger.seconds
        return max(totals.values(), default=0.0)

    @property
    def n_held(self) -> int:
        """Number of held samples, at least 1."""
        return max(sum(int(finger.grasped.sum()) for finger in self.fingers), 1)

    def share(self, threshold: float) -> float:
        """Return the share of the held samples that are STABLE at a threshold."""
        return sum(int(f.stable(threshold).sum()) for f in self.fingers) / self.n_held

    @property
    def raised(self) -> float:
        """Share of the held samples in which a slip is reported, at the threshold of the model."""
        return sum(finger.n_raised for finger in self.fingers) / self.n_held

    @property
    def false_slips_per_minute(self) -> float | None:
        """False alarms of slips per minute of held time of a finger; None without a rule.

        They are those of the threshold of the model.
        """
        decided = [slips for finger in self.fingers if (slips := finger.slips) is not None]
        counts = SlipCounts.total(map(count_slips, decided))
        return 60 * int(counts.false_held) / counts.held_seconds if decided else None

    def alarms_per_minute(self, threshold: float) -> float:
        """Return the number of alarms of all fingers per minute of held time."""
        return 60 * sum(finger.n_alarms(threshold) for finger in self.fingers) / self.seconds

    def furthest(self) -> float:
        """Return the probability that is `MAX_DISTANCE` scales of its log odds below theirs."""
        probability = np.concatenate(
            [f.decisions.stable_probability[f.grasped] for f in self.fingers]
        )
        bounded = np.clip(probability, 1e-12, 1 - 1e-12)  # they may be 0 or 1
        location, scale = location_and_scale(np.log(bounded / (1 - bounded))[:, None])
        return float(1 / (1 + math.exp(-(location[0] - MAX_DISTANCE * scale[0]))))

    def choose(self, highest: float) -> float:
        """Return the highest threshold of stability that is quiet, as all lower ones are.

        It is the quietest near one where none is quiet.

        Args:
            highest: the most sensitive threshold.
        """
        thresholds = [*THRESHOLDS[highest > THRESHOLDS].tolist(), highest]
        furthest = self.furthest()
        near: list[float] = [t for t in thresholds if t >= furthest] or [highest]
        quiet = takewhile(lambda t: self.share(t) >= STABLE_SHARE, near)
        return [near[0], *quiet][-1]


def choose_stability_threshold(
    handling: GraspingFingers, part: FingerModel, *, moves: bool = False
) -> float:
    """Choose the threshold of stability of a model on own handling.

    It is the most sensitive at which `STABLE_SHARE` of the held samples are STABLE, but not further
    than `MAX_DISTANCE`. It is at most that of the model: handling that is still says nothing about
    motion, so it is no reason to alarm more. Handling in which the arm moves may raise it to
    `HIGHEST_THRESHOLD`.

    Args:
        handling: decided with its own location and scale.
        part: model of the fingers, with the thresholds of the model.
        moves: whether the arm moves in the handling.
    """
    return handling.choose(max(part.stable.threshold, HIGHEST_THRESHOLD if moves else 0.0))


class SlipAlarm(msgspec.Struct, frozen=True):
    """A time of own handling at which the probability of a slip is among the highest.

    Attributes:
        recording: its name.
        finger: its name.
        time: [s].
        probability: of a slip.
    """

    recording: str
    finger: str
    time: float
    probability: float


class HandlingSlips(msgspec.Struct, frozen=True):
    """Threshold of slips that own handling sets, in which nothing slips.

    Attributes:
        head: `slip`, or `slip_changes` of recordings that begin in contact.
        threshold: of the probability; 1 if the head stays silent.
        n: number of false alarms at the threshold.
        minutes: held time of all fingers that counts [min].
        at_most: upper end of the rate of false alarms per minute, with 95 %.
        more_minutes: held time of all fingers [min] after which that would be lower.
        then_at_most: it would be this at the same rate.
        found: share of the slips of the training that the threshold finds before 1 mm [%]; None if
            it is not known.
        highest: the highest probabilities, of which no two are within 0.5 s of a finger.
    """

    head: HeadName
    threshold: float
    n: int
    minutes: float
    at_most: float
    more_minutes: float
    then_at_most: float
    found: float | None
    highest: tuple[SlipAlarm, ...]

    @property
    def is_silent(self) -> bool:
        """Whether no threshold is both quiet and of use."""
        return self.threshold >= 1

    def text(self) -> str:
        """Return the threshold with the interval of its rate, or why there is none."""
        if self.is_silent:
            times = ", ".join(f"{x.finger} {x.time:.2f} s" for x in self.highest)
            return (
                f"{self.head}: no threshold with few enough false alarms finds a tenth of the "
                f"training's slips, so none is reported; look whether something slips at {times}"
            )
        share = "" if self.found is None else f", finds {self.found:.0f} % of the training's slips"
        return (
            f"{self.head}: reported from {self.threshold:.3g} on{share}; {self.n} false alarms in "
            f"{self.minutes:.1f} minutes of a finger: at most {self.at_most:.1f} a minute with "
            f"95 %, {self.more_minutes:g} minutes more bring it to {self.then_at_most:.1f}"
        )


def choose_handling_slips(
    handling: GraspingFingers, part: FingerModel, false_alarms: float, shown: float = 1.0
) -> list[HandlingSlips]:
    """Choose the thresholds of slips on own handling in which nothing slips.

    Each is the lowest with at most so many false alarms, if all higher ones have as few. Where it
    would find under `MIN_FOUND` of the slips of the training, the head stays silent.

    Args:
        handling: decided by the model.
        part: model of the fingers.
        false_alarms: maximum number per minute of held time of a finger.
        shown: share of the held time that counts, as the readings show it.
    """
    chosen: list[HandlingSlips] = []
    for name in ("slip", "slip_changes"):
        head = part.head(name)
        fingers = [
            finger
            for finger in handling.fingers
            if part.deciding("slip", zero_unknown=finger.zero_unknown) is head
        ]
        decided = [(finger, slips) for finger in fingers if (slips := finger.slips) is not None]
        if head is None or not decided:
            continue
        curve = SlipCounts.total([slip_curve(slips) for _, slips in decided])
        index = choose_threshold(curve, shown * false_alarms)
        threshold = 1.0 if index is None else float(SLIP_THRESHOLDS[index])
        share = head.share_found(threshold)
        if share is not None and share < MIN_FOUND:
            index = None
        n = int(curve.false_held[-1 if index is None else index])
        minutes = shown * curve.held_seconds / 60
        then = minutes + shown * MORE_MINUTES
        chosen.append(
            HandlingSlips(
                head=head.name,
                threshold=1.0 if index is None else threshold,
                n=n,
                minutes=minutes,
                at_most=poisson_limit(n) / minutes,
                more_minutes=MORE_MINUTES,
                then_at_most=poisson_limit(round(n * then / minutes)) / then,
                found=None if share is None else 100 * share,
                highest=tuple(_highest(decided)),
            )
        )
    return chosen


def _highest(decided: Sequence[tuple[GraspingFinger, SlipDecisions]]) -> Iterator[SlipAlarm]:
    """Yield the highest probabilities in held time, from the highest on."""
    probabilities = [np.where(f.grasped, slips.probability, -1.0) for f, slips in decided]
    for _ in range(N_HIGHEST):
        k = int(np.argmax([np.nanmax(p, initial=-1.0) for p in probabilities]))
        (finger, slips), probability = decided[k], probabilities[k]
        best = int(np.nanargmax(probability))
        if probability[best] < 0:
            return
        time = float(slips.times[best])
        yield SlipAlarm(finger.replay.raw.name, finger.name, time, float(probability[best]))
        probability[np.abs(slips.times - time) < APART] = -1.0
