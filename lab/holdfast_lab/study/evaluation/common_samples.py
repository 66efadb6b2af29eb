"""The samples at which all compared methods can have an estimate.

Methods need histories of different lengths: one sample, a window of 14, a second. Right after
the start of a stretch some have an estimate and others do not. Methods are compared where all of
them have one.
"""

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from holdfast.features import Tare
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast_lab.study.methods import METHODS, Method, hand_signal
from holdfast_lab.study.methods.wavelets import CUTS

PROBE_DURATION = 3.0
"""Duration of the random recording on which the history of a method is measured [s]."""

PROBE_FINGERS = ("thumb", "index")


def find_method(name: str) -> Method:
    """Return the method of that name, of `METHODS` or of `CUTS`."""
    return METHODS[name] if name in METHODS else CUTS[name]


def longest_warm_up(methods: Iterable[str], rate: float) -> float:
    """Return the time from the start of a stretch until all methods have an estimate [s].

    A method that has none within `PROBE_DURATION` is left out.

    Args:
        methods: names.
        rate: samples per second [Hz].
    """
    times = [warm_up(name, rate) for name in methods]
    return max((time for time in times if math.isfinite(time)), default=0.0)


@lru_cache
def warm_up(method: str, rate: float) -> float:
    """Return the time from the start of a stretch until a method has an estimate [s].

    It is measured: on a random recording of two fingers, it is the time of the first sample
    with features. Infinite if there is none within `PROBE_DURATION`.

    Args:
        method: name.
        rate: samples per second [Hz].

    Example:
        >>> round(150 * warm_up("logreg", 150.0)), round(150 * warm_up("difference", 150.0))
        (13, 1)
    """
    generator = np.random.default_rng(0)
    times = np.arange(math.ceil(PROBE_DURATION * rate)) / rate
    kind = replace(sensor("uskin-4x4"), rate=rate, range=None)  # of small readings
    modules = {
        name: Tactile(kind, times, generator.normal(100.0, 10.0, (len(times), kind.n_taxels, 3)))
        for name in PROBE_FINGERS
    }
    hand = hand_signal(Recording("probe", modules), Tare.parse("none"), PROBE_FINGERS)
    features = find_method(method).features(hand)
    known = np.all([np.isfinite(rows).all(axis=1) for rows in features.values()], axis=0)
    return int(np.argmax(known)) / rate if known.any() else math.inf
