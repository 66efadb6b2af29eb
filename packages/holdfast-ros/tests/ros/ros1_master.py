"""A ROS master for tests, and processes that use it."""

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from holdfast.errors import SourceError
from holdfast_ros import rospy_node

PEER = Path(__file__).parent / "ros1_peer.py"


def needs_ros1():
    """Skips where there is no ROS 1."""
    if shutil.which("rosmaster") is None:
        pytest.skip("rosmaster is not installed: apt install python3-rosmaster")
    found = subprocess.run(
        [sys.executable, "-c", f"from {rospy_node.__name__} import rospy_module as r; r()"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if found.returncode:
        pytest.skip("rospy is not installed for this Python: apt install python3-rospy")


class Master:
    """A master on a port of its own, and the processes of its nodes.

    `environment` is that of its nodes.
    """

    def __init__(self, folder):
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        self.uri = f"http://127.0.0.1:{self.port}"
        self.environment = {
            **{k: v for k, v in os.environ.items() if not k.startswith(("ROS", "PYTHONWARN"))},
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(folder),
            "PYTHONPATH": os.pathsep.join(path for path in sys.path if path.endswith("tests")),
        }
        self._children = []
        self._master = None
        self.start()

    def start(self):
        self._master = self._spawn(["rosmaster", "--core", "-p", str(self.port)])
        end = time.monotonic() + 60
        while True:
            with suppress(SourceError):
                return rospy_node.check_master(self.uri)
            assert time.monotonic() < end, "the master does not start"
            time.sleep(0.05)

    def stop(self):
        self._end(self._master)

    def peer(self, *arguments):
        return self._spawn([sys.executable, str(PEER), *map(str, arguments)])

    def close(self):
        for child in reversed(self._children):
            self._end(child)

    def _spawn(self, command):
        child = subprocess.Popen(
            command, env=self.environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        self._children.append(child)
        return child

    def _end(self, child):
        child.kill()
        child.wait()
        child.stdout.close()


@contextmanager
def running_master(folder):
    needs_ros1()
    master = Master(folder)
    try:
        yield master
    finally:
        master.close()


def lines(child):
    """What a process prints, as values; nothing else may be in it."""
    return (json.loads(line) for line in child.stdout)
