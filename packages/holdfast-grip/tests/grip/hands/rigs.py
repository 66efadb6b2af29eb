"""Hands for the tests of the contract: each with what tells which forces it has."""

import json
import runpy
import socket
import sys
from contextlib import suppress
from pathlib import Path

import msgspec

from holdfast_grip import GripCommand
from holdfast_grip.hands import open_hand
from holdfast_grip.hands.live_twin import LiveTwin

taken = []
EXAMPLES = Path(__file__).parents[5] / "examples"
NAMES = ["twin", "log", "call", "newtons", "width"]


class TwinRig:
    """The twin."""

    per_finger, driver = True, None
    fingers = ("thumb", "index", "middle", "ring")

    def __init__(self, folder):
        self.hand, self._n = LiveTwin("twin:?object=ball", speed=0), 0
        send = self.hand._send

        def count(command):
            send(command)
            self._n += 1

        self.hand._send = count

    def start(self):
        self._n = 0

    def forces(self, n):
        assert self._n == n
        if self.hand.simulation.protocol.is_released(self.hand.simulation.time + 1e-6):
            return "open"
        return dict(zip(self.fingers, self.hand._scales.tolist(), strict=True))

    def close(self):
        self.hand.close()


class LogRig:
    """A file."""

    per_finger, fingers, driver = True, None, None

    def __init__(self, folder):
        self._path = folder / "hand"
        self.hand = open_hand(f"log:{self._path}")

    def start(self):
        self._path.unlink(missing_ok=True)

    def forces(self, n):
        lines = self._path.read_bytes().splitlines()
        assert len(lines) == n
        last = msgspec.json.decode(lines[-1], type=GripCommand)
        return "open" if last.release else {k: one.scale for k, one in last.fingers.items()}

    def close(self):
        self.hand.close()


class CallRig:
    """A function of Python."""

    per_finger, fingers, driver = False, None, None

    def __init__(self, folder):
        sys.modules["holdfast_test_rigs"] = sys.modules[__name__]
        self.hand = open_hand("call:holdfast_test_rigs:take")

    def start(self):
        taken.clear()

    def forces(self, n):
        assert len(taken) == n
        return taken[-1] or "open"

    def close(self):
        self.hand.close()


def take(scale):
    taken.append(scale)


class NewtonRig:
    """The template of `examples/hands`, with a socket on the other side."""

    per_finger, driver = True, None
    fingers = ("thumb", "index", "middle", "ring")

    def __init__(self, folder, rate=1e-3):
        template = runpy.run_path(str(EXAMPLES / "hands" / "newton_hand.py"))
        self._peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._peer.bind(("127.0.0.1", 0))
        self._peer.setblocking(False)
        self._received = []
        self.hand = template["NewtonHand"](
            self._peer.getsockname(), start_force=2.0, max_force=6.0, rate=rate
        )

    def start(self):
        self.messages()
        self._received.clear()
        self.hand.heartbeat = None

    def messages(self):
        with suppress(BlockingIOError):
            while True:
                self._received.append(json.loads(self._peer.recv(1000)))
        return self._received

    def forces(self, n):
        messages = self.messages()
        assert len(messages) == n, messages
        last = messages[-1]
        return {k: force / 2.0 for k, force in last.items()} if any(last.values()) else "open"

    def close(self):
        self.hand.close()
        self._peer.close()


class WidthRig:
    """The template of a gripper by width: 60 mm when the grip begins, 0.1 mm for each 0.1 N."""

    per_finger, fingers, driver = False, None, None

    def __init__(self, folder):
        template = runpy.run_path(str(EXAMPLES / "hands" / "width_gripper.py"))
        self.make, self.moves = template["WidthGripper"], []
        self.numbers = {"start_force": 2.0, "stiffness": 1e3, "stroke": 0.08, "max_force": 6.0}
        self.hand = self.make("width:", self, **self.numbers)

    def width(self):
        return 0.06

    def move(self, width):
        self.moves.append(width)

    def start(self):
        self.moves.clear()
        self.hand.heartbeat = None

    def forces(self, n):
        assert len(self.moves) == n
        last = self.moves[-1]
        return "open" if last == 0.08 else 1.0 + 1e3 * (0.06 - last) / 2.0

    def close(self):
        self.hand.close()


class Rigs:
    """Rigs by name; each is made when it is needed, and reused."""

    def __init__(self, new_folder):
        self._new_folder = new_folder
        self._made = {}

    def __call__(self, name):
        if name not in self._made:
            self._made[name] = self._new(name)
        self._made[name].start()
        return self._made[name]

    def _new(self, name):
        kinds = {"twin": TwinRig, "log": LogRig, "call": CallRig, "newtons": NewtonRig}
        return {**kinds, "width": WidthRig}[name](self._new_folder())

    def close(self):
        for rig in self._made.values():
            rig.close()
