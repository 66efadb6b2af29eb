"""What devices say in ROS becomes arrivals. No I/O and no clock: times are given."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy.typing as npt

from holdfast.contact import Fault
from holdfast.errors import SourceError
from holdfast.ros.sensor_messages import PAPILLARRAY, DeviceSample, readings_of
from holdfast.sensors import Sensor, sensor
from holdfast.sensors.types import Unit
from holdfast.sensors.xela_models import whole_hand
from holdfast.sources.base import Arrival, notice_arrival
from holdfast.sources.timeline import LATE, Delay, Timeline
from holdfast.sources.xela.models import Skin, skins
from holdfast.sources.xela.packet import n_missing

_CLOCKS: tuple[Callable[[DeviceSample], float | None], ...] = (
    lambda message: message.time,
    lambda message: message.stamp,
)
QUIET = 1.0
"""A complaint about the same thing is not told again sooner [s]."""


class Translator:
    """Turns messages into arrivals, over restarts of whoever publishes.

    A device has a clock of its own, or only the stamp in a header, or neither: then samples
    are timed as they arrive. Devices of one message that tell other instants arrive one after
    the other. A packet that comes again is no new sample.

    Args:
        names: of the devices by their number; `finger1`, ... where not given.
        unit: to take readings in; a device that has newtons only gives these.
        sensor: of the separate sensors with that number of taxels.

    Attributes:
        skins: the devices by number, and the modules of each; empty before `learn`.
    """

    def __init__(
        self,
        names: Mapping[int, str] | None = None,
        unit: Unit = "count",
        sensor: Sensor | None = None,
    ) -> None:
        self._names = dict(names or {})
        self._unit: Unit = unit
        self._sensor = sensor
        self.skins: dict[int, Skin] = {}
        self._devices: dict[int, _Device] = {}
        self._timeline = Timeline()
        self._clock: Callable[[DeviceSample], float | None] | None = None
        self._time = -math.inf
        self._told: dict[str, float] = {}

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Of each module."""
        return {name: one for skin in self.skins.values() for name, one in skin.modules.items()}

    @property
    def metadata(self) -> dict[str, Any]:
        """What devices tell of themselves: their models, the hand."""
        told: dict[str, Any] = {"models": {str(n): skin.model for n, skin in self.skins.items()}}
        hands = [whole.name for skin in self.skins.values() if (whole := whole_hand(skin.model))]
        return told | ({"hand": hands[0]} if len(hands) == 1 else {})

    def learn(self, messages: Iterable[DeviceSample]) -> None:
        """Learns from the first messages which devices there are.

        Raises:
            SourceError: they are not what is asked for.
        """
        found = {_number(m): m for m in messages if _is_there(m)}
        for number, message in found.items():
            self._check_readings(number, message)
        self.skins = self._skins(found)
        self._clock = next(
            (c for c in _CLOCKS if any(c(message) is not None for message in found.values())), None
        )
        self._devices = {number: _Device() for number in self.skins}

    def take(self, messages: Iterable[DeviceSample], received: float) -> list[Arrival]:
        """What the messages of one packet bring, in the order of time.

        Args:
            messages: of its devices.
            received: when it came, by the host's monotonic clock [s].
        """
        heard = _Heard()
        fresh = [m for m in messages if self._is_expected(m, heard, received)]
        stamps = [received if self._clock is None else self._clock(m) for m in fresh]
        newest = max((stamp for stamp in stamps if stamp is not None), default=None)
        if newest is not None:
            now = self._timeline.stamp(newest, received)
            for message, stamp in zip(fresh, stamps, strict=True):
                time = now.time
                if stamp is not None and stamp < newest:
                    time = stamp + self._timeline.offset
                self._hear(message, time, received, heard, Fault.CLOCK_JUMP in now.faults)
        elif fresh:
            heard.n_refused += 1
            self._complain(heard, "time", "a message has no time, others had", received)
        return self._told_of(heard, received)

    def refuse(self, why: str, received: float) -> list[Arrival]:
        """Word of a packet that makes no sense."""
        heard = _Heard(n_refused=1)
        self._complain(heard, "sense", f"a message makes no sense: {why}", received)
        return self._told_of(heard, received)

    def reconnected(self) -> None:
        """Whoever publishes is another: its counter may begin anew, time goes on."""
        for device in self._devices.values():
            device.sequence = None

    def _skins(self, found: Mapping[int, DeviceSample]) -> dict[int, Skin]:
        pillars = [number for number, message in found.items() if message.counts is None]
        if pillars:
            return {number: self._pillars(number, found[number]) for number in pillars}
        given = {n: (m.model, len(readings_of(m, self._unit))) for n, m in found.items()}
        return skins(given, self._names, self._sensor, calibrated=self._unit == "N")

    def _pillars(self, number: int, message: DeviceSample) -> Skin:
        if strangers := sorted(set(self._names) - {number}):
            raise SourceError(
                f"fingers= names {', '.join(map(str, strangers))}; the topic has 1 ({PAPILLARRAY})"
            )
        built_in = self._sensor or sensor(PAPILLARRAY)
        if len(message.forces) != built_in.n_taxels:
            raise SourceError(
                f"{len(message.forces)} taxels given, {built_in.n_taxels} expected "
                f"({built_in.name})"
            )
        return Skin(number, PAPILLARRAY, {self._names.get(number, f"finger{number}"): built_in})

    def _check_readings(self, number: int, message: DeviceSample) -> None:
        if message.counts is not None and self._unit == "N" and not len(message.forces):
            raise SourceError(
                f"sensor {number} ({message.model}) has no calibrated values: set calibration=on "
                "for it in xServ.ini and start xela_server anew, or take ?values=counts"
            )

    def _is_expected(self, message: DeviceSample, heard: "_Heard", received: float) -> bool:
        """Whether it holds a sample that is new, of a device as it was."""
        number = _number(message)
        skin, device = self.skins.get(number), self._devices.get(number)
        if skin is None or device is None:
            if _is_there(message):
                what = f"sensor {number} was not there at the beginning: open the source anew"
                self._complain(heard, f"new {number}", what, received)
            return False
        n_taxels = len(readings_of(message, self._unit))
        if n_taxels != skin.n_taxels:
            heard.faults.update(dict.fromkeys(skin.modules, (Fault.TAXEL_COUNT,)))
            what = f"sensor {number} sends {n_taxels} taxels, {skin.n_taxels} expected"
            self._complain(heard, f"taxels {number}", what, received)
            return False
        return device.is_new(message)

    def _hear(
        self, message: DeviceSample, time: float, received: float, heard: "_Heard", jumped: bool
    ) -> None:
        device, skin = self._devices[_number(message)], self.skins[_number(message)]
        heard.n_lost = max(heard.n_lost, device.count(message.sequence))
        late = device.is_late(time, received, jumped=jumped)
        samples = skin.split(readings_of(message, self._unit))
        heard.samples.setdefault(time, {}).update(samples)
        faults = (Fault.CLOCK_JUMP,) * jumped + (Fault.LATE,) * late
        heard.faults.update(dict.fromkeys(samples, faults))

    def _complain(self, heard: "_Heard", about: str, what: str, received: float) -> None:
        if received - self._told.get(about, -math.inf) >= QUIET:
            self._told[about] = received
            heard.notices.append(what)

    def _told_of(self, heard: "_Heard", received: float) -> list[Arrival]:
        """An arrival for each instant; word, where there are no samples but something to tell."""
        arrivals = []
        for time in sorted(heard.samples):
            self._time = max(time, math.nextafter(self._time, math.inf))
            samples = heard.samples[time]
            faults = {name: heard.faults.pop(name) for name in samples}
            told = {name: these for name, these in faults.items() if these}
            arrivals.append(Arrival(self._time, samples, received, told))
        if not arrivals and (heard.notices or heard.faults or heard.n_refused):
            arrivals = [notice_arrival(received)]
        if arrivals:
            arrivals[0] = arrivals[0]._replace(
                faults={**heard.faults, **arrivals[0].faults},
                n_lost=heard.n_lost,
                n_refused=heard.n_refused,
                notices=tuple(heard.notices),
            )
        return arrivals


@dataclass
class _Heard:
    """What a packet says: samples by time, what is wrong with how they came, notices."""

    samples: dict[float, dict[str, npt.NDArray[Any]]] = field(default_factory=dict)
    faults: dict[str, tuple[Fault, ...]] = field(default_factory=dict)
    notices: list[str] = field(default_factory=list)
    n_lost: int = 0
    n_refused: int = 0


class _Device:
    """What is known of a device: its newest packet, and how late it uses to come."""

    def __init__(self) -> None:
        self.sequence: int | None = None
        self._newest: tuple[int | None, float] | None = None
        self._delay = Delay()

    def is_new(self, message: DeviceSample) -> bool:
        """Whether it is no packet that came already; without stamps, every packet is new."""
        time = message.time if message.time is not None else message.stamp
        if time is None:
            return True
        newest = message.sequence, time
        if newest == self._newest:
            return False
        self._newest = newest
        return True

    def count(self, sequence: int | None) -> int:
        """How many packets are missing before this one."""
        last, self.sequence = self.sequence, sequence
        if last is None or sequence is None:
            return 0
        return n_missing(last, sequence)

    def is_late(self, time: float, received: float, *, jumped: bool) -> bool:
        if jumped:
            self._delay.forget()
        return self._delay.of(time, received) > LATE


def _number(message: DeviceSample) -> int:
    return 1 if message.number is None else message.number


def _is_there(message: DeviceSample) -> bool:
    """Whether it is a sensor at all, and not the server's word for one that is off."""
    return bool(len(message.forces)) if message.counts is None else bool(len(message.counts))
