"""Training and evaluation: from labelled recordings to a model and its metrics."""

from typing import TYPE_CHECKING

from holdfast.training.calibration import CalibratedModel, calibrate, calibrate_with_report
from holdfast.training.evaluation import compute_decisions, evaluate
from holdfast.training.setting import Setting
from holdfast.training.teaching import Taught, teach, teach_with_report
from holdfast.training.thresholds import CurvePoint, Tuned, tune
from holdfast.training.trainer import Trained, train

if TYPE_CHECKING:
    from holdfast.training.estimator import StabilityClassifier

__all__ = [
    "CalibratedModel",
    "CurvePoint",
    "Setting",
    "StabilityClassifier",
    "Taught",
    "Trained",
    "Tuned",
    "calibrate",
    "calibrate_with_report",
    "compute_decisions",
    "evaluate",
    "teach",
    "teach_with_report",
    "train",
    "tune",
]


def __getattr__(name: str) -> object:
    """Import the scikit-learn estimator, and with it scikit-learn, at its first use."""
    if name == "StabilityClassifier":
        from holdfast.training.estimator import StabilityClassifier

        return StabilityClassifier
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
