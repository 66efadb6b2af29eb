"""The detector, live and offline."""

from holdfast.detector.detector import HAND, Detector, detect
from holdfast.detector.traces import Detection, FingerTrace

__all__ = ["HAND", "Detection", "Detector", "FingerTrace", "detect"]
