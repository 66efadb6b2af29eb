"""Packets of XELA's server become arrivals. No I/O and no clock: times are given."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import msgspec
import numpy.typing as npt

from holdfast.contact import Fault
from holdfast.errors import SourceError
from holdfast.sensors import Sensor
from holdfast.sensors.xela_models import whole_hand
from holdfast.sources.base import Arrival, notice_arrival
from holdfast.sources.timeline import LATE, Delay, Stamp, Timeline
from holdfast.sources.xela.models import Skin, skins
from holdfast.sources.xela.packet import Packet, Refusal, n_missing, read_packet, read_sensor

QUIET = 1.0
"""A complaint about the same sensor is not told again sooner [s]."""
FUTURE = 0.05
"""A sensor's own stamp so far ahead of its packet's is from before the clock jumped [s]."""

Samples = dict[str, npt.NDArray[Any]]
Faults = tuple[Fault, ...]


class Decoder:
    """Turns the packets of one server into arrivals, over its restarts.

    The first packet tells which modules there are; they stay. A packet that comes again, or a
    sensor in it whose own stamp stays the same, is no new sample; the same readings with a new
    stamp are one. Sensors that have stamps of their own arrive at instants of their own; one
    that lags behind another is timed just after it.

    Args:
        names: of the sensors by the server's number; `finger1`, ... where not given.
        calibrated: take the readings in newtons instead of counts.
        sensor: of the separate sensors with that number of taxels.

    Attributes:
        skins: the server's sensors by number, and the modules of each; empty before the first
            packet.
        version: of the server, "" where it does not tell.

    Example:
        >>> decoder = Decoder()
        >>> text = '{"message": 1, "time": 2, "1": {"model": "uSPa11", "data": "8000,8000,8CA0"}}'
        >>> decoder.learn(text)
        True
        >>> decoder.take(text, received=0.0)[0].samples["finger1"].tolist()
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
        self.skins: dict[int, Skin] = {}
        self.version = ""
        self._timeline = Timeline()
        self._clocks: dict[int, _Clock] = {}
        self._newest: tuple[int, float] | None = None
        self._counter: int | None = None
        self._time = -math.inf
        self._n_refused = self._n_lost = 0
        self._told: dict[int, float] = {}

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Of each module."""
        return {name: one for skin in self.skins.values() for name, one in skin.modules.items()}

    @property
    def metadata(self) -> dict[str, Any]:
        """What the server tells of itself: its version, its models, the hand."""
        told: dict[str, Any] = {"models": {str(n): skin.model for n, skin in self.skins.items()}}
        hands = [whole.name for skin in self.skins.values() if (whole := whole_hand(skin.model))]
        if len(hands) == 1:
            told["hand"] = hands[0]
        if self.version:
            told["server_version"] = self.version
        return told

    def learn(self, text: str | bytes) -> bool:
        """Learns from a packet which modules there are; False where it has no samples.

        Raises:
            Refusal: the packet, or a sensor in it, makes no sense.
            SourceError: it makes sense, but is not what is asked for.
        """
        packet = read_packet(text)
        if packet is None:
            return False
        if not packet.sensors:
            raise Refusal("it has no sensors")
        found = {number: self._found(number, raw) for number, raw in packet.sensors.items()}
        self.skins = skins(found, self._names, self._sensor, calibrated=self._calibrated)
        self._clocks = {number: _Clock() for number in self.skins}
        self.version = packet.version
        return True

    def reconnected(self) -> None:
        """Another connection: the counter may begin anew, time goes on."""
        self._counter = None

    def take(self, text: str | bytes, received: float) -> list[Arrival]:
        """What a packet brings: arrivals in the order of time, none where it brings nothing.

        Args:
            text: of the packet.
            received: when it came, by the host's monotonic clock [s].
        """
        heard = _Heard()
        try:
            packet = read_packet(text)
        except Refusal as why:
            self._n_refused += 1
            self._complain(heard, 0, f"a packet makes no sense: {why}", received)
            return self._told_of(heard, received)
        if packet is None or (packet.counter, packet.time) == self._newest:
            return []
        self._newest = packet.counter, packet.time
        self._count(packet.counter)
        self._hear(packet, received, heard)
        return self._told_of(heard, received)

    def _found(self, number: int, raw: msgspec.Raw) -> tuple[str, int]:
        """Model and number of taxels of a sensor."""
        try:
            part = read_sensor(raw, calibrated=self._calibrated)
            readings = part.readings()
            if readings is None and self._calibrated:
                raise SourceError(
                    f"sensor {number} ({part.model}) has no calibrated values: set calibration=on "
                    "for it in xServ.ini and start xela_server anew, or take ?values=counts"
                )
            return part.model, len(_agreed(part.taxels, readings))
        except Refusal as why:
            raise Refusal(f"sensor {number}: {why}") from why

    def _hear(self, packet: Packet, received: float, heard: "_Heard") -> None:
        """Takes all sensors of a packet; one that makes no sense does not spoil the others."""
        stamp = self._timeline.stamp(packet.time, received)
        now = _Now(packet.time, stamp, self._timeline.offset, received)
        if now.jumped:
            for clock in self._clocks.values():
                clock.jump()
        refused = False
        for number, raw in packet.sensors.items():
            try:
                self._hear_sensor(number, raw, now, heard)
            except Refusal as why:
                refused = True
                self._complain(heard, number, f"sensor {number} makes no sense: {why}", received)
        self._n_refused += refused

    def _hear_sensor(self, number: int, raw: msgspec.Raw, now: "_Now", heard: "_Heard") -> None:
        skin = self.skins.get(number)
        if skin is None:
            what = f"sensor {number} was not there at the beginning: open the source anew"
            self._complain(heard, -1, what, now.received)
            return
        part = read_sensor(raw, calibrated=self._calibrated)
        readings = _agreed(part.taxels, part.readings())
        n_taxels = len(readings)
        if n_taxels != skin.n_taxels:
            heard.faults.update(dict.fromkeys(skin.modules, (Fault.TAXEL_COUNT,)))
            what = f"sensor {number} sends {n_taxels} taxels, {skin.n_taxels} expected"
            self._complain(heard, number, what, now.received)
            return
        clock = self._clocks[number]
        if clock.is_new(part.time):
            time, faults = clock.at(part.time, now)
            heard.take(time, skin.split(readings), faults)

    def _count(self, counter: int) -> None:
        if self._counter is not None:
            self._n_lost += n_missing(self._counter, counter)
        self._counter = counter

    def _complain(self, heard: "_Heard", about: int, what: str, received: float) -> None:
        if received - self._told.get(about, -math.inf) >= QUIET:
            self._told[about] = received
            heard.notices.append(what)

    def _told_of(self, heard: "_Heard", received: float) -> list[Arrival]:
        """Arrivals of what was heard, one for each instant; word, where there are only notices."""
        arrivals = []
        for time in sorted(heard.samples):
            self._time = max(time, math.nextafter(self._time, math.inf))
            samples = heard.samples[time]
            faults = {name: heard.late[name] for name in samples if heard.late[name]}
            arrivals.append(Arrival(self._time, samples, received, faults))
        if not arrivals and heard.notices:
            arrivals = [notice_arrival(received)]
        if arrivals:
            first = arrivals[0]
            arrivals[0] = first._replace(
                faults={**heard.faults, **first.faults},
                n_lost=self._n_lost,
                n_refused=self._n_refused,
                notices=tuple(heard.notices),
            )
            self._n_lost = self._n_refused = 0
        return arrivals


class _Now(NamedTuple):
    """When a packet came: by its own stamp, on the clock of the source, by the host's clock."""

    packet: float
    stamp: Stamp
    offset: float
    received: float

    @property
    def jumped(self) -> bool:
        return Fault.CLOCK_JUMP in self.stamp.faults


@dataclass
class _Heard:
    """What a packet says: samples by time, what is wrong with how they came, notices."""

    samples: dict[float, Samples] = field(default_factory=dict)
    late: dict[str, Faults] = field(default_factory=dict)
    faults: dict[str, Faults] = field(default_factory=dict)
    notices: list[str] = field(default_factory=list)

    def take(self, time: float, samples: Samples, faults: Faults) -> None:
        self.samples.setdefault(time, {}).update(samples)
        self.late.update(dict.fromkeys(samples, faults))


class _Clock:
    """The stamps of one sensor: which are new, and which come late."""

    def __init__(self) -> None:
        self._delay = Delay()
        self._stamp: float | None = None

    def is_new(self, own: float | None) -> bool:
        """Whether there is a new sample; without stamps of its own, in every packet."""
        return own is None or own != self._stamp

    def at(self, own: float | None, now: _Now) -> tuple[float, Faults]:
        """The time of the sample, and what is wrong with it."""
        self._stamp = own
        if own is None or own > now.packet + FUTURE:
            return now.stamp.time, now.stamp.faults
        time = own + now.offset
        late = self._delay.of(time, now.received) > LATE
        return time, (Fault.CLOCK_JUMP,) * now.jumped + (Fault.LATE,) * late

    def jump(self) -> None:
        """The server's clock is another now."""
        self._delay.forget()


def _agreed(n_told: int | None, readings: npt.NDArray[Any] | None) -> npt.NDArray[Any]:
    """The readings, where there are some, as many as is told."""
    if readings is None:
        raise Refusal("it has no readings")
    if n_told is not None and n_told != len(readings):
        raise Refusal(f"it tells of {n_told} taxels and sends {len(readings)}")
    return readings
