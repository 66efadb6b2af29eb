"""The exported header as a library, and streams of samples on which it equals `Detector`."""

import ctypes
import functools
import math
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from holdfast.contact import CAUSES as KNOWN_CAUSES
from holdfast.contact import ContactState, Reason, faults_of, taxels_of
from holdfast.detection import Detector
from holdfast.detection.c_header import header_of
from holdfast.detection.plan import Start
from holdfast.errors import StreamError
from holdfast.kernel.structs import n_mask_words

WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
STATES, REASONS, CAUSES = tuple(ContactState), tuple(Reason), (None, *KNOWN_CAUSES)
RING = np.random.default_rng(1).integers(0, 9, size=(30, 30, 3))
"""Readings of samples that come again and again."""


def estimate_type(n_fingers, n_words=1, real=ctypes.c_double):
    """Return the classes of `holdfast_estimate` for ctypes."""

    class FingerEstimate(ctypes.Structure):
        _fields_ = (
            ("time", ctypes.c_double), ("state", ctypes.c_int), ("reason", ctypes.c_int),
            ("cause", ctypes.c_int), ("faults", ctypes.c_uint32),
            ("faulty_taxels", ctypes.c_uint64 * n_words), ("stable_probability", real),
            ("slip_probability", real), ("slip_speed", real), ("slip_distance", real),
            ("instability", real), ("force", real * 3),
        )  # fmt: skip

    class HandEstimate(ctypes.Structure):
        _fields_ = (
            ("time", ctypes.c_double), ("state", ctypes.c_int),
            ("finger", FingerEstimate * n_fingers),
        )  # fmt: skip

    return HandEstimate


@functools.cache  # a second of compiler; all state of a detector is in its own memory
def library_of(text, options):
    """Compile and load a header."""
    with tempfile.TemporaryDirectory() as folder:
        path, library = Path(folder) / "model.h", Path(folder) / "model.so"
        path.write_text(text)
        command = [shutil.which("cc"), "-std=c99", "-O2", "-ffp-contract=off", *WARNINGS, *options]
        words = ["-shared", "-fPIC", "-DHOLDFAST_API=extern", "-x", "c", path, "-o", library, "-lm"]
        subprocess.run([*command, *words], check=True, capture_output=True, text=True)
        return ctypes.CDLL(str(library))


class CDetector:
    """Detector of a header, compiled and loaded."""

    def __init__(self, header, sensors, *, single=False, options=()):
        self.library = library_of(header.text, options)
        self.real = ctypes.c_float if single else ctypes.c_double
        self.dtype = np.float32 if single else np.float64
        self.names = list(sensors)
        self.bounds = np.cumsum([0, *(sensor.n_taxels for sensor in sensors.values())])
        self.library.holdfast_size.restype = ctypes.c_size_t
        self.memory = ctypes.create_string_buffer(self.library.holdfast_size())
        n_words = n_mask_words(max(sensor.n_taxels for sensor in sensors.values()))
        self.estimate = estimate_type(len(sensors), n_words, self.real)()
        self.library.holdfast_init(self.memory)

    def update(self, samples, time):
        """Process samples by finger as `Detector.update` does. Return code and estimate."""
        readings = np.full((self.bounds[-1], 3), np.nan, dtype=self.dtype)
        for name, first, last in zip(self.names, self.bounds, self.bounds[1:], strict=False):
            if name in samples:
                readings[first:last] = samples[name]
        code = self.library.holdfast_update(
            self.memory, ctypes.c_double(time), readings.ctypes.data_as(ctypes.c_void_p),
            ctypes.byref(self.estimate),
        )  # fmt: skip
        return code, self.estimate


def both(
    model, sensors, rate, *, single=False, options=(), in_contact=False, baselines=None, ignore=None
):
    """Return the detector of Python and that of C of a model."""
    start = Start(in_contact, baselines or {})
    header = header_of(model, sensors, rate, single=single, start=start, ignore=ignore)
    c = CDetector(header, sensors, single=single, options=options)
    given = {"in_contact": in_contact, "baselines": baselines, "ignore": ignore}
    return Detector(model, sensors, rate, **given), c


def compare(python, c, samples, time):
    """Process a sample by both, and hold the estimates equal. Return those of Python."""
    try:
        hand = python.update(samples, time)
    except StreamError:
        assert c.update(samples, time)[0] == -1
        return None
    code, got = c.update(samples, time)
    assert code == 0
    assert (STATES[got.state], got.time) == (hand.state, hand.time), time
    for name, finger in zip(c.names, got.finger, strict=True):
        _compare_finger(hand.fingers[name], finger, (name, time))
    return hand


def _compare_finger(expected, got, where):
    assert STATES[got.state] is expected.state, where
    assert REASONS[got.reason] is expected.reason, where
    assert faults_of(got.faults) == expected.faults, where
    assert not expected.faults or taxels_of(got.faulty_taxels) == expected.faulty_taxels, where
    assert CAUSES[got.cause] is expected.cause, where
    numbers = ("time", "stable_probability", "slip_probability", "slip_speed", "slip_distance",
               "instability")  # fmt: skip
    for name in numbers:
        assert same(getattr(got, name), getattr(expected, name)), (*where, name)
    for value, other in zip(got.force, expected.force, strict=True):
        assert same(value, other), (*where, "force")


def same(got, expected):
    """Return whether numbers are equal; NaN is equal to NaN and to None."""
    if expected is None or math.isnan(expected):
        return math.isnan(got)
    return got == expected


def random_samples(rng, sensors, rate, n, counts=True):
    """Yield samples by finger and times: touches, noise, faults, gaps, clock jumps, lost fingers.

    The state of each finger changes at random: free, held, sliding, stuck, saturated.
    """
    time, zero = float(rng.uniform(-10, 1e6)), 30000.0 if counts else 0.0
    scale = 1.0 if counts else 0.002
    load = {name: np.zeros(3) for name in sensors}
    last = {}
    for k in range(n):
        step = _step(rng, rate)
        time += step if 0 < step < np.inf else 0.0
        samples = {}
        for name, tip in sensors.items():
            if rng.random() < 0.01:
                load[name] = rng.choice([0.0, 1.0]) * rng.normal(size=3) * [40, 40, 300]
            if rng.random() < 0.005:
                continue  # no sample
            readings = zero + scale * (
                load[name] * rng.uniform(0.9, 1.1) + rng.normal(0, 1, (tip.n_taxels, 3))
            )
            if counts:
                readings = np.rint(readings)
            if k % 1000 < 40 and name in last:
                readings = last[name]  # repeated samples
            samples[name] = last[name] = _with_faults(rng, readings, k)
        yield samples, time if 0 < step < np.inf else time + step


def _step(rng, rate):
    chance = rng.random()
    if chance < 0.002:
        return float(rng.choice([0.0, -1.0, np.nan, np.inf, 0.05, 0.2, 3.0]))  # refused, or a gap
    return (1.0 + 0.02 * rng.normal()) / rate


def _with_faults(rng, readings, k):
    chance = rng.random()
    readings = readings.copy()
    taxel, axis = rng.integers(len(readings)), rng.integers(3)
    if chance < 0.002:
        readings[taxel, axis] = rng.choice([np.nan, np.inf, -np.inf, 1e9, -1e9, 65535, 0])
    if k % 3000 > 2000:
        readings[0] = 31000.0  # a taxel that stands still
    spoilt = k % 1250
    if 700 <= spoilt < 760:  # nothing of the finger can be true
        readings = 30_000.0 + RING[k % 10, : len(readings)]
    elif 800 <= spoilt < 810:
        readings = 1.0 + RING[: len(readings), k % 30] % 3
    elif 840 <= spoilt < 850:
        readings = 0.3 * readings
    elif 900 <= spoilt < 960:
        readings[1, 2] += 256.0 if readings[1, 2] > 1000.0 else 60.0  # a jump that stays
    elif 880 <= spoilt < 890:
        readings = 1e-318 * np.ones_like(readings)
    if k % 5000 > 4500:
        readings[-1] += 3000.0 * rng.normal()  # a noisy taxel
    return readings
