"""Grasps of randomized hands, each normalised by the other grasps of the same hand.

A user normalises the features by handling of the same hand, of other objects and at another time.
So does the training: `holdfast simulate --randomize --grasps 3` gives three grasps of each hand.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from holdfast.contact import STABLE
from holdfast.detection import Model, detect
from holdfast.detection.features import extract
from holdfast.metrics.slip_truth import SLIDING, STILL, slip_truth
from holdfast.recordings import Recording, Tactile
from holdfast.resampling import true_updates
from holdfast.training.calibration import location_and_scale
from holdfast.training.own_handling import grasped_samples

MAX_RATE = 20.0
"""Samples per second that are kept of each recording [Hz]; neighbours are nearly copies."""
NORMALISED_BY = "others", "itself", "default"
"""Kinds of handling by which the features of a grasp are normalised."""
ONSET_DURATION = 0.2
"""Time after a stable sample in which an unstable one shows the onset of instability [s]."""
MIN_SAMPLES = 100
"""Fewer samples of handling are no own handling: 5 s."""

Moments = tuple[np.ndarray, np.ndarray]
"""Location and scale of the features, (n_features,) each."""


class HandGrasp(NamedTuple):
    """Samples of one recording of a randomized hand, of all its fingers.

    Attributes:
        hand: name of the hand, which several grasps share.
        kind: of its sensors.
        features: (n, n_features).
        held: (n,) in contact by the load, as a user's own handling is found.
        stable: (n,) labelled stable.
        onset: (n,) labelled unstable, and stable shortly before.
        slides: (n,) over 1 mm/s by the truth.
        still: (n,) under 0.3 mm/s by the truth.
    """

    hand: str
    kind: str
    features: np.ndarray
    held: np.ndarray
    stable: np.ndarray
    onset: np.ndarray
    slides: np.ndarray
    still: np.ndarray

    @property
    def handling(self) -> np.ndarray:
        """Features of ordinary handling: held, labelled stable, without sliding."""
        return self.features[self.held & self.stable & self.still]

    def normalised(self, moments: Moments) -> "HandGrasp":
        """Return the samples with features normalised by a location and a scale."""
        location, scale = moments
        return self._replace(features=(self.features - location) / scale)


def read_grasp(
    model: Model,
    recording: Recording,
    changed: Callable[[np.ndarray, Tactile], np.ndarray] | None = None,
) -> HandGrasp:
    """Return the samples of a recording: features and contact by a model of any finger.

    Args:
        model: of any finger.
        recording: of a randomized hand.
        changed: returns other features for those of a finger; by default they stay.
    """
    recording = true_updates(recording)
    sensors = {n: m.sensor for n, m in recording.modules.items() if m.n_samples > 30}
    rows = extract(model.plan(sensors, recording.rate), recording) if sensors else {}
    traces = detect(model, recording).fingers if sensors else {}
    step = max(1, round(recording.rate / MAX_RATE))
    columns: list[tuple[np.ndarray, ...]] = []
    for name, finger in rows.items():
        module = recording.modules[name]
        truth = slip_truth(recording, name, module.times)
        if truth is None:
            continue
        kept = np.isfinite(finger.features).all(axis=1)
        kept &= np.arange(len(kept)) % step == 1 % step
        stable = module.label_states == STABLE
        last = np.maximum.accumulate(np.where(stable, module.times, -np.inf))
        onset = ~stable & (module.times - last <= ONSET_DURATION)
        held = grasped_samples(module.times, traces[name].state)
        features = changed(finger.features, module) if changed else finger.features
        parts = features, held, stable, onset, truth.codes == SLIDING, truth.codes == STILL
        columns.append(tuple(part[kept] for part in parts))
    empty = (np.empty((0, len(model.finger("*").features))), *(np.empty(0, bool),) * 5)
    metadata = recording.metadata
    return HandGrasp(
        str(metadata.get("hand", recording.name)),
        str(metadata.get("sensor_kind", "")),
        *(np.concatenate(parts) for parts in zip(empty, *columns, strict=True)),
    )


def moments_of_others(grasps: Sequence[HandGrasp]) -> list[Moments | None]:
    """Return the own handling of each grasp, from the other grasps of its hand; None without."""
    by_hand: dict[str, list[int]] = {}
    for index, grasp in enumerate(grasps):
        by_hand.setdefault(grasp.hand, []).append(index)
    moments: list[Moments | None] = []
    for index, grasp in enumerate(grasps):
        others = [grasps[k].handling for k in by_hand[grasp.hand] if k != index]
        handling = np.concatenate(others) if others else np.empty((0, grasp.features.shape[1]))
        moments.append(location_and_scale(handling) if len(handling) >= MIN_SAMPLES else None)
    return moments


def default_handling(grasps: Sequence[HandGrasp]) -> Moments:
    """Return the handling of a hand of which nothing is known.

    The location is the median over the hands; the scale is that of all hands together, with the
    spread of their locations.
    """
    by_hand: dict[str, list[np.ndarray]] = {}
    for grasp in grasps:
        by_hand.setdefault(grasp.hand, []).append(grasp.handling)
    parts = [np.concatenate(handling) for handling in by_hand.values()]
    moments = [location_and_scale(part) for part in parts if len(part) >= MIN_SAMPLES]
    locations, scales = (np.array(values) for values in zip(*moments, strict=True))
    return np.median(locations, axis=0), np.sqrt((scales**2).mean(axis=0) + locations.var(axis=0))


def moments_by(name: str, grasps: Sequence[HandGrasp]) -> list[Moments | None]:
    """Return by what the features of each grasp are normalised for the training, by its name.

    Args:
        name: `others`, the other grasps of its hand; `itself`; or `default`, default handling.
        grasps: of all hands.
    """
    others = moments_of_others(grasps)
    if name == "others":
        return others
    if name == "itself":
        return [location_and_scale(x.handling) if len(x.handling) else None for x in grasps]
    default = default_handling(grasps)
    return [None if moments is None else default for moments in others]


def folds_of(grasps: Sequence[HandGrasp], n_folds: int) -> np.ndarray:
    """Return the fold of each grasp; all grasps of a hand are in one."""
    hands = list(dict.fromkeys(grasp.hand for grasp in grasps))
    by_hand: Mapping[str, int] = {hand: index % n_folds for index, hand in enumerate(hands)}
    return np.array([by_hand[grasp.hand] for grasp in grasps])
