"""A gripper behind an action of ros2_control, by its force: `--hand call:gripper_action:set_force`.

For `GripperActionController` (`control_msgs/action/GripperCommand`), and from ROS 2 Jazzy on for
`parallel_gripper_action_controller` (`ParallelGripperCommand`, with `max_effort_interface` set).
Plain DDS cannot call an action, so this needs rclpy: install holdfast into a Python that has it.
A controller that ignores the effort takes a width only: use `ros2:width-gripper`.

Every command is a goal, which replaces the one before, also that of MoveIt. When MoveIt sends its
next goal, the gripper is MoveIt's again: stop `holdfast hold` before.
"""

import math
import threading
from functools import cache
from typing import Any

import rclpy
from control_msgs.action import GripperCommand
from rclpy.action import ActionClient
from rclpy.node import Node

ACTION = "/gripper_controller/gripper_cmd"
"""Name of the action: of the controller, and its own."""
IS_PARALLEL = False
"""Whether its type is `ParallelGripperCommand`."""
JOINT = "finger_joint"
"""Name of the joint, for `ParallelGripperCommand`."""
START_FORCE, MAX_FORCE = 10.0, 30.0
"""Effort that MoveIt closes with, and the largest one [N]."""
OPEN, CLOSED = 0.08, 0.0
"""Positions of the open gripper, and of one that is closed beyond any object [m or rad]."""
FORCE_STEP = 0.5
"""Step in which the effort is commanded [N]: an action takes some tens of goals per second."""


def set_force(scale: float) -> None:
    """Command a multiple of the first force; 0 opens the gripper."""
    if scale == 0.0:
        gripper().send(OPEN, START_FORCE)
        return
    force = FORCE_STEP * math.ceil(START_FORCE * scale / FORCE_STEP)
    if force > MAX_FORCE:
        raise ValueError(f"at most {MAX_FORCE:g} N expected, {force:g} N given: lower --max-scale")
    gripper().send(CLOSED, force)


class ActionGripper(Node):
    """Client of the action, which sends a goal if it differs from the last one."""

    def __init__(self) -> None:
        super().__init__("holdfast_gripper")
        self._refusal = ""
        self._sent: tuple[float, float] | None = None
        self._client = ActionClient(self, action_type(), ACTION)
        if not self._client.wait_for_server(timeout_sec=5.0):
            raise RuntimeError(f"no action server {ACTION} in 5 s")

    def send(self, position: float, force: float) -> None:
        """Send a goal, and return at once."""
        if self._refusal:
            raise RuntimeError(self._refusal)
        if not self._client.server_is_ready():
            raise RuntimeError(f"the action server {ACTION} has ended")
        if (position, force) == self._sent:
            return
        self._sent = position, force
        self._client.send_goal_async(goal_of(position, force)).add_done_callback(self._check)

    def _check(self, answer: Any) -> None:  # noqa: ANN401 (a future of rclpy)
        """Keep the refusal of a goal for the next command."""
        if not answer.result().accepted:
            self._refusal = f"{ACTION} refused a goal: is its controller active?"


@cache
def gripper() -> ActionGripper:
    """Return the client, which is made at the first command and spins in a thread."""
    if not rclpy.ok():
        rclpy.init()
    node = ActionGripper()
    threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
    return node


def action_type() -> Any:  # noqa: ANN401 (a class of rclpy)
    """Return the type of the action."""
    if not IS_PARALLEL:
        return GripperCommand
    from control_msgs.action import ParallelGripperCommand

    return ParallelGripperCommand


def goal_of(position: float, force: float) -> Any:  # noqa: ANN401 (a message)
    """Return the goal that closes to a position with a force [N]."""
    goal = action_type().Goal()
    if IS_PARALLEL:
        goal.command.name = [JOINT]
        goal.command.position = [position]
        goal.command.effort = [force]
    else:
        goal.command.position = position
        goal.command.max_effort = force
    return goal
