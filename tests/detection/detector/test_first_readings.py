"""The first samples may be no readings: constants, zeros, a jump, or a filter that rises."""

import math
from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE
from holdfast.detection import Detector, Model, Tare, detect
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor as built_in

from . import naive
from .build import RATE, sensor
from .test_against_naive import same
from .test_detector import by_force

SKIN = built_in("anyskin")
PRESS = np.array([1, 0.5, 0.6, 0.4, 0.5])[:, None] * [36, -24, 800]


def grasp(shares=None, seed=0):
    """Open to 2 s, held to 8 s, open from 8.4 s: readings at rest, and the share of the press."""
    rng = np.random.default_rng(seed)
    rest, times = rng.uniform(-300, 300, (5, 3)), np.arange(1000) / RATE
    shares = np.interp(times, [2, 2.4, 8, 8.4], [0, 1, 1, 0]) if shares is None else shares
    return rest, shares[:, None, None] * PRESS + rng.normal(0, 1, (1000, 5, 3))


def constants(rest, beyond):
    return np.concatenate([np.full((1, 5, 3), [0.75, 0.75, 1.58]), (rest + beyond)[1:]])


def zeros(rest, beyond):
    return np.concatenate([np.zeros((1, 5, 3)), (rest + beyond)[1:]])


def zeros_of_one_taxel(rest, beyond):
    readings = rest + beyond
    readings[0, 0] = 0
    return readings


def another_field(rest, beyond):
    readings = rest + beyond
    readings[0] += 500
    return readings


def zeros_for_long(rest, beyond):
    readings = rest + beyond
    readings[:20] = 0
    return readings


def filtered(seconds):
    def rises(rest, beyond):
        return (1 - np.exp(-np.arange(1000) / RATE / seconds))[:, None, None] * rest + beyond

    return rises


FIRST = {
    "constants": constants,
    "zeros": zeros,
    "zeros of one taxel": zeros_of_one_taxel,
    "another field": another_field,
    "zeros for 0.2 s": zeros_for_long,
    "a filter of 10 ms": filtered(0.01),
    "a filter of 30 ms": filtered(0.03),
    "a filter of 60 ms": filtered(0.06),
    "a filter of 90 ms": filtered(0.09),
    "readings": np.add,
}


def states(readings, model="builtin:any"):
    module = Tactile(SKIN, np.arange(len(readings)) / RATE, readings)
    return detect(Model.load(model), Recording("made", {"a": module})).fingers["a"].state


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", FIRST)
def test_an_open_hand_is_open_whatever_the_first_readings(name, seed):
    found = states(FIRST[name](*grasp(seed=seed)))
    assert (found[60:195] == NO_CONTACT).all() and (found[900:] == NO_CONTACT).all()
    assert (found[300:750] == STABLE).all()
    assert (found[:195] != STABLE).all()


TIMES = np.arange(1000) / RATE
LOADED = {
    "held": np.ones(1000),
    "closes still": np.clip(0.3 + TIMES / 0.2, 0, 1),
    "closes ever slower": 1 - 0.7 * np.exp(-TIMES / 0.1),
    "touches after 0.1 s": np.clip((TIMES - 0.1) / 0.1, 0, 1),
}


@pytest.mark.parametrize("at_rest", [True, False], ids=["rests at zero", "has an offset"])
@pytest.mark.parametrize("name", LOADED)
def test_a_hand_that_starts_loaded_keeps_its_first_reading(name, at_rest):
    rest, beyond = grasp(LOADED[name])
    readings = beyond if at_rest else rest + beyond
    detector = Detector(Model.load("builtin:any"), {"a": SKIN}, RATE)
    for k in range(100):
        detector.update({"a": readings[k]}, k / RATE)
    assert np.array_equal(detector.baselines()["a"], readings[0])


NAIVE = {
    "six of a skin": sensor(6, limits=(-2000.0, 2000.0), magnetic=True),
    "two": sensor(2, limits=(-2000.0, 2000.0)),
    "one in newtons": sensor(1, unit="N", limits=None),
    "six that rest at zero": replace(sensor(6, unit="N", limits=None), rests_at_zero=True),
}


@pytest.mark.slow
@pytest.mark.parametrize("tare", ["first", "0.2"])
@pytest.mark.parametrize("name", NAIVE)
def test_equals_the_naive_detector(name, tare):
    """Readings that begin by any mixture of constants, jumps, repeats and filters."""
    which, hand_model = NAIVE[name], by_force(tare=tare)
    rng, seen = np.random.default_rng(len(name)), set()
    for _ in range(12):
        shape = (140, which.n_taxels, 3)
        rest = rng.choice([0.0, 300.0]) * rng.normal(size=shape[1:])
        values = rest + rng.choice([1e-3, 1.0]) * rng.normal(size=shape)
        if rng.random() < 0.5:
            rise = 1 - rng.uniform(0.3, 0.97) ** np.arange(140)
            values = values + (rise[:, None, None] - 1) * rest
        n_first = rng.choice([0, 1, 2, 10, 60])
        values[:n_first] = rng.choice([0.0, 7.0, 1500.0, 5000.0])
        values[rng.integers(0, 5), rng.integers(which.n_taxels)] = rng.choice([0, 900, math.nan])
        values[rng.integers(1, 6) + np.arange(2)] = values[rng.integers(0, 6)]
        values[100:, :, 0] += 150
        detector = Detector(hand_model, {"a": which}, RATE)
        slow = naive.Hand(hand_model, {"a": which}, Tare.parse(tare), RATE)
        begins = 0
        for k, readings in enumerate(values):
            before = len(slow.fingers["a"].samples)
            same(detector.update({"a": readings}, k / RATE), slow.update({"a": readings}, k / RATE))
            begins += len(slow.fingers["a"].samples) <= before > 0
        seen.add(min(begins, 3))
    assert len(seen) >= 2
