"""A parallel gripper of your own that takes a width, by a stated stiffness.

Copy the file, and replace `Driver` by what talks to your gripper. On ROS, `ros2:width-gripper`
does the same for the controllers of ros2_control, without any code.

The stiffness is given and not measured: the loop never closes the gripper, and the readings of
most sensors are counts. Measure it once: hold a hard object, command two widths, and divide the
difference of the forces by that of the widths.
"""

import math
from collections.abc import Iterable
from typing import Protocol

from holdfast_grip import GripCommand, HandDevice, Limits
from holdfast_grip.errors import HandError


class Driver(Protocol):
    """What the gripper must be able to do; both return at once."""

    def width(self) -> float:
        """Return the present width [m]."""

    def move(self, width: float) -> None:
        """Command a width [m]."""


class WidthGripper(HandDevice):
    """Gripper that reaches the width it is commanded to, but for its pads, which yield.

    Args:
        name: URI of the gripper, such as that of your plug-in.
        driver: of the gripper.
        start_force: force when the grip begins, at a scale of 1 [N].
        stiffness: force that each metre less of commanded width adds [N/m].
        stroke: width of the open gripper [m].
        max_force: highest force that gripper and object bear [N].

    Raises:
        ValueError: a number is out of range, or the stroke is no width in metres.
    """

    def __init__(
        self,
        name: str,
        driver: Driver,
        *,
        start_force: float,
        stiffness: float,
        stroke: float,
        max_force: float,
    ) -> None:
        numbers = {"start_force": start_force, "stiffness": stiffness, "stroke": stroke}
        for key, value in {**numbers, "max_force": max_force}.items():
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name}: {key}: above 0 expected, {value:g} given")
        if stroke > 1.0:
            raise ValueError(f"{name}: stroke: at most 1 m expected, {stroke:g} given")
        self.name = name
        self._driver, self._is_open = driver, False
        self._start_force, self._stiffness = start_force, stiffness
        self._stroke, self._max_force = stroke, max_force
        self._begin_width, self._max_scale = 0.0, 1.0

    def check(self, limits: Limits, fingers: Iterable[str]) -> None:
        """Check the force and the travel at the highest scale, before anything is sent."""
        super().check(limits, fingers)
        self._max_scale = limits.max_scale
        force = self._start_force * limits.max_scale
        if force > self._max_force:
            raise ValueError(
                f"{self.name}: at most {self._max_force:g} N expected, {force:g} N given at "
                f"max_scale {limits.max_scale:g}: lower it"
            )
        if self._closing(limits.max_scale) > self._stroke:
            raise ValueError(
                f"{self.name}: closing by at most {self._stroke:g} m expected, "
                f"{self._closing(limits.max_scale):.3g} m given at max_scale "
                f"{limits.max_scale:g}: lower it, or check the stiffness [N/m]"
            )

    def open(self) -> None:
        """Take commands from now on. Only this may wait."""
        self._is_open = True

    def close(self) -> None:
        """Take no more commands."""
        self.forget()
        self._is_open = False

    def _watch(self) -> None:
        if not self._is_open:
            raise HandError(f"{self.name} is not open")

    def _begin(self) -> None:
        """Take the width at which another program closed the gripper."""
        width = self._driver.width()
        if not self._closing(self._max_scale) <= width <= self._stroke:
            raise HandError(
                f"{self.name}: a width of {self._closing(self._max_scale):.3g} to "
                f"{self._stroke:g} m at the beginning of the grip expected, {width:.3g} m given"
            )
        self._begin_width = width

    def _closing(self, scale: float) -> float:
        """Return by how much a scale is narrower than the begin of the grip [m]."""
        return (scale - 1.0) * self._start_force / self._stiffness

    def _content(self, command: GripCommand) -> float:
        """Return the width to send [m]; -1 for an open gripper."""
        if command.release:
            return -1.0
        return self._begin_width - self._closing(self._scale(command))

    def _scale(self, command: GripCommand) -> float:
        """Return the largest scale of all fingers: a gripper has one force."""
        return max((finger.scale for finger in command.fingers.values()), default=1.0)

    def _send(self, command: GripCommand) -> None:
        force = self._start_force * self._scale(command)
        if not command.release and force > self._max_force:
            raise HandError(
                f"{self.name}: at most {self._max_force:g} N expected, {force:g} N given"
            )
        width = self._stroke if command.release else self._content(command)
        self._driver.move(min(max(width, 0.0), self._stroke))
