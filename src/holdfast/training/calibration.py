"""Calibration: location, scale and thresholds of a model from its user's own handling."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import msgspec
import numpy as np

from holdfast.detection import FingerModel, Handling, HeadName, Model
from holdfast.detection.specs import KINDS
from holdfast.errors import ModelError, TrainingError
from holdfast.recordings import Recording
from holdfast.sensors.types import Array
from holdfast.training.own_handling import (
    ENOUGH_HANDLING,
    MAX_HANDLING,
    MIN_HANDLING,
    HandlingKey,
    OwnHandling,
    grasped_samples,
    location_and_scale,
)
from holdfast.training.thresholds import (
    STABLE_SHARE,
    GraspingFinger,
    GraspingFingers,
    HandlingSlips,
    Steps,
    ThresholdReplay,
    choose_handling_slips,
    choose_stability_threshold,
)

MAX_FINGERS_SHOWN = 5
WORSE = 0.5
"""Change of a share of the held samples from which a calibration made it worse [% points]."""
STILL_CHANGE = 0.03
"""Median change of the load below which the arm hardly moved, as a share of it."""
MOVED_LOCATION, MOVED_SCALE = 0.5, 1.5
"""A feature changes if its location moves by this share of its scale, or its scale by this
factor."""
HIDDEN_SHARE = 0.5
"""Share of the handling in which a feature is at its least value, median over the features, above
which most of the handling does not show in the readings."""
MAX_ACTIVITY = 2.0
"""Own handling is refused as slip above this `activity`. None of 450 grasps of randomized hands has
more in the held samples in which it does not slide; over half have more while they slide."""
FALSE_ALARMS = 1.0
"""False alarms of slips per minute of held time of a finger, unless another number is given."""
UNSURE = 2.0
"""More handling is recommended if the upper end of the rate of false alarms of slips is above this
multiple of the rate that was asked for."""
CALIBRATED_SUFFIX = ", calibrated"
"""End of the name of a calibrated model."""

COMPARED_FIGURES = (
    ("false slips a minute of a finger that holds", "false_slips_per_minute", 1),
    ("times a minute UNSTABLE, then STABLE again", "alarms_per_minute", 1),
    ("STABLE of the time of holding [%]", "stable", 1),
    ("threshold of a slip", "slip_threshold", 3),
    ("threshold of STABLE", "threshold", 3),
)
"""Text, field of the figures and number of digits of each row of the comparison."""


class HandlingFigures(msgspec.Struct, frozen=True):
    """Decisions of a model about own handling.

    Attributes:
        threshold: of the probability of stability.
        stable: share of the held samples that are STABLE [%].
        alarms_per_minute: alarms of all fingers per minute of held time.
        slip_threshold: of the probability of a slip; None without a slip rule.
        raised: share of the held samples in which a slip is reported [%]; None without one.
        false_slips_per_minute: false alarms of slips per minute of held time of a finger; None
            without a rule, or where its threshold is 1, so that it reports none.
    """

    threshold: float
    stable: float
    alarms_per_minute: float
    slip_threshold: float | None = None
    raised: float | None = None
    false_slips_per_minute: float | None = None

    @classmethod
    def of(cls, handling: GraspingFingers, part: FingerModel) -> Self:
        """Return the figures at the thresholds of a model, which made the decisions."""
        stable = part.stable.threshold
        slip = None if part.slip is None else part.slip.threshold
        return cls(
            threshold=stable,
            stable=100 * handling.share(stable),
            alarms_per_minute=handling.alarms_per_minute(stable),
            slip_threshold=slip,
            raised=None if slip is None else 100 * handling.raised,
            false_slips_per_minute=(
                None if slip is None or slip >= 1 else handling.false_slips_per_minute
            ),
        )

    def worse_than(self, other: "HandlingFigures") -> bool:
        """Return whether STABLE is rarer, slip is reported more, or alarms are more frequent.

        STABLE may fall to the share for which the threshold is chosen. An alarm begins and ends
        with STABLE, so more of them are no worse where more samples are STABLE, or where STABLE
        falls so: a finger that is never STABLE has no alarm.
        """
        aim = min(other.stable, 100 * STABLE_SHARE)
        raised = (self.raised or 0.0) - (other.raised or 0.0)
        more_alarms = self.alarms_per_minute > other.alarms_per_minute
        alarms = more_alarms and self.stable <= other.stable == aim
        return self.stable < aim - WORSE or raised > WORSE or alarms


class HandlingSummary(msgspec.Struct, frozen=True):
    """What a calibration saw of one sensor.

    Attributes:
        sensor: its name; with the finger, of a model that has a classifier for each.
        fingers: held time of each finger [s].
        seconds: held time of the finger that holds longest [s].
        load_change: median change of the force within half a second, as a share of it; NaN if the
            load is not known: of counts of recordings that begin in contact.
        n_features: number of features.
        n_changed: number of them whose location or scale differs from the default.
        activity: how far the features of change are above their default location, in default
            scales.
        still: whether most scales are below those of default handling, and the load hardly
            changes: the scales are stretched to the default then.
        before: decisions about this handling, by the model that was given.
        after: the same, by the calibrated model.
        slips: threshold of each head of slips.
    """

    sensor: str
    fingers: dict[str, float]
    seconds: float
    load_change: float
    n_features: int
    n_changed: int
    activity: float
    still: bool
    before: HandlingFigures
    after: HandlingFigures
    slips: tuple[HandlingSlips, ...] = ()

    def text(self) -> str:
        """Return what was seen of the sensor: held time, motion, and features that differ."""
        held = [f"{name} {seconds:.0f} s" for name, seconds in self.fingers.items()]
        more = ", ..." if len(held) > MAX_FINGERS_SHOWN else ""
        motion = "how much the force changed is not known, as the hand was never seen open"
        if not math.isnan(self.load_change):
            share = 100 * self.load_change
            motion = (
                f"while it was held, the force changed by {share:.0f} % in half a second (median)"
            )
        return (
            f"{self.sensor}: held {self.seconds:.0f} s ({', '.join(held[:MAX_FINGERS_SHOWN])}"
            f"{more}); {motion}. {self.n_changed} of {self.n_features} features differ "
            "from those of the default."
        )

    def rows(self) -> list[tuple[str, str, str]]:
        """Return the figures before and after as rows of a table; a dash where there is none."""
        return [
            (
                title,
                "-" if (old := getattr(self.before, field)) is None else f"{old:.{digits}f}",
                "-" if (new := getattr(self.after, field)) is None else f"{new:.{digits}f}",
            )
            for title, field, digits in COMPARED_FIGURES
        ]

    @property
    def change(self) -> str:
        """The figures before and after, as a text."""
        before, after = self.before, self.after
        text = (
            f"STABLE {before.stable:.1f} to {after.stable:.1f} %, "
            f"{before.alarms_per_minute:.1f} to {after.alarms_per_minute:.1f} alarms a minute"
        )
        if before.raised is None or after.raised is None:
            return text
        return f"{text}, slip {before.raised:.1f} to {after.raised:.1f} %"


@dataclass(frozen=True)
class CalibratedModel:
    """A model with own handling, and what it rests on.

    Attributes:
        model: with the own handling.
        sensors: what was seen of each sensor.
        warnings: for the user.
    """

    model: Model
    sensors: tuple[HandlingSummary, ...]
    warnings: tuple[str, ...]

    def next_step(self, out: str, source: str, false_alarms: float) -> str:
        """Return what to do next, with its command.

        Args:
            out: path of the model.
            source: of the hand.
            false_alarms: as in `calibrate`.
        """
        heads = [slips for summary in self.sensors for slips in summary.slips]
        heads = [slips for slips in heads if not slips.is_silent]
        if not heads:
            return (
                f"{out} reports no slip; holdfast teach {source} -o taught.json learns those of "
                "this hand in ten guided minutes"
            )
        if max(slips.at_most for slips in heads) > UNSURE * false_alarms:
            return (
                f"{max(slips.more_minutes for slips in heads):g} minutes more of handling make "
                f"sure how many slips are false; or try it: holdfast detect {out} {source}"
            )
        return f"holdfast detect {out} {source}"

    def check(self, hint: str = "") -> None:
        """Check that the arm moved, and that decisions about the handling are no worse than before.

        Args:
            hint: end of the message, such as what saves the model all the same.

        Raises:
            TrainingError: it hardly moved, or they are worse on a sensor.
        """
        for summary in self.sensors:
            if summary.still and summary.load_change < STILL_CHANGE:  # not if it is unknown
                raise TrainingError(
                    f"{summary.sensor}: the arm hardly moved; move the arm as it will move later"
                    f"{hint}"
                )
            if summary.after.worse_than(summary.before):
                raise TrainingError(
                    f"{summary.sensor}: worse on this handling than before ({summary.change}); "
                    f"move the arm as it will move later{hint}"
                )


def calibrate(
    model: Model, recordings: Iterable[Recording], *, false_alarms: float = FALSE_ALARMS
) -> Model:
    """Return the model with the own handling of some recordings, which need no labels.

    Record a minute of ordinary use without slip: grasp, carry, turn, put down. The features are
    normalised by what they are there, sensor by sensor, and the thresholds are set by it.

    Args:
        model: whose features are normalised, such as `builtin:any`.
        recordings: of ordinary handling; are read more than once.
        false_alarms: maximum number of false alarms of slips per minute of held time of a finger.
            Where that leaves hardly a slip to be found, the model reports none.

    Raises:
        ModelError: the features of the model are not normalised, or the sensor is another.
        TrainingError: too little is held, a finger has faults, or most of it seems to be slip.
        ValueError: the number of false alarms is not above 0, or not finite.

    Example:
        ```python
        from holdfast import Model, calibrate, load_dataset

        mine = calibrate(Model.load("builtin:any"), load_dataset("handling/"))
        mine.save("mine.json")
        ```
    """
    return calibrate_with_report(model, recordings, false_alarms=false_alarms).model


def calibrate_with_report(
    model: Model,
    recordings: Iterable[Recording],
    *,
    false_alarms: float = FALSE_ALARMS,
    progress: Steps = lambda recordings: recordings,
) -> CalibratedModel:
    """Calibrate a model as `calibrate`, and return what the calibration saw.

    Args:
        model: as in `calibrate`.
        recordings: as in `calibrate`.
        false_alarms: as in `calibrate`.
        progress: iterates over the recordings.

    Raises:
        ModelError: as in `calibrate`.
        TrainingError: as in `calibrate`.
        ValueError: as in `calibrate`.
    """
    if not (math.isfinite(false_alarms) and false_alarms > 0):
        raise ValueError(f"false alarms per minute above 0 expected, {false_alarms:g} given")
    check_normalised(model)
    recordings = recordings if isinstance(recordings, Sequence) else list(recordings)
    handling = OwnHandling(model)
    for recording in progress(recordings):
        handling.add(recording)
    handling.check()
    return _Calibration(handling, recordings).result(false_alarms)


def check_normalised(model: Model) -> None:
    """Check that the features of a model are normalised.

    Raises:
        ModelError: they are not.
    """
    if not all(part.normalised for part in model.fingers.values()):
        raise ModelError(
            f"{model.name or 'the model'} was not trained on normalised features and cannot be "
            "calibrated; builtin:any can"
        )


def activity(part: FingerModel, features: Array) -> float:
    """Return how far the features of change are above their default location.

    Args:
        part: whose features they are.
        features: (n, n_features) of `stable`, of held samples.

    Returns:
        The median over the samples of the mean over the features, in default scales; 0 without
        such features.
    """
    specs = part.stable.features
    columns = [k for k, spec in enumerate(specs) if KINDS[spec.kind].family == "change"]
    if not columns:
        return 0.0
    location, scale = part.default_handling
    return float(np.median(((features - location) / scale)[:, columns].mean(axis=1)))


def _stretch(part: FingerModel, scale: Array) -> float:
    """Return the median of the scales of default handling, in scales of own handling."""
    return float(np.exp(np.median(np.log(part.default_handling[1] / scale))))


def n_changed(part: FingerModel, handling: Handling) -> int:
    """Return the number of features whose location or scale differs from the default."""
    location, scale = part.default_handling
    moved = np.abs(handling.location - location) > MOVED_LOCATION * scale
    stretched = np.abs(np.log(handling.scale / scale)) > math.log(MOVED_SCALE)
    return int((moved | stretched).sum())


class _Calibration:
    """Location, scale and thresholds of a model from own handling.

    Args:
        handling: checked.
        recordings: from which it was taken.
    """

    def __init__(self, handling: OwnHandling, recordings: Sequence[Recording]) -> None:
        self.model, self.seen, self.recordings = handling.model, handling, recordings
        self.keys = [key for key in handling.samples if handling.seconds(key) >= MIN_HANDLING]
        self.shown = {key: self._shown(key) for key in self.keys}

    def result(self, false_alarms: float) -> CalibratedModel:
        """Return the calibrated model, with what the calibration saw.

        Raises:
            TrainingError: most of the handling seems to be slip.
        """
        # The thresholds are chosen on decisions by the new location and scale: these come first.
        handling = {key: self._normalisation(key) for key in self.keys}
        before = self._decide(self.model)
        after = self._decide(_with_handling(self.model, handling))
        slips: dict[HandlingKey, list[HandlingSlips]] = {}
        for key, normalisation in handling.items():
            part = self.model.finger(key.finger).with_handling(normalisation)
            moves = not self.seen.load_change(key) < STILL_CHANGE
            slips[key] = choose_handling_slips(after[key], part, false_alarms, self.shown[key])
            chosen: dict[HeadName, float] = {one.head: one.threshold for one in slips[key]}
            chosen["stable"] = choose_stability_threshold(after[key], part, moves=moves)
            handling[key] = msgspec.structs.replace(normalisation, thresholds=chosen)
        model = _with_handling(self.model, handling)
        after = self._decide(model)
        name = model.name.removesuffix(CALIBRATED_SUFFIX)
        sensors = []
        for key, own in handling.items():
            part = self.model.finger(key.finger)
            summary = HandlingSummary(
                sensor=str(key),
                fingers=self.seen.fingers(key),
                seconds=own.seconds,
                load_change=self.seen.load_change(key),
                n_features=len(own.location),
                n_changed=n_changed(part, own),
                activity=activity(part, self.seen.features(key)),
                still=self._still(key),
                before=HandlingFigures.of(before[key], part.for_sensor(key.sensor)),
                after=HandlingFigures.of(after[key], part.with_handling(own)),
                slips=tuple(slips[key]),
            )
            sensors.append(summary)
        return CalibratedModel(
            msgspec.structs.replace(model, name=f"{name}{CALIBRATED_SUFFIX}" if name else ""),
            tuple(sensors),
            tuple(self._warnings(sensors)),
        )

    def _normalisation(self, key: HandlingKey) -> Handling:
        """Return location and scale of a key.

        Raises:
            TrainingError: most of the handling seems to be slip.
        """
        features = self.seen.features(key)
        part = self.model.finger(key.finger)
        measured = activity(part, features)
        if measured > MAX_ACTIVITY:
            raise TrainingError(
                f"{key}: most of this handling looks like slip (activity {measured:.2f}, at most "
                f"{MAX_ACTIVITY:g} expected); ordinary handling without slip expected"
            )
        location, scale = location_and_scale(features)
        if self._still(key):
            # The default is the spread over all hands of the training: still handling does not show
            # how far motion takes the features of this one. It shows the noise of the skin, so the
            # ratios of the scales stay, and one factor stretches them until their median is that
            # of the default.
            location = np.maximum(location, part.default_handling[0])
            scale = _stretch(part, scale) * scale
        elif self.shown[key] < 1:  # nor does handling below the steps of a sensor
            scale = np.maximum(scale, part.default_handling[1])
        return Handling(
            location=tuple(location.tolist()),
            scale=tuple(scale.tolist()),
            seconds=self.seen.seconds(key),
            recordings=self.seen.digests,
        )

    def _still(self, key: HandlingKey) -> bool:
        """Return whether most scales are below the default, and no known motion is the reason."""
        _, scale = location_and_scale(self.seen.features(key))
        moves = self.seen.load_change(key) >= STILL_CHANGE  # not where it is unknown
        return not moves and _stretch(self.model.finger(key.finger), scale) > 1

    def _shown(self, key: HandlingKey) -> float:
        """Return the share of the handling that shows over the steps of a sensor, if most does not.

        What is not felt says nothing about false alarms. Still handling has a rule of its own.
        """
        features = self.seen.features(key)
        rests = (features == features.min(axis=0)).mean(axis=0)
        # One taxel has no residual: a feature that it never changes shows nothing anyway.
        hidden = float(np.median(rests[rests < 1])) if (rests < 1).any() else 0.0
        return 1.0 - hidden if hidden > HIDDEN_SHARE and not self._still(key) else 1.0

    def _decide(self, model: Model) -> dict[HandlingKey, GraspingFingers]:
        """Return the decisions of a model about the own handling, for any threshold."""
        fingers: dict[HandlingKey, list[GraspingFinger]] = {}
        for recording in self.recordings:
            if recording.name not in self.seen.digests:
                continue
            replay = ThresholdReplay.of(model, recording)
            for name, decisions in replay.raw.fingers.items():
                key = HandlingKey.of(model, name, recording.modules[name].sensor)
                grasped = grasped_samples(decisions.times, decisions.states)
                sensors = {name: recording.modules[name].sensor}
                plan = model.plan(sensors, recording.rate).for_recording(recording)
                finger = GraspingFinger(name, replay, grasped, plan.zero_unknown)
                fingers.setdefault(key, []).append(finger)
        return {key: GraspingFingers(grasped) for key, grasped in fingers.items()}

    def _warnings(self, sensors: Sequence[HandlingSummary]) -> Iterator[str]:
        for key, shown in self.shown.items():
            if shown < 1:
                yield (
                    f"{key}: {100 * shown:.0f} % of this handling changes the readings by more "
                    "than noise and steps, and only that counts for slips; push harder"
                )
        for summary in sensors:
            if summary.seconds < ENOUGH_HANDLING:
                yield (
                    f"{summary.sensor}: {summary.seconds:.0f} s of holding; {ENOUGH_HANDLING:g} s "
                    "or more are better"
                )
            if summary.load_change < STILL_CHANGE:
                yield (
                    f"{summary.sensor}: the arm hardly moved; add handling in which it carries and "
                    "turns, or its motion will look like slip"
                )
        for key in self.seen.samples:
            if key not in self.keys:
                yield (
                    f"{key}: {self.seen.seconds(key):.1f} s of holding, at least "
                    f"{MIN_HANDLING:g} s needed; left as it was"
                )
        if self.seen.n_left_out:
            yield (
                f"{self.seen.n_left_out} recordings not used: {MAX_HANDLING / 60:g} min of holding "
                "are enough"
            )


def _with_handling(model: Model, handling: Mapping[HandlingKey, Handling]) -> Model:
    """Return the model with more own handling; that of other sensors stays."""
    fingers = {}
    for name, part in model.fingers.items():
        new = {key.sensor: value for key, value in handling.items() if key.finger == name}
        known = {**part.handling, **new}
        fingers[name] = msgspec.structs.replace(part, handling=known)
    return msgspec.structs.replace(model, fingers=fingers)
