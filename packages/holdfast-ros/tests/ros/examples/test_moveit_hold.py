"""The example of a hand-over from MoveIt, with a gripper on the topics of a controller."""

import runpy
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast.io import save_recording
from holdfast.io.cdr import MessageEncoder
from holdfast.synthetic import synthetic_recording
from holdfast_ros import dds
from holdfast_ros.topic_messages import JOINT_TRAJECTORY, topic_definition, trajectory_message
from ros.hands.drivers import PATIENCE, POSITIONS, ROS2, Ros2Driver, width_meaning

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[5] / "examples" / "ros2" / "moveit_hold.py"
DRIVER = ROS2["width-gripper"]
# Tests share their machine, so heartbeats may be late.
PROGRAM = """#!{python}
import sys
from holdfast.cli import main
from holdfast_grip.loop import watchdog
watchdog.Watchdog.__init__.__defaults__ = (300.0,)
sys.exit(main())
"""


@pytest.fixture
def example():
    found = SimpleNamespace(**runpy.run_path(str(EXAMPLE)))
    found.Hold.start.__globals__["BEGIN_TIMEOUT"] = 5 * PATIENCE
    return found


@pytest.fixture
def gripper(tmp_path, monkeypatch, domain):
    """A gripper that is closed."""
    program = tmp_path / "holdfast"
    program.write_text(PROGRAM.format(python=sys.executable), encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    peer = Ros2Driver(DRIVER, domain)
    yield peer
    peer.close()


@pytest.fixture
def grasp(tmp_path):
    path = tmp_path / "grasp.parquet"
    save_recording(synthetic_recording("grasp", 1), path)
    return str(path)


def moveit(domain):
    """A function that commands a position, as the controller does for a goal of MoveIt."""
    definition = topic_definition(JOINT_TRAJECTORY)
    write = dds.Node(domain).writer("/gripper/joint_trajectory", definition)
    encode = MessageEncoder(definition)
    return lambda position: write(encode(trajectory_message(["finger_joint"], [position])))


def test_the_grip_is_taken_over_and_given_back(example, gripper, grasp):
    with example.Hold("builtin:twin", grasp, DRIVER.uri, "--max-scale", "2.5") as hold:
        assert hold.state in ("HOLD", "REACT", "RELAX")
        (first, *_) = gripper.wait(1)
        assert first[1]["points"][0]["positions"][0] == pytest.approx(POSITIONS[0], abs=1e-3)
    time.sleep(0.1)
    n = len(gripper.messages)
    assert all(1.0 <= one <= 2.5 for one in map(scale, gripper.messages))
    command = moveit(dds.domain_number(None))
    end = time.monotonic() + PATIENCE
    while len(gripper.messages) == n and time.monotonic() < end:
        command(0.0)
        time.sleep(0.05)
    time.sleep(0.3)
    assert all(scale(message) == "open" for message in gripper.messages[n:])  # it is MoveIt's again


def scale(message):
    return width_meaning(list(message[1]["points"][0]["positions"]), 4.0, 2000.0)
