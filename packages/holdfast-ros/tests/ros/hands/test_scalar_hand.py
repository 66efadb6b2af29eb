"""Grippers that take a width."""

import math

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast_grip import FingerCommand, GripCommand, Limits, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.hands import open_hand

from .drivers import AH_NAMES, POSITIONS, ROS2

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("domain")]

COMMAND = GripCommand(1.0, LoopState.HOLD, {"thumb": FingerCommand(1.2)})


class TestWidth:
    """A gripper that takes a width; its joint is open at 0 rad, and at 0.8 rad closed by 80 mm."""

    uri = ROS2["width-gripper"].uri
    begin = 0.08 * (0.8 - POSITIONS[0]) / 0.8

    def send(self, driver, scale, uri="", **changes):
        """The width that a scale commands [m]."""
        peer = driver(ROS2["width-gripper"], **changes)
        with open_hand(self.uri + uri) as hand:
            hand.check(Limits(max_scale=2.0), ["thumb"])
            hand.send(GripCommand(1.0, LoopState.REACT, {"thumb": FingerCommand(scale)}))
            ((_, message),) = peer.wait(1)
        assert message["joint_names"] == ["finger_joint"]
        return 0.08 * (0.8 - message["points"][0]["positions"][0]) / 0.8

    def test_a_stiff_gripper_begins_at_the_width_that_it_has(self, driver):
        assert self.send(driver, 1.0) == pytest.approx(self.begin)

    def test_each_newton_more_is_narrower_by_the_stiffness(self, driver):
        assert self.begin - self.send(driver, 2.0) == pytest.approx(4.0 / 2000)

    def test_the_gain_keeps_the_first_force_of_a_soft_gripper(self, driver):
        narrower = self.begin - self.send(driver, 2.0, "&gain=4000")
        assert narrower == pytest.approx(4.0 / 4000 + 4.0 / 2000)

    def test_a_width_is_within_the_stroke(self, driver):
        peer = driver(ROS2["width-gripper"])
        with open_hand(self.uri.replace("=2000", "=100")) as hand:
            hand.send(GripCommand(1.0, LoopState.RELAX, {"thumb": FingerCommand(0.0)}))
            _, message = peer.wait(1)[-1]
        assert list(message["points"][0]["positions"]) == [0.0]

    def test_a_grip_that_would_close_beyond_the_end_is_refused(self, driver):
        driver(ROS2["width-gripper"])
        uri = self.uri.replace("stiffness=2000", "stiffness=70")
        with open_hand(uri) as hand:
            hand.check(Limits(max_scale=2.0), ["thumb"])
            text = r"a width of at least 0.0571 m at the beginning of the grip expected, 0.053 m gi"
            with pytest.raises(HandError, match=text):
                hand.send(COMMAND)

    def test_another_joint_is_refused(self, driver, impatient):
        driver(ROS2["width-gripper"], names=AH_NAMES)
        with pytest.raises(HandError, match=r"no joint finger_joint \(there are arm_1, ah_joint33"):
            open_hand(self.uri).open()

    @pytest.mark.parametrize("position", [15.0, -0.05, math.nan])  # degrees, beyond its end
    def test_a_reading_beyond_the_stroke_is_refused(self, driver, impatient, position):
        driver(ROS2["width-gripper"]).spoil(position, every=1)
        with pytest.raises(HandError, match=r"finger_joint at \S+, 0 to 0.8 expected"):
            open_hand(self.uri).open()
