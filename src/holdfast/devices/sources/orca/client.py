"""Connection to an ORCA Touch hand at a serial port."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from holdfast.devices.sources.assembler import Device
from holdfast.devices.sources.orca.frames import OrcaClient
from holdfast.devices.sources.serial import BOARD, SERIAL_OPEN_TIMEOUT, PortSource
from holdfast.devices.uri import Address
from holdfast.sensors import Sensor, sensor
from holdfast.sensors.types import Array
from holdfast.sensors.xela_models import flat_grid

ORCA_BAUD = 921_600
SHARED_BAUD = 2_000_000
"""Speed of a port that joint encoders share [bit/s]."""


class OrcaSource(PortSource):
    """Source of the fingers of an ORCA Touch hand.

    A hand that was reset is asked again which fingers it has. Fingers that were not there when
    the source was opened, or that have another number of taxels, are left out.

    Args:
        address: `orca:///dev/ttyUSB0?baud=921600`.

    Raises:
        ValueError: a parameter is not valid.
    """

    silence_timeout = 2.0
    max_wait = 0.1

    def __init__(self, address: Address) -> None:
        address.only("baud")
        super().__init__(address, ORCA_BAUD, None)
        self._client = OrcaClient()

    def begin(self) -> None:
        """Ask which fingers there are, after the port was opened."""
        self._client.reset()
        self._fingers: dict[str, int] = {}

    def request(self, now: float) -> bytes:
        """Return the request to send now."""
        return self._client.request(now)

    def decode(self, data: bytes, received: float) -> Sequence[Array]:
        """Return the samples in the next bytes."""
        frames = self._client.feed(data, received)
        self.assembler.n_lost += frames.n_lost
        self.assembler.n_refused += frames.n_damaged
        if frames.n_damaged:
            self.assembler.notify("frame", "damaged frames are dropped", received)
        if self._client.fingers != self._fingers:
            self._fingers = self._client.fingers
            self.assembler.devices = {BOARD: self._device()}
        elif self._client.n_responses > 1 and not self._fingers:
            self.problem = "the hand has no finger with a sensor: are they plugged in?"
        device = self.assembler.devices.get(BOARD)
        return frames.samples if device and device.modules else ()

    def explain_silence(self) -> str:
        """Return why there was no sample."""
        if self._client.n_responses:
            return f"the hand answers, but sends no taxels within {SERIAL_OPEN_TIMEOUT:g} s"
        came = "something, but no ORCA frames" if self._client.n_bytes else "nothing"
        return (
            f"this port sends {came}; an ORCA Touch hand at {self.baud} baud expected "
            f"(?baud={SHARED_BAUD} where joint encoders share the port)"
        )

    def _device(self) -> Device:
        modules: dict[str, Sensor] = {}
        order: list[int] = []
        start = 0
        for name, n_taxels in self._fingers.items():
            one = fingertip(name, n_taxels)
            if not self.sensors or self.sensors.get(name) == one:
                modules[name] = one
                order += range(start, start + n_taxels)
            start += n_taxels
        return Device(BOARD, "ORCA Touch", modules, np.array(order) if len(order) < start else None)


def fingertip(finger: str, n_taxels: int) -> Sensor:
    """Return the sensor of a finger; one with another number of taxels is a flat grid.

    Example:
        >>> [fingertip("index", 87).name, fingertip("thumb", 51).name, fingertip("index", 60).name]
        ['orca-finger', 'orca-thumb', 'orca-60']
    """
    small = "orca-pinky" if finger == "pinky" else "orca-thumb"
    for known in (sensor("orca-finger"), sensor(small)):
        if known.n_taxels == n_taxels:
            return known
    name = f"orca-{n_taxels}"
    grid = flat_grid(name, n_taxels)
    return replace(known, name=name, positions=grid.positions, rotations=grid.rotations)
