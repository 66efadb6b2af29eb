"""Encoding of samples as packets of XELA's server. No I/O and no clock: times are arguments."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.devices.sources.assembler import SEQUENCE_PERIOD
from holdfast.devices.sources.base import ModuleSamples
from holdfast.sensors import Hand, Sensor, hand
from holdfast.sensors.xela_models import NEWTONS_PER_NORMAL_COUNT, NEWTONS_PER_SHEAR_COUNT

REST_READING = np.array([32768, 32768, 36000])
"""Reading of a taxel without contact [count]."""
NEWTONS_PER_TAXEL_COUNT = np.array(
    [NEWTONS_PER_SHEAR_COUNT, NEWTONS_PER_SHEAR_COUNT, NEWTONS_PER_NORMAL_COUNT]
)
"""Resolution of the axes of a taxel frame [N/count]; converts newtons to counts."""
OLD_VERSION, NEW_VERSION = VERSIONS = ("1.7", "1.8")
"""Server versions that can be encoded."""
WHOLE_HAND_MODEL = "XR23AHRCPP"
XELA_MODELS = {"uskin-curved": "uSCuAH", "uskin-4x4": "uSPa44", "uskin-4x6": "uSPa46"}
"""XELA's model of each built-in sensor; any other sensor keeps its own name."""
VERSION_TEXT = "1.8.0b_holdfast"
TEMPERATURE = 303.1
"""Temperature of every taxel [K]."""
REST_NOISE, REST_SPREAD, N_REST_SAMPLES = 2, 250, 64
"""Taxels without a recording: largest deviation between samples and between taxels [count]."""
MAX_MODULE_WAIT = 1.0
"""Longest wait for the first sample of a module, by the times of the source [s]."""


class XelaEncoder:
    """Encoder of a source's samples as packets of XELA's server.

    Modules become the server's sensors 1, 2, ... in their order. All 18 modules of the Allegro
    hand become one sensor, as on its server. With `whole_hand`, fewer modules of the hand
    become one sensor too, and the other modules are at rest.

    Readings in counts must be from 0 to 65535; floats are rounded. Readings in newtons are sent
    as `calibrated`, and their counts are computed from the resolution of a data sheet. A module
    with a count that is not finite is left out of its packet. A sensor without a new sample is
    left out as well; a module of a whole hand repeats its last sample instead.

    Args:
        sensors: sensors by module.
        version: version of the server, 1.7 or 1.8.
        whole_hand: send the modules as part of a whole hand.

    Attributes:
        modules: names of the modules of each of the server's sensors, by number.

    Raises:
        ValueError: the version is not known, or `whole_hand` is set and a module does not
            belong to the hand.

    Example:
        >>> from holdfast.sensors import sensor
        >>> encoder = XelaEncoder({"thumb": sensor("uskin-4x4")}, version="1.7")
        >>> packet = encoder.packet({"thumb": np.full((16, 3), 0x8000)}, 12.5, 12.5)
        >>> packet.decode()[:62]
        '{"message":0,"time":12.5,"sensors":1,"1":{"data":"8000,8000,80'
    """

    def __init__(
        self,
        sensors: Mapping[str, Sensor],
        *,
        version: str = NEW_VERSION,
        whole_hand: bool = False,
    ) -> None:
        if version not in VERSIONS:
            raise ValueError(f"version {' or '.join(VERSIONS)} expected, {version!r} given")
        self._version = version
        allegro = hand("allegro-uskin")
        if whole_hand:
            _check_modules(sensors, allegro)
        self._parts: list[_Module | _WholeHand]
        is_whole = set(sensors) == set(allegro.modules) and all(
            sensors[name].n_taxels == module.sensor.n_taxels
            for name, module in allegro.modules.items()
        )
        if whole_hand or is_whole:
            self._parts = [_WholeHand(sensors, allegro)]
        else:
            self._parts = [_Module(name, sensor) for name, sensor in sensors.items()]
        # Fields of a sensor that are the same in every packet are encoded once.
        self._constant: list[dict[str, Any]] = []
        for part in self._parts:
            temperatures = TEMPERATURE + np.arange(part.n_taxels) % 7 / 10
            rates = [part.rate] * part.n_taxels
            self._constant.append(
                {
                    "temp": msgspec.Raw(msgspec.json.encode(temperatures.round(1).tolist())),
                    "handedness": "right",
                    "ups": msgspec.Raw(msgspec.json.encode(rates)),
                }
            )
        self._counter = 0
        self.modules: dict[int, Sequence[str]] = {
            number: part.names for number, part in enumerate(self._parts, 1)
        }

    @property
    def is_hand(self) -> bool:
        """Whether the modules are sent as one whole hand, whose modules have fixed names."""
        return isinstance(self._parts[0], _WholeHand)

    @property
    def has_own_stamps(self) -> bool:
        """Whether packets hold the time of each module's sample."""
        return self._version == NEW_VERSION and not self.is_hand

    def welcome(self) -> bytes:
        """Return the first message to a client."""
        version = {"version": VERSION_TEXT} if self._version == NEW_VERSION else {}
        return msgspec.json.encode({"message": "Welcome", **version})

    def packet(
        self,
        samples: ModuleSamples,
        time: float,
        sent: float,
        times: Mapping[str, float] | None = None,
    ) -> bytes:
        """Return the next packet.

        Args:
            samples: (n_taxels, 3) by module.
            time: time of the newest sample, since 1970 [s].
            sent: current time, since 1970 [s].
            times: time of each module's sample, if they differ; only in version 1.8.

        Raises:
            ValueError: counts are out of range or have another shape.
        """
        sensors: dict[str, Any] = {}
        for number, (part, constant) in enumerate(zip(self._parts, self._constant, strict=True), 1):
            readings = part.readings(samples)
            if readings is not None:  # a server leaves out a sensor without a sample
                stamp = time if times is None or self.is_hand else times[part.names[0]]
                sensors[str(number)] = self._sensor(number, part, *readings, constant, stamp)
        top: dict[str, Any] = {"message": self._counter, "time": time, "sensors": len(sensors)}
        self._counter = (self._counter + 1) % SEQUENCE_PERIOD
        if self._version == OLD_VERSION:
            return msgspec.json.encode(top | sensors)
        top |= {"type": "routine", "version": VERSION_TEXT}
        return msgspec.json.encode(top | sensors | {"sendtime": sent})

    def _sensor(
        self,
        number: int,
        part: "_Module | _WholeHand",
        counts: npt.NDArray[np.uint16],
        newtons: npt.NDArray[np.float64] | None,
        constant: Mapping[str, Any],
        time: float,
    ) -> dict[str, Any]:
        flat = counts.ravel()
        data = flat.astype(">u2").tobytes().hex(",", 2).upper()
        calibrated = None if newtons is None else newtons.ravel().tolist()
        if self._version == OLD_VERSION:
            return {
                "data": data,
                "sensor": str(number),
                "taxels": len(counts),
                "model": part.model,
                "calibrated": calibrated,
            }
        newton_fields = {} if calibrated is None else {"calibrated": calibrated}
        return {
            "time": time,
            "sensor": str(number),
            "data": data,
            "model": part.model,
            "taxels": len(counts),
            **newton_fields,
            "integer": flat.tolist(),
            **constant,
        }


class SampleBatch(NamedTuple):
    """Samples of one packet.

    Attributes:
        samples: newest sample of each module.
        time: time of the newest sample [s].
        times: time of each module's sample [s].
    """

    samples: ModuleSamples
    time: float
    times: Mapping[str, float]


class SampleBatcher:
    """Collector of samples into packets that hold all modules.

    Samples arrive module by module, but a new client learns all modules from one packet. If
    packets hold the time of each module's sample, each new sample is passed on at once, together
    with the last samples of the other modules. Without these times, the samples of the other
    modules would look new; then samples wait until every module has one, or until a module has
    the next one.

    Args:
        modules: names of the modules.
        own_stamps: whether packets hold the time of each module's sample.

    Example:
        >>> batcher = SampleBatcher(("a", "b"), own_stamps=False)
        >>> [len(list(batcher.add({name: None}, t))) for t, name in enumerate("abba")]
        [0, 1, 0, 1]
    """

    def __init__(self, modules: Iterable[str], *, own_stamps: bool) -> None:
        self._modules = frozenset(modules)
        self._own_stamps = own_stamps
        # The newest sample of each module and its time; which of them were not passed on; and
        # when the first came. `add` fills them, `flush` passes them on.
        self._samples: dict[str, npt.NDArray[Any]] = {}
        self._times: dict[str, float] = {}
        self._new: set[str] = set()
        self._first_time: float | None = None

    def add(self, samples: ModuleSamples, time: float) -> Iterator[SampleBatch]:
        """Add the samples of one instant [s]; yield the batches that are complete, in order."""
        if self._first_time is None:
            self._first_time = time
        # A module has its next sample: the packet before is as complete as it gets.
        if not self._own_stamps and not self._new.isdisjoint(samples):
            yield from self.flush()
        self._samples.update(samples)
        self._times.update(dict.fromkeys(samples, time))
        self._new.update(samples)
        if self._own_stamps or self._new >= self._required(time):
            yield from self.flush()

    def flush(self) -> Iterator[SampleBatch]:
        """Yield the samples that were not passed on yet, if all required modules have one."""
        newest = max(self._times.values(), default=0.0)
        if self._new and self._samples.keys() >= self._required(newest):
            self._new.clear()
            yield SampleBatch(dict(self._samples), newest, dict(self._times))

    def _required(self, time: float) -> frozenset[str]:
        """Return the modules that a batch must hold: after a while, only those with samples."""
        if self._first_time is None or time - self._first_time < MAX_MODULE_WAIT:
            return self._modules
        return frozenset(self._samples)


_Readings = tuple[npt.NDArray[np.uint16], npt.NDArray[np.float64] | None]
"""Readings of a sensor in counts and, if it has them, in newtons."""


class _Module:
    """A module that is a sensor of the server by itself."""

    def __init__(self, name: str, sensor: Sensor) -> None:
        self.names = (name,)
        self.model = XELA_MODELS.get(sensor.name, sensor.name)
        self.n_taxels = sensor.n_taxels
        self.rate = sensor.rate
        self._sensor = sensor

    def readings(self, samples: ModuleSamples) -> _Readings | None:
        """Return the readings, or None without a sample."""
        (name,) = self.names
        return _readings(name, self._sensor, samples[name]) if name in samples else None


class _WholeHand:
    """All modules of a hand as one sensor of the server; missing modules are at rest."""

    def __init__(self, sensors: Mapping[str, Sensor], whole: Hand) -> None:
        self.names = tuple(whole.modules)
        self.model = WHOLE_HAND_MODEL
        self.n_taxels = whole.n_taxels
        self.rate = next(iter(sensors.values())).rate
        self._sensors = sensors
        self._indices = {name: whole.modules[name].flat_indices for name in sensors}
        self._present = np.concatenate(list(self._indices.values()))
        random = np.random.default_rng(0)  # taxels at rest are always the same
        shape = (N_REST_SAMPLES, whole.n_taxels, 3)
        base = REST_READING + random.integers(-REST_SPREAD, REST_SPREAD + 1, (1, *shape[1:]))
        self._rest = (base + random.integers(-REST_NOISE, REST_NOISE + 1, shape)).astype(np.uint16)
        self._counts = self._rest[0].copy()
        self._newtons = np.zeros((whole.n_taxels, 3))
        self._calibrated = all(sensor.unit == "N" for sensor in sensors.values())
        self._n_packets = 0

    def readings(self, samples: ModuleSamples) -> _Readings | None:
        """Return the readings, or None without a sample."""
        used = {name: sample for name, sample in samples.items() if name in self._indices}
        read = {name: _readings(name, self._sensors[name], x) for name, x in used.items()}
        # Taxels of modules that the source lacks move by their noise, as real ones do: constant
        # readings would be the fault `stuck`.
        counts = self._rest[self._n_packets % N_REST_SAMPLES].copy()
        counts[self._present] = self._counts[self._present]
        self._n_packets += 1
        for name, x in read.items():
            if x is not None:
                counts[self._indices[name]] = x[0]
                self._newtons[self._indices[name]] = 0.0 if x[1] is None else x[1]
        self._counts = counts
        return (counts, self._newtons if self._calibrated else None) if any(read.values()) else None


def _readings(name: str, sensor: Sensor, sample: npt.NDArray[Any]) -> _Readings | None:
    """Return the readings of a module; None if a count is not finite."""
    if sample.shape != (sensor.n_taxels, 3):
        raise ValueError(f"{name}: {(sensor.n_taxels, 3)} readings expected, {sample.shape} given")
    if sensor.unit == "N":
        counts = np.nan_to_num(
            REST_READING + sample / NEWTONS_PER_TAXEL_COUNT, nan=float(REST_READING[0])
        )
        return np.rint(np.clip(counts, 0, 65535)).astype(np.uint16), sample.astype(np.float64)
    if sample.dtype == np.uint16:
        return sample.astype(np.uint16), None
    if not np.isfinite(sample).all():
        return None
    # Limits by half a count: what rounds to a uint16 is one.
    low, high = sample.min(), sample.max()
    if not (low > -0.5 and high < 65535.5):
        raise ValueError(
            f"{name}: readings from 0 to 65535 counts expected, {low:.6g} to {high:.6g} given; "
            "packets of a XELA server hold no others"
        )
    return np.rint(sample).astype(np.uint16), None


def is_part_of_hand(sensors: Mapping[str, Sensor]) -> bool:
    """Return whether all modules have names and numbers of taxels of an Allegro hand's."""
    try:
        _check_modules(sensors, hand("allegro-uskin"))
    except ValueError:
        return False
    return True


def _check_modules(sensors: Mapping[str, Sensor], whole: Hand) -> None:
    for name, sensor in sensors.items():
        if name not in whole.modules:
            raise ValueError(
                f"--whole-hand: {name} is no module of {whole.name}; "
                f"it has {', '.join(whole.modules)}"
            )
        n_expected = whole.modules[name].sensor.n_taxels
        if sensor.n_taxels != n_expected:
            raise ValueError(
                f"--whole-hand: {sensor.n_taxels} taxels given for {name}, {n_expected} expected"
            )
