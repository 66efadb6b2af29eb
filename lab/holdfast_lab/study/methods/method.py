"""Method of the study: features of a hand, and a way to fit a classifier to them.

Every method starts from a `HandSignal`: the tared readings and forces of the fingers of one
recording.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from holdfast.detection import Tare
from holdfast.detection.features import tared_force
from holdfast.kernel._extension import GAP_LIMIT_PERIODS
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array
from holdfast.sensors.xela_models import NEWTONS_PER_NORMAL_COUNT
from holdfast.training.classifiers import Parameters
from holdfast_lab.classifiers import StudyRecipe

HAND = "hand"
"""Key of the features of a whole-hand method."""

Category = Literal["paper", "friction", "vibration", "differentiation", "learning", "holdfast",
                   "untrained"]  # fmt: skip


@dataclass(frozen=True, eq=False)
class FingerSignal:
    """The tared readings and the force of one finger over one recording.

    Attributes:
        sensor: of the finger.
        times: (n,) [s].
        with_baseline: (n, n_taxels, 3) readings in taxel frames, as they are recorded.
        baseline: (n_taxels, 3) the tare [unit of the readings].
        force: (n, 3) F_tip [unit of the readings]; NaN until the tare is complete, and at
            samples with a reading that is not finite.
        rate: samples per second [Hz].
    """

    sensor: Sensor
    times: Array
    with_baseline: npt.NDArray[Any]
    baseline: Array
    force: Array
    rate: float

    @property
    def readings(self) -> Array:
        """(n, n_taxels, 3) readings less the tare [unit]; computed at each call: they are large."""
        return np.asarray(self.with_baseline, dtype=np.float64) - self.baseline

    @property
    def amplitude(self) -> Array:
        """F_a = |F_tip|, (n,)."""
        return np.asarray(np.linalg.norm(self.force, axis=1))

    @property
    def normal_force(self) -> Array:
        """Force along the normal of the fingertip, the paper's F_x, (n,)."""
        return np.asarray(self.force @ self.sensor.normal)

    @property
    def normal_magnitude(self) -> Array:
        """|F_n|, (n,)."""
        return np.abs(self.normal_force)

    @property
    def tangential_magnitude(self) -> Array:
        """|F_t|, the magnitude of the force without its normal component, (n,)."""
        normal = self.sensor.normal
        tangential = self.force - np.outer(self.force @ normal, normal)
        return np.asarray(np.linalg.norm(tangential, axis=1))

    @property
    def units_per_newton(self) -> float:
        """One newton in the unit of the readings, for published constants in newtons.

        Counts are converted as counts of a uSkin, whatever the sensor: for most other sensors
        nothing is published.
        """
        return 1.0 if self.sensor.unit == "N" else 1.0 / NEWTONS_PER_NORMAL_COUNT

    @cached_property
    def stretches(self) -> tuple[slice, ...]:
        """The unbroken stretches: known forces without a gap longer than 3 sample periods."""
        complete = np.isfinite(self.force.sum(axis=1))
        broken = np.diff(self.times) > GAP_LIMIT_PERIODS / self.rate
        edges = np.flatnonzero(broken | (complete[1:] != complete[:-1])) + 1
        bounds = [0, *edges.tolist(), len(complete)]
        return tuple(slice(a, b) for a, b in pairwise(bounds) if b > a and complete[a])

    def part(self, rows: slice) -> "FingerSignal":
        """Return the signal of some samples."""
        return replace(
            self,
            times=self.times[rows],
            with_baseline=self.with_baseline[rows],
            force=self.force[rows],
        )


@dataclass(frozen=True, eq=False)
class HandSignal:
    """The signals of the fingers of one recording.

    Attributes:
        recording: the signals come from.
        tare: that was subtracted.
        fingers: signals by name.
    """

    recording: Recording
    tare: Tare
    fingers: Mapping[str, FingerSignal]

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return self.recording.rate

    def each_stretch(self, name: str) -> Iterator[tuple[slice, FingerSignal]]:
        """Yield the rows and the signal of each unbroken stretch of a finger."""
        finger = self.fingers[name]
        for rows in finger.stretches:
            yield rows, finger.part(rows)


@dataclass(frozen=True)
class Method:
    """A method that the study compares: features, then a classifier.

    Attributes:
        name: in files and in the code.
        title: in tables and figures.
        category: in the paper's review of methods.
        source: publication, and what differs from it here.
        features: function from a hand to (n, n_features) of each finger, one row a sample,
            causal; NaN where there are none. A whole-hand method returns one array under
            `HAND`, at the times of the first finger.
        recipe: fits the classifier.
        parameters: of the recipe; None for its reference setting.
        whole_hand: whether the method decides for the hand as a whole.
    """

    name: str
    title: str
    category: Category
    source: str
    features: Callable[[HandSignal], Mapping[str, Array]]
    recipe: StudyRecipe
    parameters: Parameters | None = None
    whole_hand: bool = False

    @property
    def reference(self) -> Parameters:
        """The parameters of the fit."""
        return self.recipe.reference if self.parameters is None else self.parameters


def hand_signal(
    recording: Recording, tare: Tare, fingers: tuple[str, ...] | None = None
) -> HandSignal:
    """Return the signals of some fingers of a recording.

    Args:
        recording: of any sensors.
        tare: how the baseline is found.
        fingers: names; by default all fingers that have labels.
    """
    names = fingers or tuple(name for name, module in recording.modules.items() if module.labels)
    rate, signals = recording.rate, {}
    for name in names:
        module = recording.modules[name]
        tared = tared_force(module, tare, rate)
        signals[name] = FingerSignal(
            module.sensor, module.times, module.readings, tared.baseline, tared.force, rate
        )
    return HandSignal(recording, tare, signals)


def stretchwise(hand: HandSignal, function: Callable[[FingerSignal], Array]) -> dict[str, Array]:
    """Return features of every finger, computed for each unbroken stretch; NaN elsewhere.

    Args:
        hand: gives the fingers.
        function: from a signal of n samples to (n, n_features). It is called with n = 0 too,
            for the number of features of a finger without a stretch.
    """
    rows_by_finger = {}
    for name, finger in hand.fingers.items():
        # Of an empty part: a finger without a stretch has NaN rows of the same width.
        n_features = function(finger.part(slice(0, 0))).shape[1]
        features = np.full((len(finger.times), n_features), np.nan)
        for rows, stretch in hand.each_stretch(name):
            features[rows] = function(stretch)
        rows_by_finger[name] = features
    return rows_by_finger


def latest_rows(hand: HandSignal, rows: Mapping[str, Array], times: Array) -> Iterator[Array]:
    """Yield the rows of every finger as they are known at some times.

    A finger contributes its last sample that is not later. If that is more than three sample
    periods old, its values are NaN.

    Args:
        hand: gives the times of the fingers.
        rows: (n, n_features) of every finger.
        times: (m,) [s].

    Yields:
        (m, n_features) of one finger after the other.
    """
    for name, finger_rows in rows.items():
        sampled = hand.fingers[name].times
        last: npt.NDArray[np.intp] = np.searchsorted(sampled, times, side="right") - 1
        # Row -1 stands for none yet; it is replaced by NaN.
        is_recent = (last >= 0) & (times - sampled[last] <= GAP_LIMIT_PERIODS / hand.rate)
        yield np.where(is_recent[:, None], finger_rows[last], np.nan)


def windowed(values: Array, window: int, function: Callable[[Array], Array]) -> Array:
    """Return a function of the window that ends at each sample; NaN without a full window.

    Args:
        values: (n, ...) of one unbroken stretch.
        window: samples in a window.
        function: from (m, ..., window) windows, oldest sample first, to (m, n_features); m may
            be 0.

    Returns:
        (n, n_features).
    """
    # Zeros before a stretch that is too short, because NumPy makes no window of fewer samples.
    padding = np.zeros((max(window - len(values), 0), *values.shape[1:]))
    windows = sliding_window_view(np.concatenate([padding, values]), window, axis=0)
    values_of_windows = function(windows[len(padding) > 0 :])
    empty = np.full((len(values) - len(values_of_windows), values_of_windows.shape[1]), np.nan)
    return np.concatenate([empty, values_of_windows])
