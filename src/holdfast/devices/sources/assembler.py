"""Assembly of the packets of devices into arrivals. No I/O and no clock: times are arguments."""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any, NamedTuple

import numpy.typing as npt

from holdfast.contact import Fault
from holdfast.devices.sources.base import Arrival, notice_arrival
from holdfast.devices.sources.timeline import Stamp, Timeline, TransportDelay
from holdfast.sensors import Sensor
from holdfast.sensors.xela_models import whole_hand

SEQUENCE_PERIOD = 2**32
"""Sequence counters continue at 0 after this many packets."""
MIN_COUNTER_RESTART = 2**16
"""A counter that goes on by at least this many packets was restarted; no packet is missing."""
NOTICE_REPEAT_INTERVAL = 1.0
"""Minimum time between two notices about the same problem [s]."""
MAX_STAMP_LEAD = 0.05
"""A device's stamp that is ahead of its packet's by more than this is from before a jump of the
clock [s]."""

Faults = tuple[Fault, ...]


@dataclass(frozen=True, eq=False)
class Device:
    """A sensor as a server, hub or board sends it, and the modules that it consists of.

    Attributes:
        number: number of the device in packets.
        model: name of its model in packets.
        modules: sensors by module.
        order: (n_taxels,) index in the packet of each taxel, module after module; None if the
            packet has this order.
        notices: messages for the user about this device.
    """

    number: int
    model: str
    modules: Mapping[str, Sensor]
    order: npt.NDArray[Any] | None = None
    notices: tuple[str, ...] = ()
    n_taxels: int = field(init=False)
    _parts: tuple[tuple[str, slice], ...] = field(init=False)

    def __post_init__(self) -> None:
        ends = list(accumulate(sensor.n_taxels for sensor in self.modules.values()))
        object.__setattr__(self, "n_taxels", ends[-1] if ends else 0)
        object.__setattr__(
            self, "_parts", tuple(zip(self.modules, map(slice, [0, *ends], ends), strict=False))
        )

    def split(self, readings: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
        """Return the readings of each module, given (n_taxels, 3) in the order of the packet."""
        ordered = readings if self.order is None else readings.take(self.order, axis=0)
        if len(self.modules) == 1:
            return dict.fromkeys(self.modules, ordered)
        return {name: ordered[taxels] for name, taxels in self._parts}


class Assembler:
    """Collector of the samples, faults and notices of packets, which makes arrivals of them.

    For each packet, call `stamp`, then `add` for each of its devices, then `finish`. Devices with
    stamps of their own get instants of their own. Arrivals have strictly increasing times: a
    device that lags behind another gets a time just after it.

    Args:
        hold_refusals: wait for the next arrival to report refused packets. Otherwise each
            refused packet gives an arrival.

    Attributes:
        devices: devices by number; samples of other devices are not accepted.
        n_lost: number of missing packets to report with the next arrival.
        n_refused: number of packets that are not valid, to report with the next arrival.
    """

    def __init__(self, *, hold_refusals: bool = False) -> None:
        self._hold_refusals = hold_refusals
        self.devices: Mapping[int, Device] = {}
        self.n_lost = self.n_refused = 0
        self._timeline = Timeline()
        self._is_fast = False  # whether the notice about a fast clock was given
        self._packet = _PacketTime(math.nan, Stamp(math.nan), math.nan)  # set by `stamp`
        # By the number of the device: delays of stamps of its own, the identity of its newest
        # sample, and its sequence counter (None: one counter for all).
        self._delays: dict[int, TransportDelay] = {}
        self._newest: dict[int, Hashable] = {}
        self._sequences: dict[int | None, int | None] = {}
        self._time = -math.inf  # of the newest arrival with samples
        # Of the packet that is assembled: `add`, `report_taxel_count` and `notify` fill them,
        # `finish` empties them.
        self._instants: dict[float, _Instant] = {}
        self._faults: dict[str, Faults] = {}
        self._notices: list[str] = []
        self._noticed_at: dict[str, float] = {}  # by topic; older ones are forgotten

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Sensors by module."""
        return {n: skin for device in self.devices.values() for n, skin in device.modules.items()}

    @property
    def metadata(self) -> dict[str, Any]:
        """Models of the devices, and the hand if there is exactly one."""
        models = {number: device.model for number, device in self.devices.items()}
        hands = [hand.name for model in models.values() if (hand := whole_hand(model))]
        return {
            "models": {str(number): model for number, model in models.items()},
            **({"hand": hands[0]} if len(hands) == 1 else {}),
        }

    def reconnected(self) -> None:
        """Accept any next value of the sequence counters; time continues."""
        self._sequences.clear()

    def n_missing(self, sequence: int | None, number: int | None = None) -> int:
        """Return the number of packets missing before this one, by a sequence counter.

        Args:
            sequence: value of the counter; None if the packet has none.
            number: number of the device; None for a counter of all devices.
        """
        last = self._sequences.get(number)
        self._sequences[number] = sequence
        return 0 if last is None or sequence is None else n_missing(last, sequence)

    def is_new(self, number: int, identity: Hashable) -> bool:
        """Return whether a device's sample differs from its last one; None is always new."""
        if identity is None:
            return True
        if self._newest.get(number) == identity:
            return False
        self._newest[number] = identity
        return True

    def accepts_device(self, number: int, received: float) -> bool:
        """Return whether there is a device of this number; otherwise give a notice."""
        if number in self.devices:
            return True
        text = f"sensor {number} was not there when the source was opened: open the source again"
        self.notify(f"new {number}", text, received)
        return False

    def accepts_taxels(self, number: int, n_taxels: int, received: float) -> bool:
        """Return whether a device sends its number of taxels; otherwise report a fault."""
        device = self.devices[number]
        if n_taxels == device.n_taxels:
            return True
        text = f"sensor {number} sends {n_taxels} taxels, {device.n_taxels} expected"
        self.report_taxel_count(number, text, received)
        return False

    def report_taxel_count(self, number: int, text: str, received: float) -> None:
        """Report that a device sends another number of taxels than expected."""
        self._faults.update(dict.fromkeys(self.devices[number].modules, (Fault.TAXEL_COUNT,)))
        self.notify(f"taxels {number}", text, received)

    def refuse(self, topic: str, text: str, received: float) -> None:
        """Count a packet as refused, and give a notice."""
        self.n_refused += 1
        self.notify(topic, text, received)

    def notify(self, topic: str, text: str, received: float) -> None:
        """Give a notice, but not more than one about the same topic in a second."""
        if received - self._noticed_at.get(topic, -math.inf) < NOTICE_REPEAT_INTERVAL:
            return
        recent = {
            text_noticed: at
            for text_noticed, at in self._noticed_at.items()
            if received - at < NOTICE_REPEAT_INTERVAL
        }
        self._noticed_at = recent | {topic: received}
        self._notices.append(text)

    def stamp(self, time: float, received: float) -> None:
        """Set the time of the next samples.

        Args:
            time: stamp of their packet, on the device's clock [s].
            received: time of arrival, on the host's monotonic clock [s].
        """
        stamp = self._timeline.stamp(time, received)
        self._packet = _PacketTime(time, stamp, received)
        pace = self._timeline.clock.pace
        if pace > 1.0 and not self._is_fast:
            text = f"the clock of the device runs {pace:.2g} times as fast as that of this machine"
            self.notify("clock", text, received)
        self._is_fast = pace > 1.0
        if self._packet.jumped:
            for delay in self._delays.values():
                delay.reset()

    def add(self, number: int, readings: npt.NDArray[Any], stamp: float | None = None) -> None:
        """Add a sample of a device.

        Args:
            number: number of the device.
            readings: (n_taxels, 3) in the order of the packet.
            stamp: the device's own stamp [s]; None to use the packet's.
        """
        packet = self._packet
        if stamp is None or stamp > packet.time + MAX_STAMP_LEAD:
            time, faults = packet.stamp  # a stamp from the future is of before a jump of the clock
        else:
            time = packet.stamp.time if stamp == packet.time else stamp + self._timeline.offset
            # Each device has its usual delay: one may be measured long before the packet is sent.
            late = self._delays.setdefault(number, TransportDelay()).is_late(time, packet.received)
            faults = (Fault.CLOCK_JUMP,) * packet.jumped + (Fault.LATE,) * late
        samples = self.devices[number].split(readings)
        instant = self._instants.setdefault(time, _Instant({}, {}))
        instant.samples.update(samples)
        instant.faults.update(dict.fromkeys(samples, faults))

    def finish(self, received: float) -> list[Arrival]:
        """Return the arrivals of a packet in order of time, none if there is nothing to report."""
        arrivals = []
        for time, (samples, faults) in sorted(self._instants.items()):
            # Equal or older than another device's: just after it, as times must increase.
            self._time = max(time, math.nextafter(self._time, math.inf))
            faults_of_module = {name: these for name, these in faults.items() if these}
            arrivals.append(Arrival(self._time, samples, received, faults_of_module))
        # A flood of refused packets would be a flood of arrivals without samples.
        refused = self.n_refused and not self._hold_refusals
        if not arrivals and (self._notices or self._faults or refused):
            arrivals = [notice_arrival(received)]
        if arrivals:
            # On the first one: what is missing was missing before it.
            arrivals[0] = arrivals[0]._replace(
                faults={**self._faults, **arrivals[0].faults},
                n_lost=self.n_lost,
                n_refused=self.n_refused,
                notices=tuple(self._notices),
                delay=self._timeline.delay,
            )
            self.n_lost = self.n_refused = 0
        self._instants, self._faults, self._notices = {}, {}, []
        return arrivals


class _Instant(NamedTuple):
    """Samples of one time, and the faults of each module."""

    samples: dict[str, npt.NDArray[Any]]
    faults: dict[str, Faults]


class _PacketTime(NamedTuple):
    """Times of a packet: its stamp, the same moment on the source's clock, and its arrival."""

    time: float
    stamp: Stamp
    received: float

    @property
    def jumped(self) -> bool:
        """Whether the device's clock jumped before this packet."""
        return Fault.CLOCK_JUMP in self.stamp.faults


def n_missing(last: int, sequence: int) -> int:
    """Return the number of packets missing between two values of a sequence counter.

    Example:
        >>> n_missing(2**32 - 2, 1), n_missing(5000, 0)
        (2, 0)
    """
    # Modulo the period, so that a counter that overflows goes on by one.
    step = (sequence - last) % SEQUENCE_PERIOD
    return step - 1 if 0 < step < MIN_COUNTER_RESTART else 0
