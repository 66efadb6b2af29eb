"""Source of an ORCA Touch hand at a serial port."""

from collections.abc import Sequence
from dataclasses import replace

from holdfast.devices.sources.assembler import Device
from holdfast.devices.sources.orca_frames import OrcaClient
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
        self.begin()

    def begin(self) -> None:
        """Begin with the questions, after the port was opened."""
        self._client = OrcaClient()

    def request(self, now: float) -> bytes:
        """Return the question to send now."""
        return self._client.request(now)

    def decode(self, data: bytes, received: float) -> Sequence[Array]:
        """Return the samples in the next bytes."""
        samples, n_damaged, n_lost = self._client.feed(data, received)
        fingers = self._client.fingers
        self.assembler.n_lost += n_lost
        self.assembler.n_refused += n_damaged
        if n_damaged:
            self.assembler.notify("frame", "damaged frames are dropped", received)
        if fingers and not self.assembler.devices:
            self._opened = fingers
            modules = {name: fingertip(name, n_taxels) for name, n_taxels in fingers.items()}
            self.assembler.devices = {BOARD: Device(BOARD, "ORCA Touch", modules)}
        elif samples and fingers != self._opened:
            text = f"the hand has other fingers now ({', '.join(fingers)}): open the source again"
            self.assembler.report_taxel_count(BOARD, text, received)
            return ()
        elif self._client.n_responses > 1 and not fingers:
            self.problem = "the hand has no finger with a sensor: are they plugged in?"
        return samples

    def explain_silence(self) -> str:
        """Return why there was no sample."""
        if self._client.n_responses:
            return f"the hand answers, but sends no taxels within {SERIAL_OPEN_TIMEOUT:g} s"
        came = "something, but no ORCA frames" if self._client.n_bytes else "nothing"
        return (
            f"this port sends {came}; an ORCA Touch hand at {self.baud} baud expected "
            f"(?baud={SHARED_BAUD} where joint encoders share the port)"
        )


def fingertip(finger: str, n_taxels: int) -> Sensor:
    """Return the sensor of a finger; one with another number of taxels is a flat grid.

    Example:
        >>> [fingertip("index", 87).name, fingertip("thumb", 51).name, fingertip("index", 60).name]
        ['orca-finger', 'orca-thumb', 'orca-60']
    """
    large, small = (
        sensor("orca-finger"),
        sensor(f"orca-{'pinky' if finger == 'pinky' else 'thumb'}"),
    )
    grid = flat_grid(f"orca-{n_taxels}", n_taxels)
    other = replace(large, name=grid.name, positions=grid.positions, rotations=grid.rotations)
    return next((one for one in (large, small) if one.n_taxels == n_taxels), other)


source = OrcaSource
"""Makes the source of a URI."""
