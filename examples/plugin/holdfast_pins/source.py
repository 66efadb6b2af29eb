"""The source `pins:?seconds=5`: an imitation of the skin that is pressed after one second.

Replace `_readings` by what reads your device. A device that may be unplugged derives from
`DeviceSource` of `holdfast.devices.sources.base`, which reconnects and reports silence.
"""

import time

import numpy as np
import numpy.typing as npt

from holdfast.devices.sources import Arrival, Source
from holdfast.devices.uri import Address
from holdfast.errors import SourceError
from holdfast_pins.skin import RATE, pin_skin

MODULE = "finger1"
"""Name of the only module; a hand with several has one for each fingertip."""
PRESSED_FROM = 1.0
"""Time at which the imitation is pressed [s]."""
LOAD = 200.0
"""Reading of a pressed taxel along its normal [count]."""


def source(address: Address) -> Source:
    """Return the source of a URI; entering it connects.

    Raises:
        ValueError: a parameter is unknown, or not a number of seconds.
    """
    address.only("seconds")
    return PinSource(address.text, float(address.parameters.get("seconds", "5")))


class PinSource(Source):
    """Imitation of the skin.

    Args:
        name: URI.
        seconds: length of what it sends [s].
    """

    def __init__(self, name: str, seconds: float) -> None:
        self.name, self._seconds = name, seconds
        self.metadata = {"source": name}
        self._next, self._started_at = 0, 0.0
        self._noise = np.random.default_rng(0)

    def open(self) -> None:
        """Connect. `sensors` is known from now on."""
        if not self._seconds > 0:
            raise SourceError(f"{self.name}: more than 0 seconds expected")
        self.sensors = {MODULE: pin_skin()}
        self._next, self._started_at = 0, time.monotonic()

    @property
    def ended(self) -> bool:
        """Whether all samples were read; a real device never ends."""
        return self._next >= self._seconds * RATE

    def read(self, timeout: float) -> Arrival | None:
        """Return the next sample, or None after `timeout` [s]."""
        if self.ended or not self.sensors:
            return None
        wait = self._started_at + self._next / RATE - time.monotonic()
        time.sleep(max(min(wait, timeout), 0.0))
        if wait > timeout:
            return None
        at = self._next / RATE
        self._next += 1
        return Arrival(at, {MODULE: self._readings(at)}, time.monotonic())

    def _readings(self, at: float) -> npt.NDArray[np.float64]:
        """Return (n_taxels, 3) [count] at a time [s]."""
        readings = self._noise.normal(0.0, 1.0, (self.sensors[MODULE].n_taxels, 3))
        readings[:, 2] += LOAD * (at >= PRESSED_FROM)
        readings.setflags(write=False)
        return readings

    def close(self) -> None:
        """Disconnect."""
        self.sensors = {}
