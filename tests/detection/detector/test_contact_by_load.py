"""Contact by the load of the stream, as `builtin:any` decides it."""

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE
from holdfast.detection import Model, detect
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor

RATE = 100.0
SENSOR = sensor("papillarray")
LOADED = np.array([0.05, -0.03, 0.2])
"""Force on each taxel of a finger that holds something [N]."""


def states_of(forces, noise=1e-3, seed=0):
    """Codes of the states, for (n, 3) the force on each taxel."""
    return detect(Model.load("builtin:any"), recording_of(forces, noise, seed)).fingers["a"].state


def recording_of(forces, noise=1e-3, seed=0):
    rng = np.random.default_rng(seed)
    readings = np.asarray(forces)[:, None, :] + rng.normal(0, noise, (len(forces), 9, 3))
    module = Tactile(SENSOR, np.arange(len(forces)) / RATE, readings, "N")
    return Recording("made", {"a": module})


def steps(*parts):
    """(n, 3) forces, from (seconds, share of the load at the end) with straight lines between."""
    shares, last = [], parts[0][1]
    for seconds, share in parts:
        shares.append(np.linspace(last, share, round(seconds * RATE), endpoint=False))
        last = share
    return np.concatenate(shares)[:, None] * LOADED


@pytest.mark.parametrize("drift", [0.0, 0.3])
def test_an_empty_finger_is_without_contact(drift):
    states = states_of(steps((1, 0), (60, drift)))
    assert (states[1:] == NO_CONTACT).all()


def test_a_steady_hold_is_stable_and_its_release_is_not():
    states = states_of(steps((1, 0), (0.3, 1), (5, 1), (0.2, 0), (3, 0)))
    assert (states[1:100] == NO_CONTACT).all()
    assert (states[250:630] == STABLE).all()
    assert (states[710:] == NO_CONTACT).all()


@pytest.mark.parametrize("echo", [0.0, 0.04])
def test_a_tare_under_load_ends_with_the_release(echo):
    states = states_of(steps((3, 1), (0.2, echo), (3, echo), (0.3, 1), (3, 1)))
    assert (states[380:620] == NO_CONTACT).all()
    assert (states[800:] == STABLE).all()


def test_a_tare_under_load_is_in_contact_while_the_force_moves():
    sway = 1 + 0.3 * np.sin(2 * np.pi * 0.8 * np.arange(800) / RATE)
    states = states_of(sway[:, None] * LOADED)
    assert (states[30:] != NO_CONTACT).all()


@pytest.mark.parametrize("rest", [0.0, 0.02, 0.06])
def test_a_finger_is_not_stable_once_its_force_has_gone(rest):
    states = states_of(steps((1, 0), (0.3, 1), (4, 1), (0.2, rest), (2, rest)))
    assert (states[250:530] == STABLE).all()
    gone = round(RATE * 5.5)
    assert (states[gone:] != STABLE).all()
    assert (states[gone + 45 :] == NO_CONTACT).all()


CLOSED = ((1, 0), (0.3, 1), (12, 1))
OPENED = {
    "9 % that creep": ((0.2, 0.09), (1, 0.07), (4, 0.06)),
    "14 % after a long hold": ((0.2, 0.14), (4, 0.12)),
    "4 % that stay for longer than the peak": ((0.2, 0.07), (1, 0.05), (2, 0.04), (40, 0.04)),
    "7 % that drift to 9": ((0.2, 0.07), (10, 0.09)),
    "4 % that drift to 30": ((0.2, 0.04), (60, 0.3)),
}
HELD = {
    "15 % at once": ((0.2, 0.15), (8, 0.15)),
    "10 % in 3 s": ((3, 0.1), (8, 0.1)),
    "10 % by two motions": ((0.1, 0.3), (1, 0.3), (0.1, 0.1), (8, 0.1)),
}
AGAIN = {
    "a lighter grip": ((0.2, 0), (1, 0), (0.2, 0.15), (2, 0.15)),
    "a press on what is left": ((0.2, 0.07), (8, 0.04), (8, 0.15)),
}


@pytest.mark.parametrize("name", OPENED)
def test_what_a_release_leaves_is_no_contact_to_the_end(name):
    states = states_of(steps(*CLOSED, *OPENED[name]))
    assert (states[1350 + 50 :] == NO_CONTACT).all()


@pytest.mark.parametrize("name", HELD)
def test_a_grip_that_is_loosened_is_held(name):
    states = states_of(steps(*CLOSED, *HELD[name]))
    assert (states[150:] != NO_CONTACT).all()


@pytest.mark.parametrize("name", AGAIN)
def test_a_touch_after_a_release_rises_from_what_that_left(name):
    states = states_of(steps(*CLOSED, *AGAIN[name]))
    assert NO_CONTACT in states[1350:1450]
    assert (states[-100:] == STABLE).all()


def test_shear_that_draws_the_normal_force_down_is_held():
    """As a magnetic skin: the shear grows, and its normal readings fall at some taxels."""
    n = round(6 * RATE)
    rng = np.random.default_rng(3)
    grown = np.clip(np.arange(n) / RATE, 0, 1)[:, None, None]
    force = np.zeros((9, 3))
    force[:, 0], force[:6, 2], force[6:, 2] = 0.3, -0.05, 0.08
    readings = grown * force + rng.normal(0, 1e-3, (n, 9, 3))
    recording = Recording("sheared", {"a": Tactile(SENSOR, np.arange(n) / RATE, readings, "N")})
    states = detect(Model.load("builtin:any"), recording).fingers["a"].state
    assert (states[150:] == STABLE).all()


def test_a_finger_that_touches_is_unstable_at_first():
    states = states_of(steps((1, 0), (1, 0.06), (2, 0.06)))
    first = int(np.argmax(states[1:] != NO_CONTACT)) + 1
    assert 100 <= first < 200
    assert (states[first : first + 10] == UNSTABLE).all()
    assert (states[330:] == STABLE).all()


@pytest.mark.parametrize(("share", "noise"), [(0.4, 1e-3), (1.8, 1e-3), (0.3, 8e-3)])
def test_a_force_of_which_a_large_share_comes_or_goes_at_once_is_unstable(share, noise):
    """The classifier of stability alone may call it stable, as it learns from slips."""
    states = states_of(steps((1, 0), (0.3, 1), (4, 1), (0.1, share), (2, share)), noise)
    assert (states[250:525] == STABLE).all()
    assert (states[538:545] == UNSTABLE).all()
    assert (states[600:] == STABLE).all()


POLES = np.array([400, -600, 480, -480, 200.0])
"""Normal readings of five magnets of alternating poles in a press: their sum is 0 [uT]."""


def poles(shares, signs, seed=0):
    """Readings of a skin in a press of these shares, and the states of their finger."""
    rng = np.random.default_rng(seed)
    normals = (np.abs(POLES) * signs)[:, None] * [0.05, -0.03, 1.0]
    readings = rng.uniform(-300, 300, (5, 3)) + shares[:, None, None] * normals
    readings += rng.normal(0, 1, readings.shape)
    module = Tactile(sensor("anyskin"), np.arange(len(shares)) / RATE, readings)
    recording = Recording("made", {"a": module})
    return readings, detect(Model.load("builtin:any"), recording).fingers["a"].state


@pytest.mark.parametrize("signs", [np.sign(POLES), np.ones(5)], ids=["alternating", "alike"])
def test_magnets_of_alternating_poles_are_in_contact(signs):
    _, states = poles(np.interp(np.arange(1000) / RATE, [2, 2.4, 8, 8.4], [0, 1, 1, 0]), signs)
    assert (states[1:195] == NO_CONTACT).all()
    assert (states[300:750] == STABLE).all()
    assert (states[900:] == NO_CONTACT).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_load_of_turned_taxels_is_their_root_of_squares(seed):
    """A slow twin: contact while the root of the sum of squares is over ten times its noise."""
    shares = np.interp(np.arange(900) / RATE, [1, 1.4, 4, 4.4, 6, 6.4], [0, 1, 1, 0, 0, 0.1])
    readings, states = poles(shares, np.sign(POLES), seed)
    beyond = readings - readings[0]
    load = np.sqrt([sum(float(v @ v) for v in taxels) for taxels in beyond])
    steps = np.array([sum(float(v @ v) for v in taxels) for taxels in np.diff(beyond, axis=0)])
    noise = min(np.sqrt(steps[first : first + 20].mean() / 2) for first in range(0, 880, 20))
    touched = int(np.argmax(load > 100 * noise))
    assert (states[touched + 5 : 400] != NO_CONTACT).all()
    # A lighter touch than that of the grip, whose peak is forgotten with 5 s.
    assert load[640:].min() > 20 * noise
    limit = np.maximum(10 * noise, 0.12 * load.max() * np.exp(-(np.arange(900) - 400) / RATE / 5))
    clear = np.abs(load / limit - 1) > 0.1
    expected = (load > limit)[680:]
    assert ((states[680:] != NO_CONTACT) == expected)[clear[680:]].all()
