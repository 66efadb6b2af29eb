"""James & Lepora (2020): differences from sample to sample of every taxel, of a finger or a hand.

The sensors there are optical: the differences are those of the places of their pins. Here they
are those of the readings of the taxels, x_k - x_(k-1) along all axes.
"""

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import recipe
from holdfast.errors import TrainingError
from holdfast.features.kernel import GAP_LIMIT_PERIODS
from holdfast.sensors.types import Array
from holdfast.study.methods.method import HAND, Method
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise

SOURCE = (
    "James & Lepora 2020 (arXiv 2010.01928), by its abstract: differences of taxel readings in "
    "place of those of the pins of optical fingertips; classifiers and training are the paper's"
)


def local(hand: HandSignal) -> dict[str, Array]:
    """(n, 3 n_taxels) of every finger: x_k - x_(k-1), taxel by taxel; NaN where there is none."""
    return stretchwise(hand, _differences)


def whole(hand: HandSignal) -> dict[str, Array]:
    """The differences of all fingers side by side, at the times of the first.

    Another finger gives its last sample that is not later; where that is more than three
    sample periods old, it has none.

    Raises:
        TrainingError: fewer than two fingers.
    """
    if len(hand.fingers) < 2:
        raise TrainingError(
            "the global classifier of James & Lepora needs at least two fingers, "
            f"{len(hand.fingers)} given ({', '.join(hand.fingers) or 'none'})"
        )
    times = next(iter(hand.fingers.values())).times
    oldest = GAP_LIMIT_PERIODS / hand.rate
    parts = [_held(hand.fingers[n].times, rows, times, oldest) for n, rows in local(hand).items()]
    return {HAND: np.hstack(parts)}


def _differences(finger: FingerSignal) -> Array:
    flat = finger.readings.reshape(len(finger.times), 3 * finger.sensor.n_taxels)
    return np.diff(flat, axis=0, prepend=np.full((1, flat.shape[1]), np.nan))


def _held(source: Array, rows: Array, times: Array, oldest: float) -> Array:
    """The rows at the last of their times that are not later than each of `times`."""
    last: npt.NDArray[np.intp] = np.searchsorted(source, times, side="right") - 1
    known = (last >= 0) & (times - source[last] <= oldest)
    return np.where(known[:, None], rows[last], np.nan)


def _method(scope: str, classifier: str, title: str) -> Method:
    return Method(
        f"jl_{scope}_{classifier}",
        f"{title}, {scope} (James & Lepora)",
        "learning",
        SOURCE,
        whole if scope == "global" else local,
        recipe(classifier),
        whole_hand=scope == "global",
    )


JAMES_LEPORA = tuple(
    _method(scope, classifier, title)
    for scope in ("local", "global")
    for classifier, title in (("logreg", "LogReg"), ("svm", "Linear SVM"))
)
