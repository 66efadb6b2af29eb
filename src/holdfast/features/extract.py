"""Features of whole recordings, by the same kernel that runs live."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled
from holdfast.features import kernel
from holdfast.features.arrays import AMPLITUDE, TARE_GIVEN, Array, Layout, Memory, Output
from holdfast.features.stream import (
    StreamPlan,
    give_baseline,
    new_memory,
    new_output,
    samples_of,
)
from holdfast.recordings import Recording


class FingerFeatures(NamedTuple):
    """Features of one finger over a recording.

    Attributes:
        features: (n, n_features); NaN where there are none.
        amplitude: (n,) F_a [unit of the readings]; NaN where there is no force.
    """

    features: Array
    amplitude: Array


def extract(plan: StreamPlan, recording: Recording) -> dict[str, FingerFeatures]:
    """The features of every finger of the plan at every one of its samples.

    Args:
        plan: which fingers, features and tare.
        recording: that has those fingers.

    Returns:
        By finger, one row for each sample of its module.

    Raises:
        ValueError: a tare by interval finds no samples.
    """
    layout = plan.layout()
    memory, output = new_memory(layout), new_output(layout)
    if layout.tare_kind == TARE_GIVEN:
        give_baseline(plan, memory, recording)
    pieces: list[list[FingerFeatures]] = [[] for _ in plan.fingers]
    for times, present, readings in samples_of(plan, recording):
        features = np.full((*present.shape, layout.specs.shape[1]), np.nan)
        amplitude = np.full(present.shape, np.nan)
        _extract(layout, memory, output, readings, present, times, features, amplitude)
        for place, pile in enumerate(pieces):
            rows = present[:, place]
            pile.append(FingerFeatures(features[rows, place], amplitude[rows, place]))
    return {
        finger: FingerFeatures(
            np.concatenate([piece.features for piece in pile])[:, : len(plan.features[finger])],
            np.concatenate([piece.amplitude for piece in pile]),
        )
        for finger, pile in zip(plan.fingers, pieces, strict=True)
    }


@compiled
def _extract(
    layout: Layout,
    memory: Memory,
    output: Output,
    readings: Array,
    present: npt.NDArray[np.bool_],
    times: Array,
    features: Array,
    amplitude: Array,
) -> None:
    for k in range(len(times)):
        kernel.advance(layout, memory, output, readings[k], present[k], times[k])
        features[k] = output.features
        amplitude[k] = output.values[:, AMPLITUDE]
