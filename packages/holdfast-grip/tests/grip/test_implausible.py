"""Readings that no skin gives: a grip ends in FAULT, and an open hand begins none."""

from typing import NamedTuple

import numpy as np
import pytest

from holdfast.detection import Detector, Model
from holdfast.sensors import sensor
from holdfast_grip import GripController, Limits, LoopState
from holdfast_grip.hands.base import HandDevice
from holdfast_grip.loop.grip_loop import GripLoop

RATE, SKIN, START, N = 100, sensor("anyskin"), 700, 1300
TIMES = np.arange(N) / RATE
REACTION = 0.5
"""Time from the detection of a fault to FAULT [s]."""


class Tape(HandDevice):
    """Hand that keeps its commands."""

    name, heartbeat, needs_idle = "tape:", 0.0, True

    def __init__(self):
        self.commands = []

    def open(self):
        pass

    def _send(self, command):
        self.commands.append(command)

    def close(self):
        pass


def grasp():
    """Readings of two fingers, open for 2 s, then in a hold with a slow sway, to 0.01 uT."""
    hand = {}
    for seed, name in enumerate(("thumb", "index")):
        rng = np.random.default_rng(seed)
        grip = np.interp(TIMES, [2, 2.4], [0, 1]) * (1 + 0.01 * np.sin(3 * TIMES + seed))
        shares = np.array([0.5, 0.8, 1.0, 0.6, 0.4])[:, None] * [18, -12, 400]
        zero = rng.uniform(-300, 300, (5, 3))
        noise = rng.normal(scale=2, size=(N, 5, 3))
        hand[name] = np.round(zero + grip[:, None, None] * shares + noise, 2)
    return hand


def ring(hand, period, toggles=False):
    last = hand["index"][START - period : START]
    hand["index"][START:] = np.resize(last, hand["index"][START:].shape)
    if toggles:
        hand["index"][START:, 4, 1] += np.random.default_rng(9).integers(0, 2, N - START)


def equal_taxels(hand):
    hand["index"][START:, 3] = hand["index"][START:, 2]


def frozen_axis(hand):
    hand["index"][START:, :, 1] = hand["index"][START, :, 1]


def equal_axes(hand):
    hand["index"][START:, :, 1] = hand["index"][START:, :, 0]


def copied(hand):
    hand["index"][START:] = hand["thumb"][START:]


def last_bit(hand):
    """All is frozen but the last digit, which toggles."""
    bits = np.random.default_rng(9).integers(0, 2, (N - START, 5, 3))
    hand["index"][START:] = hand["index"][START] + bits / 100


def jump(hand, size):
    hand["index"][START:, 3, 1] += size


def rezeroed(hand, *fingers):
    """The drivers take differences, and a new baseline in the grip."""
    for name in fingers:
        readings = hand[name]
        readings -= np.rint(readings[:50].mean(axis=0))
        readings[START:] -= np.rint(readings[START - 5 : START].mean(axis=0))


class Row(NamedTuple):
    """Fault of the readings from `START` on, and the time after which a law detects it [s]."""

    spoil: object
    arguments: tuple = ()
    detected: float = 1.0


ROWS = {
    "ring of 30": Row(ring, (30,), 0.6),
    "ring of 100": Row(ring, (100,), 2.0),
    "ring of 200": Row(ring, (200,), 4.0),
    "ring with a toggling taxel": Row(ring, (100, True), 2.0),
    "equal taxels": Row(equal_taxels),
    "frozen axis": Row(frozen_axis),
    "equal axes": Row(equal_axes),
    "copied": Row(copied),
    # Squares of changes fall to a hundredth in 1.2 s, and are compared each 0.25 s.
    "last bit": Row(last_bit, (), 1.5),
    "jump by a byte": Row(jump, (256,), 0.02),
    "jump by two bytes": Row(jump, (-65536,), 0.02),
    "far jump": Row(jump, (9830,), 0.02),
    "new baseline": Row(rezeroed, ("thumb", "index"), 0.02),
    "new baseline of one finger": Row(rezeroed, ("index",), 0.02),
}


def held(hand, armed=True):
    """States of a loop that gets these readings, and what its hand was sent."""
    tape, sensors = Tape(), dict.fromkeys(hand, SKIN)
    detector = Detector(Model.load("builtin:any"), sensors, RATE)
    controller = GripController(Limits(), sensors=sensors, newtons_per_unit=1e-3)
    states = []
    with GripLoop(controller, tape, armed=armed) as loop:
        for k, time in enumerate(TIMES.tolist()):
            estimate = detector.update({name: x[k] for name, x in hand.items()}, time)
            states.append(loop.step(estimate, time).state)
    return states, tape.commands


def test_a_healthy_hold_goes_on():
    states, _ = held(grasp())
    assert states[START] is states[-1] is LoopState.HOLD
    assert LoopState.FAULT not in states


@pytest.mark.parametrize("row", ROWS.values(), ids=ROWS)
def test_a_grip_on_readings_that_no_skin_gives_ends_in_a_fault(row):
    hand = grasp()
    row.spoil(hand, *row.arguments)
    states, commands = held(hand)
    assert states[START - 1] is LoopState.HOLD
    latest = START + round((row.detected + REACTION) * RATE)
    assert set(states[latest:]) == {LoopState.FAULT}
    scales = [{one.scale for one in x.fingers.values()} for x in commands if x.time > TIMES[latest]]
    assert all(scale == scales[0] for scale in scales)
