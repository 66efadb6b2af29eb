"""Grip control: from estimates to commands for a hand, and what makes that safe.

Example:
    >>> GripController(Limits(max_scale=1.5), "fixed").limits.max_scale
    1.5
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from holdfast_grip.command import FingerCommand, GripCommand, GripEvent, GripReason, LoopState
from holdfast_grip.controller import GripController
from holdfast_grip.errors import HandError
from holdfast_grip.laws import LAWS, Law
from holdfast_grip.limits import Limits

if TYPE_CHECKING:
    from holdfast_grip.hands.base import HandDevice
    from holdfast_grip.loop.grip_loop import GripLoop

_LATE = {"HandDevice": "hands.base", "GripLoop": "loop.grip_loop"}
"""Modules of names that need the live parts of holdfast; they are imported at first use."""

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


def __getattr__(name: str) -> Any:  # noqa: ANN401 (the value is any of the late names)
    if name not in _LATE:
        raise AttributeError(f"module 'holdfast_grip' has no attribute {name!r}")
    return getattr(import_module(f"holdfast_grip.{_LATE[name]}"), name)
