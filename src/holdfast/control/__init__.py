"""Grip control: from estimates to commands for a hand, and what makes that safe."""

from holdfast.control.command import FingerCommand, GripCommand, GripEvent, GripReason, LoopState
from holdfast.control.controller import GripController
from holdfast.control.laws import LAWS, Law
from holdfast.control.limits import Limits

__all__ = [
    "LAWS",
    "FingerCommand",
    "GripCommand",
    "GripController",
    "GripEvent",
    "GripReason",
    "Law",
    "Limits",
    "LoopState",
]
