"""Grip control: from estimates to commands for a hand, and what makes that safe."""

from holdfast.grip.command import FingerCommand, GripCommand, GripEvent, GripReason, LoopState
from holdfast.grip.controller import GripController
from holdfast.grip.laws import LAWS, Law
from holdfast.grip.limits import Limits

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
