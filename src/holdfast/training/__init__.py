"""Training, honest figures, and judging: everything between recordings and a model."""

from typing import TYPE_CHECKING

from holdfast.training.judging import decisions_of, evaluate
from holdfast.training.setting import SPLITS, Setting
from holdfast.training.trainer import Trained, train

if TYPE_CHECKING:
    from holdfast.training.estimator import StabilityClassifier

__all__ = [
    "SPLITS",
    "Setting",
    "StabilityClassifier",
    "Trained",
    "decisions_of",
    "evaluate",
    "train",
]


def __getattr__(name: str) -> object:
    """Loads the scikit-learn face, and scikit-learn with it, when somebody asks for it."""
    if name == "StabilityClassifier":
        from holdfast.training.estimator import StabilityClassifier

        return StabilityClassifier
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
