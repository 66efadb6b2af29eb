"""Deprecated name of the live detector: use `holdfast.StreamDetector`."""

import warnings
from collections.abc import Mapping
from typing import Any

from holdfast.devices.sources import Arrival
from holdfast.live.arrival_detector import ArrivalDetector, StreamEstimate
from holdfast.model import Model
from holdfast.sensors import Sensor


class Judge(ArrivalDetector):
    """Deprecated: use `holdfast.StreamDetector`."""

    def __init__(
        self,
        model: Model,
        sensors: Mapping[str, Sensor],
        **options: Any,  # noqa: ANN401 (the options of `ArrivalDetector`)
    ) -> None:
        warnings.warn(
            "holdfast.live.judge.Judge is deprecated; use holdfast.StreamDetector",
            DeprecationWarning,
            stacklevel=2,
        )
        super().__init__(model, sensors, **options)

    def take(self, arrival: Arrival) -> list[StreamEstimate]:
        """Process an arrival, as `ArrivalDetector.update` does."""
        return self.update(arrival)
