"""Grip control: from estimates to commands for a hand, and what makes that safe.

Example:
    >>> GripController(Limits(max_scale=1.5), "fixed").limits.max_scale
    1.5
"""

from holdfast_grip.command import FingerCommand, GripCommand, GripEvent, GripReason, LoopState
from holdfast_grip.controller import GripController
from holdfast_grip.errors import HandError
from holdfast_grip.hands.base import HandDevice
from holdfast_grip.laws import LAWS, Law
from holdfast_grip.limits import Limits
from holdfast_grip.loop.grip_loop import GripLoop

__all__ = [
    "LAWS",
    "FingerCommand",
    "GripCommand",
    "GripController",
    "GripEvent",
    "GripLoop",
    "GripReason",
    "HandDevice",
    "HandError",
    "Law",
    "Limits",
    "LoopState",
]
