"""Sources of samples: recordings, the twin and devices, all with one contract."""

from holdfast.devices.sources.base import Arrival, Source
from holdfast.devices.uri import SCHEMES, open_source

__all__ = ["SCHEMES", "Arrival", "Source", "open_source"]
