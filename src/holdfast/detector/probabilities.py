"""Probabilities of classifiers that the compiled decision rule cannot compute."""

from collections.abc import Sequence

import numpy as np

from holdfast.classifiers import LinearClassifier
from holdfast.detector.arrays import DecisionRule
from holdfast.features import kernel
from holdfast.features.arrays import READY, REASON
from holdfast.features.stream import FeatureStream
from holdfast.model import FingerModel
from holdfast.sensors.types import Array, Flags


class ProbabilityFeeder:
    """Feeder of a decision rule with probabilities, sample by sample.

    It computes the features once more, gives them to the classifier, and writes the log odds of
    its probability as the offset of a linear classifier without weights. This is slower than the
    compiled rule: an update takes as long as the classifier.

    Args:
        parts: models of the fingers of the stream, in its order.
        stream: before its first sample.
        rule: of the detector; its offsets are changed.
    """

    def __init__(
        self, parts: Sequence[FingerModel], stream: FeatureStream, rule: DecisionRule
    ) -> None:
        self._stream, self._rule = FeatureStream(stream.plan), rule
        self._stream.memory.baseline[:] = stream.memory.baseline  # a tare by interval
        self._classifiers = {
            place: part.classifier
            for place, part in enumerate(parts)
            if not isinstance(part.classifier, LinearClassifier)
        }

    def update(self, readings: Array, present: Flags, time: float) -> None:
        """Write the log odds of one sample; the arguments are those of `decision_rule.step`."""
        layout, memory, output = self._stream.layout, self._stream.memory, self._stream.output
        kernel.advance(layout, memory, output, readings, present, time)
        for place, classifier in self._classifiers.items():
            if present[place] and output.status[place, REASON] == READY:
                features = output.features[place, None, : classifier.n_features]
                probability = classifier.probability(features)[0]
                with np.errstate(divide="ignore"):
                    self._rule.weights[place, 0] = np.log(probability / (1.0 - probability))
