"""Detector whose probability thresholds can be changed while it runs."""

from collections.abc import Mapping

from holdfast.detector import Detector
from holdfast.detector.contact_rule import THRESHOLD


class AdjustableDetector(Detector):
    """Detector whose probability thresholds can be changed between two samples."""

    def set_thresholds(self, thresholds: Mapping[str, float]) -> None:
        """Change the probability from which a contact is stable, from the next sample on.

        The compiled kernel reads the limits from this array.

        Args:
            thresholds: from 0 to 1, by finger.

        Raises:
            ValueError: a threshold is not from 0 to 1; nothing has changed then.
        """
        check_thresholds(thresholds)
        for limits, finger in zip(self._rule.limits, self._stream.plan.fingers, strict=True):
            limits[THRESHOLD] = thresholds[finger]


def check_thresholds(thresholds: Mapping[str, float]) -> None:
    """Raise `ValueError` for a threshold that is not from 0 to 1."""
    for value in thresholds.values():
        if not 0 <= value <= 1:
            raise ValueError(f"a threshold from 0 to 1 expected, {value} given")
