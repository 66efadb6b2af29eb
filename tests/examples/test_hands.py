"""The templates of hands beyond the contract: ceilings, deadband and rate, width, actions.

The contract runs over the first two in `packages/holdfast-grip/tests/grip/hands/test_contract.py`.
"""

import math
import re
import sys
from types import ModuleType, SimpleNamespace

import pytest

from grip.hands.rigs import EXAMPLES, NewtonRig, WidthRig
from holdfast_grip import FingerCommand, GripCommand, Limits, LoopState
from holdfast_grip.errors import HandError


def command(scale, **changes):
    return GripCommand(1.0, LoopState.REACT, {"thumb": FingerCommand(scale)}, **changes)


@pytest.fixture
def rig(tmp_path):
    rig = NewtonRig(tmp_path)
    yield rig
    rig.close()


def test_a_change_within_the_deadband_waits_for_more(rig):
    rig.hand._period = 0.0
    with rig.hand as hand:
        sent = [hand.send(command(scale)) for scale in (1.0, 1.01, 1.02, 1.03)]
        assert sent == [True, False, False, True]
        assert rig.messages() == [{"thumb": 2.0}, {"thumb": pytest.approx(2.06)}]


def test_a_command_that_is_early_is_sent_later_and_a_release_at_once(rig):
    with rig.hand as hand:
        assert [hand.send(command(1.0)), hand.send(command(1.5))] == [True, False]
        hand._period = 0.0
        assert hand.send(command(1.5))
        hand._period = 1e3
        assert hand.send(command(1.5, release=True))
        assert rig.forces(3) == "open"


def test_the_highest_force_is_refused_before_arming_and_at_a_command(rig):
    with pytest.raises(ValueError, match="8 N given at max_scale 4"):
        rig.hand.check(Limits(max_scale=4.0), ["thumb"])
    rig.hand.check(Limits(max_scale=3.0), ["thumb"])
    with rig.hand as hand, pytest.raises(HandError, match=r"thumb: .* 8 N given"):
        hand.send(command(4.0))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start_force": 0.0}, "start_force"),
        ({"max_force": float("nan")}, "max_force"),
        ({"rate": -1.0}, "rate"),
        ({"deadband": 2.0}, "deadband"),
    ],
)
def test_a_number_out_of_range_is_refused(rig, changes, message):
    given = {"start_force": 2.0, "max_force": 6.0} | changes
    with pytest.raises(ValueError, match=re.escape(message)):
        type(rig.hand)(("127.0.0.1", 5005), **given)


class TestWidth:
    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"stiffness": 0.0}, "stiffness: "),
            ({"start_force": math.nan}, "start_force: "),
            ({"stroke": 80.0}, "stroke: "),
        ],
    )
    def test_a_number_out_of_range_is_refused(self, tmp_path, changes, message):
        rig = WidthRig(tmp_path)
        with pytest.raises(ValueError, match=f"width:: {message}"):
            rig.make("width:", rig, **(rig.numbers | changes))

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"max_force": 5.0}, "6 N given"),
            ({"stiffness": 40.0}, "0.1 m given"),
        ],
    )
    def test_it_is_checked_before_arming(self, tmp_path, changes, message):
        rig = WidthRig(tmp_path)
        with pytest.raises(ValueError, match=message):
            rig.make("width:", rig, **(rig.numbers | changes)).check(Limits(), ["thumb"])

    def test_a_width_that_leaves_no_room_is_refused(self, tmp_path):
        rig = WidthRig(tmp_path)
        with rig.make("width:", rig, **(rig.numbers | {"stiffness": 60.0})) as hand:
            hand.check(Limits(), ["thumb"])
            with pytest.raises(HandError, match=r"0.0667 to 0.08 m at the beg.*, 0.06 m given"):
                hand.send(command(1.0))
        assert not rig.moves


class FakeAction:
    """Stand-in for an action client of rclpy, which keeps the goals."""

    goals, is_ready, accepts = (), True, True

    def __init__(self, node, kind, name):
        type(self).goals = []
        assert (kind.name, name) in {
            ("GripperCommand", "/gripper_controller/gripper_cmd"),
            ("ParallelGripperCommand", "/gripper_controller/gripper_cmd"),
        }

    def wait_for_server(self, timeout_sec):
        return self.is_ready

    def server_is_ready(self):
        return self.is_ready

    def send_goal_async(self, goal):
        self.goals.append(vars(goal.command))
        answer = SimpleNamespace(result=lambda: SimpleNamespace(accepted=self.accepts))
        return SimpleNamespace(add_done_callback=lambda check: check(answer))


class FakeNode:
    def __init__(self, name):
        self.name = name


def action_kind(kind):
    goal = staticmethod(lambda: SimpleNamespace(command=SimpleNamespace()))
    return type(kind, (), {"name": kind, "Goal": goal})


@pytest.fixture
def action_gripper(monkeypatch):
    """The functions of the example, with stand-ins for ROS."""
    kinds = {kind: action_kind(kind) for kind in ("GripperCommand", "ParallelGripperCommand")}
    client = type("Client", (FakeAction,), {})
    packages = {
        "rclpy": {"ok": lambda: True, "spin": lambda node: None},
        "rclpy.action": {"ActionClient": client},
        "rclpy.node": {"Node": FakeNode},
        "control_msgs": {},
        "control_msgs.action": kinds,
    }
    for name, members in packages.items():
        module = ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    example = ModuleType("gripper_action")
    source = EXAMPLES / "hands" / "gripper_action.py"
    exec(compile(source.read_text("utf-8"), str(source), "exec"), vars(example))
    example.client = client
    return example


class TestAction:
    def test_each_new_force_is_a_goal(self, action_gripper):
        for scale in (1.0, 1.01, 1.02, 1.5, 0.0):
            action_gripper.set_force(scale)
        assert action_gripper.client.goals == [
            {"position": 0.0, "max_effort": 10.0},
            {"position": 0.0, "max_effort": 10.5},
            {"position": 0.0, "max_effort": 15.0},
            {"position": 0.08, "max_effort": 10.0},
        ]

    def test_a_parallel_gripper(self, action_gripper):
        action_gripper.IS_PARALLEL = True
        action_gripper.set_force(2.0)
        assert action_gripper.client.goals == [
            {"name": ["finger_joint"], "position": [0.0], "effort": [20.0]}
        ]
