"""Assembly of ROS messages into arrivals. No I/O and no clock: times are arguments."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from holdfast.devices.sources.assembler import Assembler, Device
from holdfast.devices.sources.base import Arrival
from holdfast.devices.sources.timeline import is_plausible
from holdfast.devices.sources.xela.decoder import no_calibration
from holdfast.devices.sources.xela.devices import xela_devices
from holdfast.errors import SourceError
from holdfast.sensors import Sensor
from holdfast.sensors.types import Unit
from holdfast_ros.sensor_messages import PAD, PAPILLARRAY, DeviceSample, readings_of, sensors_of

_STAMPS: tuple[Callable[[DeviceSample], float | None], ...] = (
    lambda sample: plausible_time(sample.time),
    lambda sample: plausible_time(sample.stamp),
)
"""Stamps of a sample, the best one first: the device's own, and that in the header."""


class MessageAssembler:
    """Collector of the samples of ROS messages, also after restarts of the publisher.

    Stamps are those of the device's clock; without one, those in the header; without both, the
    times of arrival. Devices of one message with different stamps arrive one after the other. A
    repeated message is no new sample.

    Args:
        names: names of the devices by number; `finger1`, ... by default.
        unit: unit of the readings; a device that sends only newtons gives newtons.
        sensor: layout of the separate sensors with this number of taxels.
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
        self._assembler = Assembler()
        self._stamp: Callable[[DeviceSample], float | None] | None = None

    @property
    def devices(self) -> Mapping[int, Device]:
        """Devices by number; empty before `identify`."""
        return self._assembler.devices

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Sensors by module."""
        return self._assembler.sensors

    @property
    def metadata(self) -> dict[str, Any]:
        """Models of the devices, and the hand."""
        return self._assembler.metadata

    def identify(self, samples: Iterable[DeviceSample]) -> None:
        """Identify the devices from their first samples.

        Raises:
            SourceError: they do not fit the arguments of the assembler.
        """
        by_number = {device_number(sample): sample for sample in samples if has_taxels(sample)}
        for number, sent in by_number.items():
            if sent.counts is not None and self._unit == "N" and not len(sent.forces):
                raise SourceError(no_calibration(number, sent.model))
        # Those of XELA's server have models of their own.
        if any(sent.model in (PAPILLARRAY, PAD) for sent in by_number.values()):
            if unknown := sorted(set(self._names) - set(by_number)):
                there = ", ".join(f"{number} ({sent.model})" for number, sent in by_number.items())
                raise SourceError(f"fingers= names {unknown[0]}; the topic has {there}")
            devices = {number: self._pad(number, sent) for number, sent in by_number.items()}
        else:
            models = {n: (x.model, len(readings_of(x, self._unit))) for n, x in by_number.items()}
            calibrated = self._unit == "N"
            devices = xela_devices(models, self._names, self._sensor, calibrated=calibrated)
        self._assembler.devices = devices
        # One kind for all devices: stamps of two clocks have no common order.
        self._stamp = next(
            (
                stamp
                for stamp in _STAMPS
                if any(stamp(sent) is not None for sent in by_number.values())
            ),
            None,
        )

    def reconnected(self) -> None:
        """Accept any sequence number in the next message, because the publisher is a new one."""
        self._assembler.reconnected()

    def assemble(self, samples: Iterable[DeviceSample], received: float) -> list[Arrival]:
        """Return the arrivals of a message in order of time, none if it has nothing new.

        Args:
            samples: samples of the message.
            received: time of arrival, on the host's monotonic clock [s].
        """
        new = [sample for sample in samples if self._is_new(sample, received)]
        stamps = [received if self._stamp is None else self._stamp(x) for x in new]
        newest = max((stamp for stamp in stamps if stamp is not None), default=None)
        if newest is not None:
            self._assembler.stamp(newest, received)
            # A lost message lacks all of its devices, and counts once.
            n_lost = [0]
            for sample, stamp in zip(new, stamps, strict=True):
                number = device_number(sample)
                n_lost.append(self._assembler.n_missing(sample.sequence, number))
                self._assembler.add(number, readings_of(sample, self._unit), stamp)
            self._assembler.n_lost += max(n_lost)
        elif new:
            self._assembler.refuse("time", "a message has no time, others had", received)
        return self._assembler.finish(received)

    def refuse(self, reason: str, received: float) -> list[Arrival]:
        """Return the arrival that reports an invalid message."""
        self._assembler.refuse("message", f"invalid message: {reason}", received)
        return self._assembler.finish(received)

    def _pad(self, number: int, sample: DeviceSample) -> Device:
        try:
            pad = self._sensor or sensors_of(sample, self._unit)[""]
        except ValueError as cause:
            raise SourceError(str(cause)) from cause
        n_taxels = len(readings_of(sample, self._unit))
        if n_taxels != pad.n_taxels:
            raise SourceError(f"{n_taxels} taxels given, {pad.n_taxels} expected ({pad.name})")
        name = self._names.get(number, f"finger{number}")
        return Device(number, sample.model, {name: pad})

    def _is_new(self, sample: DeviceSample, received: float) -> bool:
        """Return whether it is a new sample of a known device with its number of taxels."""
        number = device_number(sample)
        if number not in self.devices and not has_taxels(sample):
            return False  # the server's entry for a sensor that is off
        stamp = sample.stamp if sample.time is None else sample.time
        return (
            self._assembler.accepts_device(number, received)
            and self._assembler.accepts_taxels(
                number, len(readings_of(sample, self._unit)), received
            )
            and self._assembler.is_new(number, None if stamp is None else (sample.sequence, stamp))
        )


def has_taxels(sample: DeviceSample) -> bool:
    """Return whether it is a sample, and not the server's entry for a sensor that is off."""
    return len(sample.forces if sample.counts is None else sample.counts) > 0


def device_number(sample: DeviceSample) -> int:
    """Return the number of the device; 1 of a maker whose messages have none."""
    return 1 if sample.number is None else sample.number


def plausible_time(time: float | None) -> float | None:
    """Return a time, or None instead of one that is thousands of years away."""
    return time if time is not None and is_plausible(time) else None
