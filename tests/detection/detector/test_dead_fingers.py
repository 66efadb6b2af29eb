"""A finger whose readings never change is dead, and the hand is that of the others."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import ContactState, Fault, Reason, hand_state
from holdfast.detection import Detector, Tare

from . import naive
from .build import RATE, sensor
from .test_against_naive import same
from .test_detector import by_force

UNKNOWN, NO_CONTACT, _, STABLE = ContactState
TIP = replace(sensor(6, "tip"), rotations=np.broadcast_to(np.eye(3), (6, 3, 3)))
CONSTANTS = {"zeros": 0.0, "counts": 7.5, "at the limit": 1000.0, "out of range": -1.0}
N_DEAD = 50
"""Samples of half a second."""


def estimates(which=TIP, tare="0.2", **fingers):
    """Return the estimates of a hand, which are those of the naive detector too."""
    hand_model, sensors = by_force(tare=tare), dict.fromkeys(fingers, which)
    slow = naive.Hand(hand_model, sensors, Tare.parse(tare), RATE)
    detector, found = Detector(hand_model, sensors, RATE), []
    for k, samples in enumerate(zip(*fingers.values(), strict=True)):
        arrays = dict(zip(fingers, samples, strict=True))
        found.append(detector.update(arrays, k / RATE))
        same(found[-1], slow.update(arrays, k / RATE))
    return found


def grasp(seed=0, press=80.0):
    """Noise of 0.1, so that the sum of six taxels stays under the 5 of a contact."""
    values = 500 + np.random.default_rng(seed).normal(scale=0.1, size=(300, 6, 3))
    values[120:, :, 0] += press
    return values


@pytest.mark.parametrize("tare", ["0.2", "first"])
@pytest.mark.parametrize("value", CONSTANTS.values(), ids=CONSTANTS)
def test_the_hand_is_that_of_the_other_finger(value, tare):
    found = estimates(tare=tare, thumb=grasp(), index=np.full((300, 6, 3), value))
    index = [estimate.fingers["index"] for estimate in found]
    assert {finger.state for finger in index[: N_DEAD - 1]} <= {UNKNOWN, NO_CONTACT}
    assert {finger.state for finger in index[N_DEAD - 1 :]} == {UNKNOWN}
    assert [finger.is_dead for finger in index] == [False] * (N_DEAD - 1) + [True] * (301 - N_DEAD)
    for estimate in found[N_DEAD:]:
        assert estimate.state is estimate.fingers["thumb"].state
    assert {NO_CONTACT, STABLE} <= {estimate.state for estimate in found[N_DEAD:]}


@pytest.mark.parametrize(("n_alive", "expected"), [(0, UNKNOWN), (1, STABLE), (2, NO_CONTACT)])
def test_one_finger_holds_only_if_all_others_are_dead(n_alive, expected):
    """The first finger holds; a second one is open. Two hold, or there is one alone."""
    constant = np.full((300, 6, 3), 7.0)
    fingers = [grasp(), grasp(1, press=0.0)][:n_alive] + [constant] * (3 - n_alive)
    found = estimates(**dict(zip("abc", fingers, strict=True)))
    assert {estimate.state for estimate in found[130:]} == {expected}


def test_the_rule_of_the_kernel_is_that_of_python():
    rng, names = np.random.default_rng(0), ("a", "b", "c", "d")
    seen = set()
    for seed in range(12):
        presses, ends = rng.choice([0.0, 10.0, 80.0], 4), rng.choice([0, 0, 300, 200], 4)
        fingers = {name: grasp(4 * seed + k, presses[k]) for k, name in enumerate(names)}
        for values, end in zip(fingers.values(), ends, strict=True):
            values[:end] = 7.0
        detector = Detector(by_force(tare="0.2"), dict.fromkeys(names, TIP), RATE)
        for k in range(300):
            estimate = detector.update({name: own[k] for name, own in fingers.items()}, k / RATE)
            alive = [f.state.code for f in estimate.fingers.values() if not f.is_dead]
            code = hand_state(np.array(alive, dtype=np.int8), len(names), len(names) - len(alive))
            assert estimate.state.code == code
            seen.add((estimate.state, len(alive)))
    assert len(seen) >= 10


@pytest.mark.parametrize("value", [0.0, 7.0, 200.0])
def test_a_finger_that_is_plugged_in_is_alive_at_once_and_takes_a_new_tare(value):
    """Its constants were no zero: an open finger is never in contact."""
    values = grasp(press=0.0)
    values[:150] = value
    found = estimates(thumb=values)
    thumb = [estimate.fingers["thumb"] for estimate in found]
    assert [finger.faults for finger in thumb[149:151]] == [(Fault.DEAD,), ()]
    assert {finger.reason for finger in thumb[150:170]} == {Reason.TARE}
    assert {finger.state for finger in thumb[175:]} == {NO_CONTACT}
