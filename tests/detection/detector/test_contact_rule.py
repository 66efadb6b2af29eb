"""Contact by F_a: drift of an empty finger, and the skin after a release."""

import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.detection import Detector

from .build import RATE, feed, model, sensor

UNKNOWN, NO_CONTACT, UNSTABLE, STABLE = ContactState
WHICH = sensor(1, limits=None)
THRESHOLD = 100.0


def states_of(forces, seed=0):
    """States of a finger with one taxel, for (n,) its normal force."""
    rng = np.random.default_rng(seed)
    values = rng.normal(0.0, 5.0, (len(forces), 1, 3))
    values[:, 0, 2] += forces
    hand_model = model(("thumb",), which=WHICH, threshold=THRESHOLD, window=14)
    return [e.state for e in feed(Detector(hand_model), values)]


def relaxing(share, seconds=6.0, grip=2000.0):
    """A grip of 5 s, from 1 s on, then a load that decays slowly from a share of the grip."""
    after = share * grip * np.exp(-np.arange(round(seconds * RATE)) / RATE / 4.0)
    return np.concatenate([np.zeros(100), np.full(500, grip), after])


@pytest.mark.parametrize("share", [0.04, 0.07])
def test_a_skin_that_relaxes_after_a_release_is_no_contact(share):
    forces = relaxing(share)
    states = states_of(forces)
    assert NO_CONTACT not in states[105:600]
    assert forces[640] > 0.6 * THRESHOLD
    assert set(states[640:]) == {NO_CONTACT}


def test_a_hold_at_a_quarter_of_the_grip_is_contact():
    states = states_of(np.concatenate([np.zeros(100), np.full(500, 2000.0), np.full(600, 500.0)]))
    assert not {NO_CONTACT, UNKNOWN} & set(states[105:])


def test_an_empty_finger_that_drifts_far_is_no_contact():
    drift = np.linspace(0.0, 8.0 * THRESHOLD, round(60 * RATE))
    assert set(states_of(drift)[40:]) == {NO_CONTACT}


def test_a_skin_that_relaxes_is_not_stable_before_it_rests():
    """8800 counts are released, and 1.4 % stay, which is above the threshold."""
    rest = 1.2 * THRESHOLD
    force = [np.zeros(100), np.full(400, 8800.0), np.linspace(8800.0, rest, 20), np.full(300, rest)]
    states = states_of(np.concatenate(force))
    assert STABLE not in states[525:]
    assert set(states[560:]) == {NO_CONTACT}
