"""Rigs of hands of ROS 1: master, drivers and hands are processes of their own."""

import json
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

from holdfast_grip.errors import HandError
from holdfast_grip.hands import open_hand
from ros.ros1_master import Master, needs_ros1

from .drivers import PATIENCE, ROS1
from .rigs import RosRig, with_parameter

PEER = Path(__file__).with_name("ros1_peer.py")


class Ros1World:
    """A master, a process with all drivers, and two processes for hands."""

    def __init__(self, folder):
        needs_ros1()
        self.master = Master(folder)
        self._drivers = self._start("drivers")
        self.processes = [self._start("hands"), self._start("hands")]
        self.messages, self._spoiled = [], threading.Event()
        n_topics = sum(len(driver.topics) for driver in ROS1.values())
        assert json.loads(self._drivers.stdout.readline()) == n_topics
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _start(self, what):
        return subprocess.Popen(
            [sys.executable, str(PEER), what], env=self.master.environment, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip

    def _read(self):
        for line in self._drivers.stdout:
            found = json.loads(line)
            if found == "spoiled":
                self._spoiled.set()
            else:
                self.messages.append(found)

    def spoil(self, position, every):
        """Let the drivers publish wrong joint states, and wait until they do."""
        self._spoiled.clear()
        self._drivers.stdin.write(json.dumps([position, every]) + "\n")
        self._drivers.stdin.flush()
        assert self._spoiled.wait(PATIENCE)

    def close(self):
        for process in (self._drivers, *self.processes):
            process.kill()
            process.wait()
        self._thread.join()
        for process in (self._drivers, *self.processes):
            process.stdin.close()
            process.stdout.close()
        self.master.close()


class Ros1Rig(RosRig):
    def __init__(self, world, name):
        self._world = world
        self._uri = with_parameter(ROS1[name].uri, f"master={world.master.uri}")
        super().__init__(DistantHand(self._uri, world.processes[0]), Ros1Driver(ROS1[name], world))

    @contextmanager
    def other_hand(self, *, standby=False):
        """A second hand of the same URI in another process, not yet open."""
        hand = DistantHand(self._uri, self._world.processes[1], standby=standby)
        yield hand
        hand.close()


class Ros1Driver:
    """The messages that a driver in another process gets."""

    def __init__(self, driver, world):
        self.driver, self._world = driver, world

    @property
    def messages(self):
        return self._world.messages

    def spoil(self, position, every=3):
        self._world.spoil(position, every)

    def wait(self, n):
        end = time.monotonic() + PATIENCE
        while len(self.messages) < n:
            assert time.monotonic() < end, f"{n} messages expected, {self.messages} came"
            time.sleep(0.002)
        return self.messages

    def close(self):
        pass


class DistantHand:
    """A hand in another process; what it raises there, it raises here."""

    def __init__(self, uri, process, *, standby=False):
        self.name = uri
        self.resource = open_hand(uri).resource
        self._process, self._standby = process, standby

    def __enter__(self):
        self.open()
        return self

    def __exit__(self, *_):
        self.close()

    def open(self):
        self._ask("open")

    def close(self):
        self._ask("close")

    def check(self, limits, fingers):
        self._ask("check", limits.max_scale, fingers)

    def send(self, command, *, repeat=False):
        scales = {name: str(one.scale) for name, one in command.fingers.items()}
        return self._ask("send", command.time, command.state, command.release, scales, repeat)

    @property
    def heartbeat(self):
        return self._ask("get", "heartbeat")

    @heartbeat.setter
    def heartbeat(self, value):
        self._ask("set", "heartbeat", value)

    @property
    def n_refused(self):
        return self._ask("get", "n_refused")

    def _ask(self, *words):
        self._process.stdin.write(json.dumps([self.name, self._standby, *words]) + "\n")
        self._process.stdin.flush()
        kind, answer = json.loads(self._process.stdout.readline())
        if kind:
            raise (ValueError if kind == "ValueError" else HandError)(answer)
        return answer
