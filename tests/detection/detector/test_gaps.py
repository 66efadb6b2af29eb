"""Gaps, jitter and losses, which features with windows in seconds bridge."""

import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, Reason
from holdfast.detection import Model, detect
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor

SENSOR = sensor("papillarray")
LOADED = np.array([0.05, -0.03, 0.2])
"""Force on each taxel of a finger that holds something [N]."""
PUSH = np.array([0.2, 0.0, 0.0])
"""Force of a push along the surface, on each taxel [N]."""
FIRST_HELD = 2.5
"""Time from which on the finger holds still [s]."""


def force_at(times, push=None):
    """(n, 3) forces of a grip that closes from 1.0 to 1.3 s, and perhaps of a later push."""
    force = np.clip((times - 1.0) / 0.3, 0, 1)[:, None] * LOADED
    if push is not None:
        force = force + np.clip((times - push) / 0.05, 0, 1)[:, None] * PUSH
    return force


def trace_of(times, name="builtin:any", push=None, noise=1e-3):
    """The estimates at some times of a finger that grips and holds still."""
    rng = np.random.default_rng(1)
    readings = force_at(times, push)[:, None, :] + rng.normal(0, noise, (len(times), 9, 3))
    recording = Recording("made", {"a": Tactile(SENSOR, times, readings, "N")})
    return detect(Model.load(name), recording).fingers["a"]


def with_gaps(rate, gap, seconds=6.0, every=0.4, seed=0):
    """Times at a rate, with gaps about as often as given."""
    rng, times, now = np.random.default_rng(seed), [], 0.0
    until = every
    while now < seconds:
        times.append(now)
        now += 1 / rate
        if now > until:
            now += gap - 1 / rate
            until = now + every * rng.uniform(0.5, 1.5)
    return np.array(times)


def jitter(low, high, seconds=6.0):
    """Times with steps of any length between two."""
    steps = np.random.default_rng(3).uniform(low, high, round(2 * seconds / (low + high)))
    return np.cumsum(steps)


STREAMS = {
    "500 Hz, 23 ms": with_gaps(500.0, 0.023),
    "1000 Hz, 23 ms": with_gaps(1000.0, 0.023),
    "150 Hz, 60 ms": with_gaps(150.0, 0.06),
    "60 Hz, 100 ms": with_gaps(60.0, 0.1),
    "30 Hz, 100 ms": with_gaps(30.0, 0.1),
    "3 to 24 ms": jitter(0.003, 0.024),
}


@pytest.mark.parametrize("name", STREAMS)
def test_a_quiet_hold_stays_stable(name):
    times = STREAMS[name]
    trace = trace_of(times)
    assert (trace.state[times > FIRST_HELD] == STABLE).all()
    assert (trace.state[1:] != UNKNOWN).all()
    assert np.isfinite(trace.stable_probability[1:]).all()


@pytest.mark.parametrize("gap", [0.023, 0.06, 0.1])
def test_a_push_within_a_gap_is_found_after_it(gap):
    times = np.arange(0, 6, 0.002)
    times = times[(times <= 4.0) | (times >= 4.0 + gap - 1e-9)]
    trace = trace_of(times, push=4.0)
    after = (times > 4.0) & (times < 4.0 + gap + 0.05)
    assert (trace.state[after] != STABLE).any()
    assert (trace.state[(times > FIRST_HELD) & (times <= 4.0)] == STABLE).all()


def test_a_longer_gap_begins_anew():
    times = np.arange(0, 6, 0.002)
    times = times[(times <= 4.0) | (times >= 4.12)]
    trace, first = trace_of(times), int(np.searchsorted(times, 4.1))
    gap = list(Reason).index(Reason.GAP)
    assert (trace.state[first], trace.reason[first]) == (UNKNOWN, gap)
    assert trace.state[first + 1] == STABLE


@pytest.mark.parametrize("name", ["slip_probability", "stable_probability"])
def test_an_even_motion_looks_the_same_at_other_times(name):
    """A slow and even motion is no slip where the times are uneven."""
    even, uneven = np.arange(0, 6, 1 / 60), STREAMS["3 to 24 ms"]
    found = []
    for times in (even, uneven):
        readings = force_at(times)[:, None, :] * (1 + 0.02 * np.clip(times - 2, 0, None))[
            :, None, None
        ] + np.random.default_rng(1).normal(0, 1e-3, (len(times), 9, 3))
        recording = Recording("made", {"a": Tactile(SENSOR, times, readings, "N")})
        trace = detect(Model.load("builtin:any"), recording).fingers["a"]
        found.append(getattr(trace, name)[times > FIRST_HELD])
    assert np.median(found[0]) == pytest.approx(np.median(found[1]), abs=0.05)
