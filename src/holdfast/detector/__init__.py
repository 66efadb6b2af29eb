"""The detector: from samples to estimates, live and offline."""

from holdfast.detector.detection import Detection, FingerTrace
from holdfast.detector.detector import HAND, Detector, detect

__all__ = ["HAND", "Detection", "Detector", "FingerTrace", "detect"]
