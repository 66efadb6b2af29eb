"""Magnetic sensors: fields that turn, readings that come too early, jumps."""

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, Fault, faults_of
from holdfast.detection import Model, Tare, detect
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor

ANY = Model.load("builtin:any")
SHARES = np.array([0.35, 0.8, 1.0, 0.6, 0.2])


def turned(field, *, rate=100.0, seconds=2.0, noise=1.0, name="anyskin", in_frame=False, press=300):
    """An open hand that turns at 3 s, and grasps at 9 s; two fingers."""
    which, n = sensor(name), round(15 * rate)
    times = np.arange(n) / rate
    grip = np.interp(times, [9, 9.5, 13, 13.4], [0, 1, 1, 0])
    turn = np.interp(times, [3, 3 + seconds], [0, 1])
    shares = np.resize(SHARES, which.n_taxels)[:, None]
    frames = which.rotations if in_frame else np.broadcast_to(np.eye(3), which.rotations.shape)
    modules = {}
    for seed, finger in enumerate(("thumb", "index")):
        rng = np.random.default_rng(seed)
        zero = rng.uniform(-300, 300, (which.n_taxels, 3)) + (33_000 if which.range else 0)
        readings = zero + rng.normal(scale=noise, size=(n, which.n_taxels, 3))
        readings += turn[:, None, None] * np.einsum("ikj,k->ij", frames, np.asarray(field, float))
        readings += grip[:, None, None] * shares * [press / 15, press / 60, press]
        modules[finger] = Tactile(which, times, readings)
    return Recording("turned", modules)


TURNS = {
    "half of the earth's": {"field": (35, -40, 30)},
    "twice the earth's": {"field": (-70, 60, -60)},
    "along the normal": {"field": (5, 10, 60)},
    "small": {"field": (8, -6, 5)},
    "fast": {"field": (35, -40, 30), "seconds": 0.3},
    "slow rate": {"field": (35, -40, 30), "rate": 50.0},
    "fast rate": {"field": (35, -40, 30), "rate": 333.0},
    "noisy": {"field": (35, -40, 30), "noise": 3.0},
    "in the frame of the patch": {"field": (35, -40, 30), "in_frame": True},
    "of a sensor without a known unit": {
        "field": (200, -150, 90), "name": "uskin-4x4", "press": 900, "noise": 4.0,
    },
    "that pulls a patch of unknown unit": {
        "field": (60, 30, -350), "name": "uskin-4x6", "press": 900, "noise": 4.0,
    },
    "that pulls before it is found": {
        "field": (-300, 40, 20), "name": "uskin-curved", "press": 900, "noise": 4.0,
        "in_frame": True, "seconds": 5.0,
    },
}  # fmt: skip


@pytest.mark.parametrize("options", TURNS.values(), ids=TURNS)
def test_a_hand_that_turns_in_a_field_touches_nothing(options):
    recording = turned(**options)
    for finger, trace in detect(ANY, recording).fingers.items():
        times = recording.modules[finger].times
        assert (trace.state[times < 9] != STABLE).all()
        assert (trace.state[(times > 9.8) & (times < 12.8)] == STABLE).mean() >= 0.8
        assert (trace.state[times >= 13.5] == NO_CONTACT).all()
        assert not trace.faults.any()


@pytest.mark.parametrize("name", ["anyskin", "uskin-4x4"])
def test_without_a_turn_there_is_no_finding(name):
    trace = detect(ANY, turned((0, 0, 0), name=name)).fingers["thumb"]
    assert not trace.faults.any()


def test_a_press_of_all_taxels_alike_is_a_load():
    """Faster than any field, or stronger."""
    recording = turned((0, 0, 300), seconds=0.5)
    trace, times = detect(ANY, recording).fingers["thumb"], recording.modules["thumb"].times
    assert (trace.state[(times > 4.5) & (times < 8.9)] == STABLE).all()


def shared(name, shares, *, grip=0.0, palm=True, field=(6, 12, 60)):
    """A hand that turns from 5 to 8 s, and may hold from 2 s on; its palm lies another way."""
    which, rng, times = sensor(name), np.random.default_rng(4), np.arange(1200) / 100
    turn = np.interp(times, [5, 8], [0, 1])[:, None]
    fields = {"thumb": turn * field, "palm": turn * [12, 60, -6]}  # of equal size
    modules = {}
    for finger in ("thumb", "palm") if palm else ("thumb",):
        readings = rng.normal(size=(1200, which.n_taxels, 3)) + (33_000 if which.range else 0)
        own = np.resize(shares, which.n_taxels) if finger == "thumb" else np.ones(which.n_taxels)
        readings += fields[finger][:, None] * own[:, None]
        if finger == "thumb":
            load = np.interp(times, [2, 2.5], [0, grip])[:, None, None]
            readings += load * np.resize(SHARES, which.n_taxels)[:, None] * [0.05, 0.02, 1]
        modules[finger] = Tactile(which, times, readings)
    return times, detect(ANY, Recording("shared", modules)).fingers


UNLIKE = [1.2, 0.8, 1.0, 0.85, 1.15]
SHARED = {
    "gains that differ": ("anyskin", UNLIKE),
    "along the normal, where the unit is not known": ("uskin-4x4", [1.0]),
    "both": ("uskin-4x4", UNLIKE),
}


@pytest.mark.parametrize(("name", "shares"), SHARED.values(), ids=SHARED)
def test_an_open_module_decides_what_may_be_a_field_or_a_load(name, shares):
    times, fingers = shared(name, shares)
    assert (fingers["thumb"].state[times > 1] == NO_CONTACT).all()
    assert not fingers["thumb"].faults.any()
    alone = shared(name, shares, palm=False)[1]["thumb"]
    assert (alone.state[times > 9] != NO_CONTACT).all()


def changed(shares, seconds=6.0):
    """A finger whose taxels change by these shares of a vector from 2 s on."""
    which, n = sensor("anyskin"), round(100 * seconds)
    rng, times = np.random.default_rng(3), np.arange(n) / 100
    ramp = np.interp(times, [2, 2.5], [0, 1])[:, None, None]
    readings = rng.uniform(-300, 300, (5, 3)) + rng.normal(size=(n, 5, 3))
    readings += ramp * np.asarray(shares, float)[:, None] * [60, -40, 10]
    return Recording("changed", {"thumb": Tactile(which, times, readings)})


def test_what_may_be_a_field_or_a_load_is_a_fault_and_no_state():
    trace = detect(ANY, changed([1.2, 0.8, 1.0, 0.85, 1.15])).fingers["thumb"]
    assert {faults_of(mask) for mask in trace.faults[300:].tolist()} == {(Fault.FIELD,)}
    assert (trace.state[300:] == UNKNOWN).all()
    assert np.count_nonzero(trace.state == STABLE) <= 10  # within the 0.2 s before it is clear


def test_a_field_beyond_that_of_the_earth_is_a_fault():
    trace = detect(ANY, changed(np.full(5, 3.0))).fingers["thumb"]
    assert {faults_of(mask) for mask in trace.faults[300:].tolist()} == {(Fault.FIELD,)}


def still_hold(n=1000, rate=100.0, seed=13):
    """A press that is held from 2 to 9 s, on AnySkin."""
    rng, times = np.random.default_rng(seed), np.arange(n) / rate
    grip = np.interp(times, [0, 1.5, 2, 9, 9.4], [0, 0, 1, 1, 0])[:, None, None]
    zero = rng.uniform(150, 300, (5, 3)) * rng.choice([-1, 1], (5, 3))
    readings = zero + grip * SHARES[:, None] * [20, 5, 300] + rng.normal(size=(n, 5, 3))
    return times, readings, rng


def estimates(times, readings, which=None, **options):
    module = Tactile(which or sensor("anyskin"), times, readings)
    return detect(ANY, Recording("hold", {"thumb": module}), **options).fingers["thumb"]


SPOILED = {"zeros": 0.0, "spikes": 900.0}


@pytest.mark.parametrize("value", SPOILED.values(), ids=SPOILED)
@pytest.mark.parametrize("in_contact", [False, True])
def test_readings_of_one_sample_change_no_state(value, in_contact):
    times, readings, rng = still_hold()
    clean = estimates(times, readings, in_contact=in_contact)
    rows = rng.choice(np.arange(60, 1000, 3), 25, replace=False)
    readings[rows, rng.integers(5, size=25)] = value
    trace = estimates(times, readings, in_contact=in_contact)
    bits = trace.faults == 1 << list(Fault).index(Fault.INVALID)
    assert np.flatnonzero(bits).tolist() == sorted(rows)
    assert set(map(int, trace.faults[~bits])) == {0}
    assert (trace.state == STABLE).sum() == pytest.approx((clean.state == STABLE).sum(), abs=10)
    assert (trace.state[300:850] == STABLE).all()


def test_a_magnetometer_that_goes_on_sending_zeros_is_left_out():
    times, readings, _ = still_hold()
    readings[500:, 3] = 0
    trace = estimates(times, readings)
    assert (trace.faulty_taxels[500:, 0] == 8).all()
    assert (trace.state[500:890] == STABLE).all()


@pytest.mark.parametrize("name", ["anyskin", "uskin-4x4"])
@pytest.mark.parametrize(("start", "seconds"), [(0, 30), (400, 2)], ids=["always", "from 4 s"])
def test_a_stuck_axis_of_one_magnetometer_leaves_it_out(name, start, seconds):
    """No state changes by it. It is named after 2 s, or 30 s if it never changed before."""
    times, _, rng = still_hold(n=3500)
    which = sensor(name)
    grip = np.interp(times, [0, 1.5, 2, 34, 34.4], [0, 0, 1, 1, 0])[:, None, None]
    load = grip * np.resize(SHARES, which.n_taxels)[:, None] * [20, 5, 300]
    readings = np.rint(33_000 + load + rng.normal(scale=2, size=(3500, which.n_taxels, 3)))
    clean = estimates(times, readings, which)
    assert not clean.faults.any()
    readings[start:, 2, 1] = readings[start, 2, 1]
    trace = estimates(times, readings, which)
    named = np.flatnonzero(trace.faulty_taxels[:, 0] == 4)
    assert -0.15 < times[named[0]] - times[start] - seconds < 1.5
    assert {faults_of(mask) for mask in trace.faults[named].tolist()} == {(Fault.STUCK,)}
    assert len(named) == 3500 - named[0]  # until the end
    assert (trace.state[300:3350] == STABLE).all()
    assert (trace.state == STABLE).sum() == pytest.approx((clean.state == STABLE).sum(), abs=10)


def test_whole_counts_that_repeat_are_no_stuck_axis():
    """One magnetometer has little noise: its counts repeat, for up to a second."""
    times, readings, rng = still_hold(n=4000)
    readings = np.rint(readings)
    readings[:, 3, 0] = 200 + (rng.random(4000) < 0.02)
    assert not estimates(times, readings).faults.any()


def test_a_jump_that_stays_is_accepted_at_the_second_sample():
    times, readings, _ = still_hold()
    readings[500:, 3, 0] += 500
    assert np.flatnonzero(estimates(times, readings).faults).tolist() == [500]


def test_the_tare_takes_no_invalid_reading():
    times, readings, _ = still_hold()
    readings[7, 1] = 0
    model = Model.load("builtin:noise-floor")
    module = Tactile(sensor("anyskin"), times, readings)
    trace = detect(model, Recording("x", {"thumb": module})).fingers["thumb"]
    assert Tare.parse(model.tare).kind == "seconds"
    assert np.flatnonzero(trace.faults).tolist() == [7]
