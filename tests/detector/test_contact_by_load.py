"""Contact by the load of the stream, as `builtin:any` decides it."""

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE
from holdfast.detector import detect
from holdfast.model import Model
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor

RATE = 100.0
SENSOR = sensor("papillarray")
LOADED = np.array([0.05, -0.03, 0.2])
"""Force on each taxel of a finger that holds something [N]."""


def states_of(forces, noise=1e-3, seed=0):
    """Codes of the states, for (n, 3) the force on each taxel."""
    rng = np.random.default_rng(seed)
    readings = np.asarray(forces)[:, None, :] + rng.normal(0, noise, (len(forces), 9, 3))
    module = Tactile(SENSOR, np.arange(len(forces)) / RATE, readings, "N")
    recording = Recording("made", {"a": module})
    return detect(Model.load("builtin:any"), recording).fingers["a"].state


def steps(*parts):
    """(n, 3) forces, from (seconds, share of the load at the end) with straight lines between."""
    shares, last = [], parts[0][1]
    for seconds, share in parts:
        shares.append(np.linspace(last, share, round(seconds * RATE), endpoint=False))
        last = share
    return np.concatenate(shares)[:, None] * LOADED


def test_an_empty_finger_is_without_contact():
    states = states_of(np.zeros((2000, 3)))
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
