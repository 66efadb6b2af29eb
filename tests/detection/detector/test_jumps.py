"""Jumps that stay mask their taxel; a hold that is at zero at once is no contact."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, Fault, faults_of
from holdfast.detection import Model, detect
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import built_in_sensors, sensor

TIMES = np.arange(1000) / 100
OPEN = (TIMES >= 0.6) & (TIMES < 1.95) | (TIMES >= 9)
HELD = (TIMES >= 3) & (TIMES < 7.5)
MODELS = ("builtin:any", "builtin:noise-floor")


SKINS = {
    "anyskin": sensor("anyskin"),
    "uskin-4x4": sensor("uskin-4x4"),
    "in newtons": sensor("papillarray"),
    "with steps": replace(sensor("papillarray"), step=0.001),
    "no magnets": replace(sensor("anyskin"), name="other", magnetic=False),
}


def grasp(which, seed=0):
    """Readings of a hand that holds from 2.4 to 8 s; the last taxels carry least of it."""
    rng, n = np.random.default_rng(seed), which.n_taxels
    grip = np.interp(TIMES, [2, 2.4, 8, 8.4], [0, 1, 1, 0])[:, None, None]
    load = np.linspace(1, 0.3, n)[:, None] * [36, -24, 800]
    scale = 1.0 if which.unit == "count" else 0.002
    zero = 30_000.0 if which.range else rng.uniform(-300, 300, (n, 3)) * scale
    readings = zero + scale * (grip * load + rng.normal(size=(1000, n, 3)))
    return np.round(readings / which.step) * which.step if which.step else readings


def traced(which, readings, model):
    module = Tactile(which, TIMES[: len(readings)], readings)
    return detect(Model.load(model), Recording("jumps", {"thumb": module})).fingers["thumb"]


def named(trace):
    """Samples with a fault, the faults, and the words of the taxels that have one."""
    at = np.flatnonzero(trace.faults)
    faults = {fault for mask in set(trace.faults[at].tolist()) for fault in faults_of(mask)}
    return at, faults, set(trace.faulty_taxels[at, 0].tolist())


JUMPS = {
    "a byte": ("with steps", 0.256),
    "two bytes": ("with steps", 65.536),
    "far, on a magnetic skin": ("anyskin", 9830.0),
    "far, of counts": ("uskin-4x4", -9830.0),
    "far, in newtons": ("in newtons", 19.0),
    "far, where taxels are no magnets": ("no magnets", 9830.0),
}


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("skin", "jump"), JUMPS.values(), ids=JUMPS)
@pytest.mark.parametrize("end", [1000, 650], ids=["to the end", "until it returns"])
def test_a_jump_that_stays_masks_its_taxel(skin, jump, end, model):
    which, taxel = SKINS[skin], 3
    readings = grasp(which)
    clean = traced(which, readings, model)
    assert not clean.faults.any()
    readings[500:end, taxel, 1] += jump
    trace = traced(which, readings, model)
    at, faults, taxels = named(trace)
    assert (at.tolist(), faults, taxels) == ([*range(500, end)], {Fault.INVALID}, {1 << taxel})
    assert (trace.state[OPEN] == clean.state[OPEN]).all()
    assert (trace.state[HELD] == STABLE).all()


@pytest.mark.parametrize("model", MODELS)
def test_a_reading_that_wraps_in_the_press_masks_its_taxel(model):
    """One z of AnySkin is near the end of int16, of 0.242 uT a count."""
    which, size = SKINS["anyskin"], 65536 * 0.242
    readings = grasp(which)
    readings[:, 1, 2] += 7742 - readings[:50, 1, 2].mean()
    readings[:, 1, 2] = (readings[:, 1, 2] + 7930) % size - 7930
    trace = traced(which, readings, model)
    at, faults, taxels = named(trace)
    assert (faults, taxels) == ({Fault.INVALID}, {2})
    assert (readings[at, 1, 2] < 0).all() and (readings[:, 1, 2] < 0).sum() == len(at)
    assert (trace.state[OPEN] == NO_CONTACT).mean() > 0.9
    assert (trace.state[HELD] == STABLE).all()
    assert trace.force[HELD, 2] == pytest.approx(np.full(HELD.sum(), 5 * 0.65 * 800), rel=0.05)


@pytest.mark.parametrize("seconds", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("skin", built_in_sensors())
def test_the_first_touch_of_one_taxel_is_no_fault_that_lasts(skin, seconds):
    which = sensor(skin)
    scale = 1.0 if which.unit == "count" else (which.step or 0.004) / 2
    at_zero = which.step or which.rests_at_zero or not which.range
    rng, zero = np.random.default_rng(1), 0.0 if at_zero else 30_000.0
    press = min(300 * scale, 0.5 * (which.range or (0, np.inf))[1])
    readings = zero + scale * rng.normal(size=(1000, which.n_taxels, 3))
    readings[:, 0, 2] += press * np.clip((TIMES - 2) / max(seconds, 1e-3), 0, 1)
    if which.step:
        readings = which.step * np.round(readings / which.step)
    assert not traced(which, readings, "builtin:any").faults[203:].any()


def rezeroed(which, at=500):
    """The driver takes a new baseline in the grip."""
    readings = grasp(which)
    readings -= readings[:20].mean(axis=0)
    readings[at:] -= readings[at - 5 : at].mean(axis=0)
    return readings


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("skin", ["anyskin", "in newtons", "no magnets"])
def test_a_new_baseline_in_the_grip_is_unknown_and_then_no_contact(skin, model):
    trace = traced(SKINS[skin], rezeroed(SKINS[skin]), model)
    at, faults, _ = named(trace)
    assert (at.tolist(), faults) == ([*range(500, 1000)], {Fault.REZEROED})
    assert (trace.state[300:500] == STABLE).all()
    assert (trace.state[500:550] == UNKNOWN).all()
    assert (trace.state[552:] == NO_CONTACT).all()


@pytest.mark.parametrize("model", MODELS)
def test_the_next_touch_ends_it(model):
    """Of an object that left at once, and after the hand has opened on a new baseline."""
    which = SKINS["anyskin"]
    left, moved = grasp(which), rezeroed(which)
    press = np.interp(TIMES, [8.8, 9.0], [0, 1])[:, None, None] * [18, -12, 400]
    left[500:] = left[:500] + np.random.default_rng(1).normal(0, 0.5, left[:500].shape)
    # With a tare of seconds, a press on a new baseline is the fault tare_loaded.
    streams = ((left, 730), (moved + press, 890))[: 1 if model == "builtin:noise-floor" else 2]
    for readings, touched in streams:
        trace = traced(which, readings, model)
        last = np.flatnonzero(trace.faults == 1 << list(Fault).index(Fault.REZEROED))[-1]
        assert touched - 30 < last < touched
        assert (trace.state[last + 60 : last + 200] == STABLE).all()


@pytest.mark.parametrize("model", MODELS)
def test_a_force_that_returns_shows_that_the_zero_is_the_same(model):
    which = SKINS["in newtons"]
    readings = grasp(which)
    readings[500:503] = readings[0:3]
    trace = traced(which, readings, model)
    assert named(trace)[0].tolist() == [500, 501, 502]
    assert (trace.state[HELD] != NO_CONTACT).all()
    assert (trace.state[530:750] == STABLE).all()
