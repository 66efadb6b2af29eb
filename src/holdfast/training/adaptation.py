"""How far a model is adapted to recordings: chosen by folds, in doubt not at all; warnings."""

from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np

from holdfast.detection import Linear, Model
from holdfast.sensors.types import Array, Flags, Integers
from holdfast.training.classifiers.fitting import Parameters
from holdfast.training.classifiers.folds import group_folds, time_folds
from holdfast.training.classifiers.logreg import CALIBRATION, NONE, WEIGHTS, Adapted
from holdfast.training.dataset_scan import DatasetScan
from holdfast.training.evaluation import was_trained_on
from holdfast.training.finger_samples import FingerSamples, thinning_step
from holdfast.training.parameter_grid import log_losses
from holdfast.training.splits import TIME_FOLDS, TIME_GAP

MAX_ADAPTATION_SAMPLES = 10_000
"""Maximum number of samples by which the adaptation is chosen, at even steps."""
MAX_FOLDS = 5
ENOUGH_RECORDINGS = 5
"""With fewer recordings only cautious candidates are tried: large changes learn the few grasps."""
CAUTIOUS: tuple[Parameters, ...] = (
    {"change": NONE, "C": 0.0},
    {"change": CALIBRATION, "C": 1e-3},
    {"change": WEIGHTS, "C": 3e-4},
    {"change": CALIBRATION, "C": 1e-2},
)
BOLD: tuple[Parameters, ...] = (
    {"change": WEIGHTS, "C": 1e-3},
    {"change": WEIGHTS, "C": 1e-2},
    {"change": WEIGHTS, "C": 1e-1},
)
"""Candidates, the nearest to the model first. They were chosen on randomized hands of the twin."""


class Adaptation(NamedTuple):
    """Parameters that are adapted to the labels.

    Attributes:
        parameters: of `Adapted`.
        n_recordings: from which it was chosen.
        loss_before: mean log loss of the model on held-out samples.
        loss_after: the same of the adapted model.
    """

    parameters: Parameters
    n_recordings: int
    loss_before: float
    loss_after: float

    def describe(self, model: str, finger: str) -> str:
        """Return a line for the user.

        Args:
            model: name of the model that was adapted.
            finger: name of the classifier; `"*"` for one of all fingers.
        """
        what = f"{model} for {finger}" if finger != "*" else model
        n = f"{self.n_recordings} recording{'s' * (self.n_recordings > 1)}"
        change = self.parameters["change"]
        if change == NONE:
            return f"kept {what}: the labels of {n} did not improve it"
        part = "calibration" if change == CALIBRATION else "weights"
        return (
            f"adapted the {part} of {what} (C = {self.parameters['C']:g}): log loss on held-out "
            f"parts of {n} {self.loss_after:.3f}, was {self.loss_before:.3f}"
        )


def choose_adaptation(
    pool: FingerSamples, prior: Linear, left_out: Collection[int] = ()
) -> Adaptation:
    """Choose how far a classifier is adapted to samples.

    Every candidate is fitted without some recordings (of a single recording: without blocks of
    time, with a gap) and compared with the others on them by the log loss. The nearest to the
    prior is taken that is at most one standard error of the paired difference worse than the
    best.

    Args:
        pool: samples of one classifier.
        prior: to adapt.
        left_out: units that are left out.
    """
    kept = np.flatnonzero(pool.kept(left_out))
    step = thinning_step(len(kept), MAX_ADAPTATION_SAMPLES)
    rows = np.zeros(len(pool.times), dtype=bool)
    rows[kept[::step]] = True
    samples, recordings, times = pool.samples.take(rows), pool.recordings[rows], pool.times[rows]
    blocks = time_folds(recordings, times, TIME_FOLDS)
    n_recordings = len(np.unique(recordings))
    many = n_recordings >= ENOUGH_RECORDINGS
    candidates = CAUTIOUS + BOLD if many else CAUTIOUS
    losses = np.full((len(candidates), len(times)), np.nan)
    recipe = Adapted(prior)
    for fold in _folds(recordings, blocks, times):
        trained, tested = samples.take(fold.trained), samples.take(fold.tested)
        for row, candidate in zip(losses, candidates, strict=True):
            # Every step-th sample is used, and stands for as many. What cannot be fitted is no
            # change: the prior.
            weighted = {**candidate, "C": step * candidate["C"]}
            rule = prior if trained.one_class else recipe.fit(trained, weighted, 0).rule
            row[fold.tested] = log_losses(rule.probability(tested.features), tested.positive)
    # What is alike within a grasp is alike for all its samples: errors are counted by recording, of
    # few recordings by block of time.
    units = recordings if many else TIME_FOLDS * recordings + blocks
    is_scored = ~np.isnan(losses[0])
    by_unit = [
        losses[:, is_scored & (units == unit)].mean(axis=1) for unit in np.unique(units[is_scored])
    ]
    table = np.array(by_unit).reshape(-1, len(candidates)).T
    chosen = choose_nearest(table)
    mean = table.mean(axis=1) if table.size else np.zeros(len(candidates))
    return Adaptation(candidates[chosen], n_recordings, float(mean[0]), float(mean[chosen]))


def choose_nearest(losses: Array) -> int:
    """Return the first candidate that is within one standard error of the best.

    Args:
        losses: (n_candidates, n_units) loss on each unit, paired; the nearest to the prior first.

    Returns:
        Its row; 0 with fewer than two units.

    Example:
        >>> choose_nearest(np.array([[0.3, 0.5, 0.4], [0.2, 0.4, 0.3], [0.1, 0.5, 0.2]]))
        1
    """
    if losses.shape[1] < 2:
        return 0
    worse = losses - losses[losses.mean(axis=1).argmin()]
    error = worse.std(axis=1, ddof=1) / np.sqrt(losses.shape[1])
    return int(np.flatnonzero(worse.mean(axis=1) <= error)[0])


def adaptation_warnings(init: Model, scan: DatasetScan, fingers: Collection[str]) -> Iterator[str]:
    """Yield the reasons why the metrics of an adapted model may be wrong.

    Args:
        init: the model to adapt.
        scan: of the recordings that it is adapted to.
        fingers: names of the classifiers; `"*"` for one of all fingers.

    Raises:
        ModelError: the model to adapt lacks one of the fingers.
    """
    for finger in fingers:
        init.finger(finger)
    name = init.name or "the model to adapt"
    fingers_of: dict[tuple[str, ...], list[str]] = {}
    for finger, sensor in scan.sensors.items():
        trained_on = init.finger(finger).sensor
        if trained_on is not None and init.sensors[trained_on] != sensor:
            pair = (sensor, init.sensors[trained_on])
            fingers_of.setdefault(tuple(f"{s.name} ({s.unit})" for s in pair), []).append(finger)
    for (used, expected), names in fingers_of.items():
        yield (
            f"{', '.join(names)}: the sensor is {used}, {name} was trained on "
            f"{expected}; its features are used unchanged, its weights may not fit"
        )
    if seen_names := known_recordings(init, scan):
        first = ", ".join(seen_names[:3]) + (" ..." if len(seen_names) > 3 else "")
        yield (
            f"{name} was trained on {len(seen_names)} of these {len(scan.recordings)} recordings "
            f"({first}): the metrics on them are too good"
        )


def known_recordings(init: Model, scan: DatasetScan) -> list[str]:
    """Return the names of the recordings that the model to adapt was trained on."""
    return [recording.name for recording in scan.recordings if was_trained_on(init, recording)]


class _Fold(NamedTuple):
    trained: Flags
    tested: Flags


def _folds(recordings: Integers, blocks: Integers, times: Array) -> Iterator[_Fold]:
    """Yield folds that leave out recordings; of a single recording, blocks of time."""
    held_out = group_folds(recordings, MAX_FOLDS)
    if len(held_out) > 1:
        yield from (_Fold(~tested, tested) for tested in held_out)
        return
    for block in np.unique(blocks):
        tested = blocks == block
        low, high = times[tested].min() - TIME_GAP, times[tested].max() + TIME_GAP
        yield _Fold((times < low) | (times > high), tested)
