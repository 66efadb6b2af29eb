"""Estimates that are fed to the guided protocol, without a source or a detector."""

import numpy as np

from holdfast.contact import ContactEstimate, ContactState, HandEstimate, Reason
from holdfast.devices.sources import Arrival
from holdfast.live.stream_detector import StreamEstimate, StreamUpdate
from holdfast.live.teaching.protocol import GuidedProtocol, Stage
from holdfast.live.teaching.steps import Check, Step
from holdfast.sensors import sensor

PERIOD = 0.01
FREE, STILL, MOVED = ContactState.NO_CONTACT, ContactState.STABLE, ContactState.UNSTABLE
SENSORS = {"thumb": sensor("anyskin"), "index": sensor("anyskin")}


def step(check, name="hold", seconds=4.0, **fields):
    return Step(name, f"{name.upper()} IT", "How.", check, seconds, **fields)


class Feeder:
    """Hand whose estimates go into a protocol, some at a time."""

    def __init__(self, *steps, done=(), at_once=1):
        self.protocol = GuidedProtocol(SENSORS, done, steps)
        self.time = 0.0
        self.markers = []
        self.at_once = at_once
        self.random = np.random.default_rng(0)

    def feed(self, seconds, state=FREE, force=(100.0, 0.0, 0.0), noise=1.0):
        """Feed as many estimates as the time has, until the stage changes."""
        before, waiting = self.protocol.stage, []
        for k in range(round(seconds / PERIOD)):
            self.time += PERIOD
            fingers = {
                name: ContactEstimate(self.time, state, Reason.NONE, 0.9, 1.0, force)
                for name in SENSORS
            }
            samples = {name: 100 + noise * self.random.standard_normal((5, 3)) for name in SENSORS}
            estimate = StreamEstimate(HandEstimate(self.time, state, fingers), tuple(SENSORS))
            waiting.append((Arrival(self.time, samples, self.time), estimate))
            if len(waiting) < self.at_once and k + 1 < round(seconds / PERIOD):
                continue
            for arrival, own in waiting:
                self.markers += self.protocol.put(StreamUpdate(arrival, [own], []))
            waiting.clear()
            if self.protocol.stage is not before:
                break
        return self.protocol.stage

    def until(self, stage, state=FREE, seconds=59.0, **fields):
        """Feed until a stage is reached."""
        end = self.time + seconds
        while self.protocol.stage is not stage and self.time < end:
            self.feed(1.0, state, **fields)
        assert self.protocol.stage is stage

    def grasp(self, *parts):
        """Feed a grasp up to its check; in ACT its (seconds, state, force), again."""
        self.until(Stage.GRASP)
        self.until(Stage.ACT, STILL)
        while self.protocol.stage is Stage.ACT:
            for seconds, state, force in parts or ((1.0, STILL, (100.0, 0.0, 0.0)),):
                self.feed(seconds, state, force)
        self.until(Stage.CHECK)
        return self.protocol


HEALTH = step(Check.HEALTH, "open")
HOLD = step(Check.FELT)
PULL = step(Check.SLID, "pull", n_actions=4, n_grasps=2)
