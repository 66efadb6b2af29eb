"""The values of the features of a finger, out of its history. Compiled, no objects."""

import math

from holdfast.compiled import compiled, inlined
from holdfast.features.arrays import (
    CHANGE,
    END,
    FIRST_WINDOWED,
    KIND,
    MEAN,
    NOISE,
    RUN,
    SAME_AS,
    SCOPE,
    SIGMA_WINDOW,
    SIGMA_XYZ,
    TRANSFORM,
    WINDOW,
    Array,
    Integers,
    Layout,
    Memory,
    Output,
)
from holdfast.features.haar import haar_window


@compiled
def moments(
    history: Array, counts: Integers, f: int, channel: int, window: int
) -> tuple[float, float]:
    """The m and sigma of the last `window` values; the stretch must hold so many."""
    end = counts[f, END]
    return haar_window(history[f, channel, end - window : end], window)


@inlined
def own_features(layout: Layout, memory: Memory, output: Output, f: int) -> None:
    """The values of a finger's features by itself; NaN where its stretch is too short."""
    specs, floors, reported = layout.specs, layout.floors, layout.windows[f, SIGMA_WINDOW]
    _, _, _, history, counts, levels, own = memory
    for place in range(specs.shape[1]):
        kind, window = specs[f, place, KIND], specs[f, place, WINDOW]
        if kind < 0:
            own[f, place] = 0.0  # in place of those that pad
        elif specs[f, place, SAME_AS] < place:
            own[f, place] = own[f, specs[f, place, SAME_AS]]
        elif counts[f, RUN] < max(window, 1):
            own[f, place] = math.nan
        else:
            if window == reported and kind < SIGMA_XYZ:
                value = output.values[f, MEAN + kind - FIRST_WINDOWED]
            else:
                value = _feature(kind, window, history, counts, f)
            noise, floor = levels[f, NOISE], floors[f, place]
            own[f, place] = _transform(value, specs[f, place, TRANSFORM], window, noise, floor)


@inlined
def fill_features(layout: Layout, memory: Memory, output: Output, f: int) -> float:
    """Fills the features of a finger, the hand's largest where they are so; their sum."""
    own = memory.own
    total = 0.0
    for place in range(layout.specs.shape[1]):
        value = own[f, place]
        if layout.specs[f, place, SCOPE] == 1:
            for other in range(len(own)):
                rival = own[other, place]
                if not layout.alike:
                    rival = _of_other(layout, memory, f, place, other)
                if rival > value or math.isnan(value):
                    value = rival
        output.features[f, place] = value
        total += value
    return total


@compiled
def _of_other(layout: Layout, memory: Memory, f: int, place: int, other: int) -> float:
    """A feature of finger f, of another finger; NaN where its stretch is too short."""
    kind, window = layout.specs[f, place, KIND], layout.specs[f, place, WINDOW]
    if memory.counts[other, RUN] < max(window, 1):
        return math.nan
    value = _feature(kind, window, memory.history, memory.counts, other)
    transform, floor = layout.specs[f, place, TRANSFORM], layout.floors[f, place]
    return float(_transform(value, transform, window, memory.levels[other, NOISE], floor))


@compiled
def _feature(kind: int, window: int, history: Array, counts: Integers, f: int) -> float:
    if kind < FIRST_WINDOWED:
        return float(history[f, kind, counts[f, END] - 1])
    if kind < SIGMA_XYZ:
        return moments(history, counts, f, 0, window)[kind - FIRST_WINDOWED]
    total = 0.0
    for axis in range(1, 4):
        if kind == CHANGE:
            value = history[f, axis, counts[f, END] - 1] - history[f, axis, counts[f, END] - window]
        else:
            value = moments(history, counts, f, axis, window)[1]
        total += value * value
    return math.sqrt(total)


@compiled
def _transform(value: float, transform: int, window: int, noise: float, floor: float) -> float:
    if transform == 0:
        return float(value)
    if transform == 1:
        return math.log(math.sqrt(value * value + floor * floor))
    expected = noise_sigma(noise, window)
    return math.log(max(value, 1e-3 * expected) / expected)


@compiled
def noise_sigma(noise: float, window: int) -> float:
    """The sigma that noise alone gives."""
    return noise * math.sqrt((window - 2.0) / (2.0 * window))


@compiled
def blank(values: Array, f: int) -> None:
    """Makes the values of a finger NaN."""
    for place in range(values.shape[1]):
        values[f, place] = math.nan
