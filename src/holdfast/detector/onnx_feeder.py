"""Log odds of classifiers in ONNX files, which Python computes for the kernel, sample by sample."""

from collections.abc import Sequence

import numpy as np

from holdfast.classifiers import Onnx
from holdfast.features.stream import FeatureStream
from holdfast.model import FingerModel
from holdfast.sensors.types import Array, Flags


class OnnxFeeder:
    """Feeder of a kernel with the log odds of ONNX files.

    It computes the features once more, in a stream of its own: an update takes as long as the
    classifier.

    Args:
        parts: models of the fingers of the stream, in its order.
        stream: of the detector.
    """

    def __init__(self, parts: Sequence[FingerModel], stream: FeatureStream) -> None:
        self._kernel = stream.start()
        self._features = np.empty((1, len(parts), stream.plan.width))
        self._amplitude = np.empty((1, len(parts)))
        self._log_odds = np.zeros(len(parts))
        self._rules = {
            place: (part.indices(part.stable), part.stable.rule)
            for place, part in enumerate(parts)
            if isinstance(part.stable.rule, Onnx)
        }

    def log_odds(self, readings: Array, present: Flags, time: float) -> Array:
        """Return (n_fingers,) the log odds of stability of a sample; see `Detector.update`."""
        self._kernel.advance(
            readings[None], present[None], np.array([time]), self._features, self._amplitude
        )
        for place, (columns, onnx) in self._rules.items():
            features = self._features[:, place, columns]
            if present[place] and not np.isnan(features).any():  # NaN: the finger has none
                probability = onnx.probability(features)[0]
                with np.errstate(divide="ignore"):
                    self._log_odds[place] = np.log(probability / (1.0 - probability))
        return self._log_odds
