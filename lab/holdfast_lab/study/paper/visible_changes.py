"""The ceiling of every detector: unstable samples in which nothing changes at the sensor.

A detector that sees a window of readings cannot distinguish such a sample from a stable one.
"""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import msgspec
import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

from holdfast.contact import NO_CONTACT, UNKNOWN, Cause, ContactState
from holdfast.metrics.masks import Mask
from holdfast.recordings import Tactile, label_states
from holdfast.sensors.types import Array
from holdfast_lab.study.paper.label_sources import relabelled
from holdfast_lab.study.plan import Corpus

NOISE_QUANTILE = 0.99
"""A change is more than noise if it is above this quantile of the changes at rest."""
HELD_CAUSES = (Cause.DISTURBANCE, Cause.SLIP, Cause.GLITCH)
"""Causes of instability of a held object."""


class HiddenCounts(msgspec.Struct, frozen=True):
    """Samples of one recording in which nothing changes by more than noise.

    Attributes:
        samples: by cause of instability, or "stable": all samples with a full window.
        hidden: of those, the samples without a visible change.
        n_labelled: labelled samples with a full window.
    """

    samples: dict[str, int]
    hidden: dict[str, int]
    n_labelled: int


class _Changes(NamedTuple):
    """Changes within the window that ends at each sample of one finger.

    Attributes:
        finger: name.
        values: (n, 3) see `window_changes`.
        at_rest: (n,) before the first contact.
        kinds: (n,) cause of instability, "stable" or "".
        labelled: (n,) whether there is a label.
    """

    finger: str
    values: Array
    at_rest: Mask
    kinds: list[str]
    labelled: Mask


def count_hidden(corpus: Corpus, window: int) -> list[HiddenCounts]:
    """Count the samples of each recording in which nothing changes by more than noise.

    The noise of a finger is that before the first contact, in all recordings. Recordings are
    read one at a time; labels are exact if the truth is known.

    Args:
        corpus: of recordings that begin without contact; else the list is empty.
        window: N_w, samples in the window.
    """
    found = []
    for recording in corpus.load():
        exact = relabelled(recording, "exact", corpus.tare).modules
        changes = []
        for name in corpus.fingers:
            if name in exact and exact[name].n_samples:
                module = exact[name]
                states = label_states(module.labels, module.times)
                first_contact = np.flatnonzero(states != NO_CONTACT)
                at_rest = np.zeros(len(states), dtype=bool)
                at_rest[: first_contact[0] if len(first_contact) else len(states)] = True
                values = window_changes(module, window)
                kinds = label_kinds(module)
                changes.append(_Changes(name, values, at_rest, kinds, states != UNKNOWN))
        found.append(changes)
    rest: dict[str, list[Array]] = {}
    for change in chain.from_iterable(found):
        rest.setdefault(change.finger, []).append(change.values[change.at_rest])
    limits = {}
    for finger, parts in rest.items():
        # Nothing at rest says what noise is, so nothing can be called hidden in it.
        limit = noise_limits(parts)
        if limit is None:
            return []
        limits[finger] = limit
    return [_count(recording, limits) for recording in found]


def window_changes(module: Tactile, window: int) -> Array:
    """Return (n, 3) three measures of change within the window that ends at each sample.

    They are: the largest range of a component of the fingertip force, the largest range of a
    reading of any taxel, and the sum over all readings of their variance. The first shows
    changes common to all taxels, the second those of one taxel, the third small changes of many.
    NaN for the first `window` - 1 samples.

    Args:
        module: readings (n, n_taxels, 3).
        window: samples in the window.
    """
    readings = np.asarray(module.readings, dtype=np.float64)
    readings = readings - readings[:1]  # large baselines would cost precision
    force = np.einsum("tij,ntj->ni", module.sensor.rotations, readings)
    flat = readings.reshape(len(readings), -1)
    mean = _in_window(uniform_filter1d, flat, window)
    # Mean of squares less square of the mean: SciPy has no filter of the variance.
    variance = _in_window(uniform_filter1d, flat**2, window) - mean**2
    changes = np.column_stack([_range(force, window), _range(flat, window), variance.sum(axis=1)])
    changes[: window - 1] = np.nan
    return changes


def noise_limits(at_rest: Sequence[Array]) -> Array | None:
    """Return (3,) the largest changes that noise explains; None without samples at rest.

    Args:
        at_rest: parts (n, 3) of the changes before the first contact.
    """
    every = np.concatenate([*at_rest, np.empty((0, 3))])
    every = every[~np.isnan(every).any(axis=1)]
    return np.quantile(every, NOISE_QUANTILE, axis=0) if len(every) else None


def label_kinds(module: Tactile) -> list[str]:
    """Return the cause of instability of each sample, "stable", or "" for other states."""
    kinds = [""] * module.n_samples
    for label in module.labels:
        first, last = np.searchsorted(module.times, (label.start, label.end))
        kind = ""
        if label.state is ContactState.STABLE:
            kind = "stable"
        elif label.state is ContactState.UNSTABLE:
            kind = "unknown cause" if label.cause is None else label.cause.value
        kinds[first:last] = [kind] * int(last - first)
    return kinds


def _count(fingers: Sequence[_Changes], limits: Mapping[str, Array]) -> HiddenCounts:
    samples: dict[str, int] = {}
    hidden: dict[str, int] = {}
    n_labelled = 0
    for finger in fingers:
        known = ~np.isnan(finger.values).any(axis=1)
        unseen = known & (finger.values <= limits[finger.finger]).all(axis=1)
        kinds = np.array(finger.kinds)
        for kind in np.unique(kinds[kinds != ""]).tolist():
            of_kind = kinds == kind
            samples[kind] = samples.get(kind, 0) + int((of_kind & known).sum())
            hidden[kind] = hidden.get(kind, 0) + int((of_kind & unseen).sum())
        n_labelled += int((finger.labelled & known).sum())
    return HiddenCounts(samples, hidden, n_labelled)


def _range(values: Array, window: int) -> Array:
    """Return the largest range of a column within the window that ends at each row."""
    highest = _in_window(maximum_filter1d, values, window)
    lowest = _in_window(minimum_filter1d, values, window)
    return np.asarray((highest - lowest).max(axis=1))


def _in_window(function: object, values: Array, window: int) -> Array:
    """Apply a filter of SciPy to the window that ends at each row."""
    return np.asarray(function(values, window, axis=0, origin=(window - 1) // 2))  # type: ignore[operator]
