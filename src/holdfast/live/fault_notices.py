"""Faults that last, as notices for people: which fingers have them, and what to do."""

import math
from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

from holdfast.contact import Fault, HandEstimate

MIN_FAULT_DURATION = 0.3
"""Time that a fault must last before it is reported [s]."""
MANY_INVALID, INVALID_SECONDS = 10, 60.0
"""Samples with an invalid reading, and the time [s] in which they must lie, to be reported."""
REPEAT_INTERVAL = 10.0
"""Time without a fault after which it is reported as a new one [s]."""


class FaultText(NamedTuple):
    """Texts about a fault.

    Attributes:
        words: name of the fault, in a few words.
        advice: what happened, and what to do.
    """

    words: str
    advice: str


_NEW_TARE = "open the hand, then press Tare on the page, or start this command again"

FAULT_TEXTS: Mapping[Fault, FaultText] = {
    Fault.NOT_FINITE: FaultText(
        "not a number", "readings are not numbers: check the calibration of the sensor"
    ),
    Fault.STUCK: FaultText(
        "stuck", "readings do not change any more: check the cable, then restart the device"
    ),
    Fault.SATURATED: FaultText(
        "saturated",
        "readings are at the end of the sensor's range: reduce the force, or check the cable",
    ),
    Fault.TARE_LOADED: FaultText(
        "loaded at tare",
        f"the tare was taken in contact: {_NEW_TARE}; "
        "if it stays, z of the sensor points inwards (docs/sensors.md)",
    ),
    Fault.DEAD: FaultText(
        "dead",
        "readings have not changed since the start: check the cable of a finger that is dead as a "
        "whole, and leave single taxels out by --ignore FINGER:TAXEL",
    ),
    Fault.NOISY: FaultText(
        "noisy", "taxels are far noisier than others: leave them out by --ignore FINGER:TAXEL"
    ),
    Fault.OUT_OF_RANGE: FaultText(
        "out of range", "readings are outside the range of the sensor: check its configuration"
    ),
    Fault.TARE_DRIFT: FaultText("tare drifts", f"the force crept away from zero: {_NEW_TARE}"),
    Fault.TAXEL_COUNT: FaultText(
        "wrong number of taxels",
        "packets have another number of taxels than the sensor: check the device's configuration",
    ),
    Fault.PACKET_GAP: FaultText(
        "packets missing", "no packets arrive: check the cable and the server of the sensor"
    ),
    Fault.LATE: FaultText(
        "late", "samples arrive late: check the network, and the load of this computer"
    ),
    Fault.CLOCK_JUMP: FaultText(
        "clock jumped", "the clock of the device jumped: synchronise it, or restart the device"
    ),
    Fault.RATE: FaultText(
        "rate changed", "the device has changed its rate: start this command again"
    ),
    Fault.OFFSET: FaultText(
        "offset", "all readings have jumped together: check the cable and the supply of the sensor"
    ),
    Fault.FIELD: FaultText(
        "field",
        f"all taxels changed nearly alike, by a magnetic field or a load: {_NEW_TARE}; "
        "keep magnets and motors away",
    ),
    Fault.INVALID: FaultText(
        "invalid readings",
        "readings jump, or fall to zero: check the cable and the driver's timing",
    ),
    Fault.REZEROED: FaultText(
        "new zero",
        "all readings fell to zero at once: the object left, or the driver took a new baseline in "
        f"the grip; open the hand and {_NEW_TARE}",
    ),
    Fault.REPEATED: FaultText(
        "repeated", "earlier readings come again in their order: restart the device or its server"
    ),
    Fault.EQUAL_TAXELS: FaultText(
        "equal taxels",
        "taxels have the same readings while they change: check the cable and the channels, or "
        "leave them out by --ignore FINGER:TAXEL",
    ),
    Fault.COPIED: FaultText(
        "copied", "fingers have the same readings: one sensor is read twice; check the channels"
    ),
    Fault.SLOW: FaultText(
        "slow",
        "readings change less than 30 times a second, and are repeated between: raise the rate of "
        "the sensor, not that of its server",
    ),
}
"""Texts of every fault, for pages and terminals."""


class Problem(NamedTuple):
    """Fault that some fingers have.

    Attributes:
        fault: the fault.
        fingers: names of the fingers.
    """

    fault: Fault
    fingers: tuple[str, ...]

    @property
    def text(self) -> str:
        """The fingers, what happened, and what to do."""
        return f"{', '.join(self.fingers)}: {FAULT_TEXTS[self.fault].advice}"


class FaultWatch:
    """Memory of the faults of a hand that reports those that last, once each.

    Attributes:
        current: problems that last at the newest estimate.

    Example:
        >>> from holdfast.contact import ContactEstimate, ContactState, Reason
        >>> watch = FaultWatch()
        >>> for time in (0.0, 0.2, 0.4, 0.6):
        ...     thumb = ContactEstimate(
        ...         time, ContactState.UNKNOWN, Reason.FAULT, 0.0, 0.0, (0, 0, 0), (Fault.LATE,)
        ...     )
        ...     hand = HandEstimate(time, ContactState.UNKNOWN, {"thumb": thumb})
        ...     print(time, [problem.text for problem in watch.update(hand)])
        0.0 []
        0.2 []
        0.4 ['thumb: samples arrive late: check the network, and the load of this computer']
        0.6 []
    """

    def __init__(self) -> None:
        self.current: list[Problem] = []
        # When each fault began, of those that last now; and when each was last seen to last.
        self._since: dict[tuple[Fault, str], float] = {}
        self._reported: dict[tuple[Fault, str], float] = {}
        # Times of the last `MANY_INVALID` invalid readings; with fewer, the first is -inf.
        self._invalid: dict[str, deque[float]] = {}

    def update(self, estimate: HandEstimate) -> list[Problem]:
        """Return the problems that have begun to last."""
        now = estimate.time
        faults = [
            (fault, name) for name, finger in estimate.fingers.items() for fault in finger.faults
        ]
        self._since = {key: min(now, self._since.get(key, now)) for key in faults}
        lasting = [key for key in faults if now - self._since[key] >= MIN_FAULT_DURATION]
        # Readings of a single sample that cannot be true never last: many of them are reported.
        for name, finger in estimate.fingers.items():
            times = self._invalid.setdefault(name, deque([-math.inf], MANY_INVALID))
            if Fault.INVALID in finger.faults and finger.time != times[-1]:
                times.append(finger.time)
        since = now - INVALID_SECONDS
        often = [
            (Fault.INVALID, name) for name, times in self._invalid.items() if times[0] >= since
        ]
        lasting += [key for key in often if key not in lasting]
        new = [k for k in lasting if now - self._reported.get(k, -math.inf) >= REPEAT_INTERVAL]
        self._reported.update(dict.fromkeys(lasting, now))
        self.current = _problems(lasting)
        return _problems(new)


def _problems(faults: list[tuple[Fault, str]]) -> list[Problem]:
    """Return one problem for each fault, in the order of `Fault`."""
    if not faults:
        return []
    return [
        Problem(fault, tuple(name for other, name in faults if other is fault))
        for fault in Fault
        if any(other is fault for other, _ in faults)
    ]
