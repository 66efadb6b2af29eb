"""Grippers that take a width."""

import math

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast_grip import FingerCommand, GripCommand, Limits, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.hands import open_hand

from .drivers import AH_NAMES, ROS2

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("domain")]

WIDTH = ROS2["width-gripper"].uri


def test_a_grip_that_would_close_beyond_the_end_is_refused(driver):
    driver(ROS2["width-gripper"])
    with open_hand(WIDTH.replace("stiffness=2000", "stiffness=70")) as hand:
        hand.check(Limits(max_scale=2.0), ["thumb"])
        with pytest.raises(HandError, match=r"0\.0571 m .*0\.053 m"):
            hand.send(GripCommand(1.0, LoopState.HOLD, {"thumb": FingerCommand(1.2)}))


def test_another_joint_is_refused(driver, impatient):
    driver(ROS2["width-gripper"], names=AH_NAMES)
    with pytest.raises(HandError, match="no joint finger_joint"):
        open_hand(WIDTH).open()


@pytest.mark.parametrize("position", [15.0, -0.05, math.nan])  # degrees, beyond its end
def test_a_reading_beyond_the_stroke_is_refused(driver, impatient, position):
    driver(ROS2["width-gripper"]).spoil(position, every=1)
    with pytest.raises(HandError, match=r"finger_joint at \S+, 0 to 0.8"):
        open_hand(WIDTH).open()
