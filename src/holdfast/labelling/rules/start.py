"""The start of a recording: whether it begins in contact, and the tare that fits it.

A tare by seconds is the mean of the first samples. If the hand holds the object already, this
mean contains the grip, and the force falls below zero when the grip ends.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from holdfast.features import Tare
from holdfast.features.faults import LOADED_SECONDS
from holdfast.features.force import tared_force
from holdfast.features.tare import TareArgument
from holdfast.metrics.masks import n_samples_of
from holdfast.recordings import Recording, Tactile
from holdfast.sensors.types import Array

DEFAULT_TARE = Tare("seconds", 0.5)
"""Tare of a recording that begins without contact."""
STARTS_LOADED = "starts_loaded"
"""Field of the metadata that says whether a recording begins in contact."""
FALL_OF_NOISE = 20.0
"""Least fall of the normal force below its first value, in standard deviations of its noise."""
FALL_OF_RANGE = 0.1
"""Least fall below the first value as a share of the largest force; elastomers creep by less."""


def fitting_tare(recording: Recording, tare: TareArgument | Tare | None = None) -> Tare:
    """Return the given tare; without one, the tare that fits the start of the recording.

    Returns:
        The mean of the first 0.5 s, or the first sample if the recording begins in contact.

    Raises:
        ValueError: the tare is unknown.
    """
    if tare is not None:
        return Tare.parse(tare)
    return Tare("first") if evidence_of_contact(recording) else DEFAULT_TARE


def evidence_of_contact(recording: Recording) -> str:
    """Return why a recording begins in contact; empty if nothing indicates it.

    The metadata decide if they have `starts_loaded`. Otherwise the readings do: nothing pulls a
    skin, so that a normal force far below its first value was a load at the start.

    Example:
        >>> from holdfast.synthetic import synthetic_recording
        >>> evidence_of_contact(synthetic_recording("made", seed=0))
        ''
    """
    stated = recording.metadata.get(STARTS_LOADED)
    if isinstance(stated, bool):
        return f"metadata: {STARTS_LOADED}" if stated else ""
    loaded = [name for name, module in recording.modules.items() if _falls_below_start(module)]
    return f"the normal force of {', '.join(loaded)} falls below its first value" if loaded else ""


def _falls_below_start(module: Tactile) -> bool:
    """Return whether the normal force stays far below its first value for a while."""
    try:
        force = tared_force(module, DEFAULT_TARE, offline=True).force
    except ValueError:  # no finite sample at the start
        return False
    known = np.isfinite(force).all(axis=1)
    if not known.any():
        return False
    times, normal = module.times[known], force[known] @ module.sensor.normal
    noise = float(normal[times < times[0] + DEFAULT_TARE.seconds].std())
    if noise == 0:  # a start without noise shows nothing about the load
        return False
    lasting = lowest_maximum(normal, n_samples_of(LOADED_SECONDS, module.period))
    largest = float(np.linalg.norm(force[known], axis=1).max())
    return bool(lasting < -max(FALL_OF_NOISE * noise, FALL_OF_RANGE * largest))


def lowest_maximum(values: Array, n: int) -> float:
    """Return the minimum over all windows of n samples of their maximum; ends are mirrored.

    Example:
        >>> lowest_maximum(np.array([3.0, 1.0, 2.0, 5.0]), 2)
        2.0
    """
    mirrored = np.pad(values, (n // 2, n - 1 - n // 2), mode="symmetric")
    return float(sliding_window_view(mirrored, n).max(axis=1).min())
