"""Decoding of XELA's packets as arrivals. No I/O and no clock: times are arguments."""

from collections.abc import Mapping
from typing import Any

import numpy.typing as npt

from holdfast.devices.sources.assembler import Assembler, Device
from holdfast.devices.sources.base import Arrival
from holdfast.devices.sources.xela.devices import xela_devices
from holdfast.devices.sources.xela.packet import InvalidPacket, read_packet, read_sensor
from holdfast.errors import SourceError
from holdfast.sensors import Sensor


class XelaDecoder:
    """Decoder of the packets of one server as arrivals, also after restarts of the server.

    The first packet defines the modules. A repeated packet, and a sensor that repeats its own
    stamp, are no new samples. The same readings with a new stamp are a new sample. Sensors with
    stamps of their own arrive at instants of their own.

    Args:
        names: names of the sensors by the server's number; `finger1`, ... by default.
        calibrated: take readings in newtons instead of counts.
        sensor: layout of the separate sensors with this number of taxels.

    Attributes:
        version: version of the server; "" if packets do not contain it.

    Example:
        >>> decoder = XelaDecoder()
        >>> text = '{"message": 1, "time": 2, "1": {"model": "uSPa11", "data": "8000,8000,8CA0"}}'
        >>> decoder.identify(text)
        True
        >>> decoder.decode(text, received=0.0)[0].samples["finger1"].tolist()
        [[32768, 32768, 36000]]
    """

    def __init__(
        self,
        names: Mapping[int, str] | None = None,
        *,
        calibrated: bool = False,
        sensor: Sensor | None = None,
    ) -> None:
        self._names = dict(names or {})
        self._calibrated = calibrated
        self._sensor = sensor
        self.version = ""
        self._assembler = Assembler(hold_refusals=True)
        # Counter and time of the newest packet: a server repeats it while nothing new comes.
        self._newest: tuple[int, float] | None = None

    @property
    def devices(self) -> Mapping[int, Device]:
        """The server's sensors by number; empty before `identify`."""
        return self._assembler.devices

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Sensors by module."""
        return self._assembler.sensors

    @property
    def metadata(self) -> dict[str, Any]:
        """Models of the sensors, the hand, and the version of the server."""
        version = {"server_version": self.version} if self.version else {}
        return self._assembler.metadata | version

    def identify(self, text: str | bytes) -> bool:
        """Identify the modules from a packet. Return False if it has no samples.

        Raises:
            InvalidPacket: the packet, or a sensor in it, is not valid.
            SourceError: it is valid, but does not fit the arguments of the decoder.
        """
        packet = read_packet(text)
        if packet is None:
            return False
        if not packet.sensors:
            raise InvalidPacket("it has no sensors")
        models: dict[int, tuple[str, int]] = {}
        for number, raw in packet.sensors.items():
            try:
                part = read_sensor(raw, calibrated=self._calibrated)
                readings = part.readings()
                # Valid, but without newtons: another packet will not have them either.
                if readings is None and self._calibrated:
                    raise SourceError(no_calibration(number, part.model))
                models[number] = part.model, len(_checked(part.taxels, readings))
            except InvalidPacket as why:
                raise InvalidPacket(f"sensor {number}: {why}") from why
        self._assembler.devices = xela_devices(
            models, self._names, self._sensor, calibrated=self._calibrated
        )
        self.version = packet.version
        return True

    def reconnected(self) -> None:
        """Accept any counter in the next packet, because the connection is a new one."""
        self._assembler.reconnected()

    def decode(self, text: str | bytes, received: float) -> list[Arrival]:
        """Return the arrivals of a packet in order of time, none if it has nothing new.

        Args:
            text: the packet.
            received: time of arrival, on the host's monotonic clock [s].
        """
        try:
            packet = read_packet(text)
        except InvalidPacket as why:
            self._assembler.refuse("packet", f"invalid packet: {why}", received)
            return self._assembler.finish(received)
        if packet is None or (packet.counter, packet.time) == self._newest:
            return []
        self._newest = packet.counter, packet.time
        self._assembler.n_lost += self._assembler.n_missing(packet.counter)
        self._assembler.stamp(packet.time, received)
        invalid = False  # an invalid sensor does not affect the others
        for number, raw in packet.sensors.items():
            if not self._assembler.accepts_device(number, received):
                continue
            try:
                part = read_sensor(raw, calibrated=self._calibrated)
                readings = _checked(part.taxels, part.readings())
                fits = self._assembler.accepts_taxels(number, len(readings), received)
                # Version 1.8 repeats a sensor whose next sample has not come, with its old stamp.
                if fits and self._assembler.is_new(number, part.time):
                    self._assembler.add(number, readings, part.time)
            except InvalidPacket as why:
                invalid = True
                text = f"sensor {number} is invalid: {why}"
                self._assembler.notify(f"sensor {number}", text, received)
        self._assembler.n_refused += invalid
        return self._assembler.finish(received)


def no_calibration(number: int, model: str) -> str:
    """Return the message about a sensor without readings in newtons."""
    return (
        f"sensor {number} ({model}) has no calibrated values: set calibration=on for it in "
        "xServ.ini and restart xela_server, or use ?values=counts"
    )


def _checked(n_taxels: int | None, readings: npt.NDArray[Any] | None) -> npt.NDArray[Any]:
    """Return the readings if there are any, and as many as the packet announces."""
    if readings is None:
        raise InvalidPacket("it has no readings")
    if n_taxels is not None and n_taxels != len(readings):
        raise InvalidPacket(f"it announces {n_taxels} taxels and sends {len(readings)}")
    return readings
