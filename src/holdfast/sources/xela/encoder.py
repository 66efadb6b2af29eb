"""Samples become packets as XELA's server sends them. No I/O and no clock: times are given."""

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.sensors import Hand, Sensor, hand
from holdfast.sources.xela.packet import COUNTER

REST = np.array([32768, 32768, 36000])
"""What a taxel tells that nothing touches [count]."""
RESOLUTION = np.array([0.000628, 0.000628, 0.000729])
"""Of the uSPa46 by its data sheet [N/count]; makes counts of what is in newtons."""
OLD, NEW = VERSIONS = ("1.7", "1.8")
"""Of the server that can be acted."""
WHOLE_HAND = "XR23AHRCPP"
MODELS = {"uskin-curved": "uSCuAH", "uskin-4x4": "uSPa44", "uskin-4x6": "uSPa46"}
"""Models of the built-in sensors; others go by the name of the sensor."""
VERSION_TEXT = "1.8.0b_holdfast"
TEMPERATURE = 303.1
"""Of every taxel [K]."""
NOISE, SPREAD, N_RESTS = 2, 250, 64
"""Of taxels that no recording has: from sample to sample, and from taxel to taxel [count]."""

Samples = Mapping[str, npt.NDArray[Any]]


class Encoder:
    """Packets of XELA's server, out of the samples of a source.

    Modules become the server's sensors 1, 2, ... in their order. All 18 modules of the Allegro
    hand become one sensor, as its server has it; fewer do too where `whole_hand` asks for it,
    and then the others are at rest. Readings in counts are whole numbers from 0 to 65535:
    floats are rounded. Readings in newtons are sent as `calibrated`; their counts are made up
    from a data sheet's resolution. A module with a count that is no number is left out of its
    packet; a sensor without a new sample is left out, of a whole hand the last one stands.

    Args:
        sensors: of each module.
        version: of the server, 1.7 or 1.8.
        whole_hand: send what there is as part of a whole hand.

    Attributes:
        modules: by the server's number, those that it consists of.

    Raises:
        ValueError: there is no such version, or `whole_hand` is asked for and a module is none
            of the hand's.

    Example:
        >>> from holdfast.sensors import sensor
        >>> encoder = Encoder({"thumb": sensor("uskin-4x4")}, version="1.7")
        >>> packet = encoder.packet({"thumb": np.full((16, 3), 0x8000)}, 12.5, 12.5)
        >>> packet.decode()[:62]
        '{"message":0,"time":12.5,"sensors":1,"1":{"data":"8000,8000,80'
    """

    def __init__(
        self,
        sensors: Mapping[str, Sensor],
        *,
        version: str = NEW,
        whole_hand: bool = False,
    ) -> None:
        if version not in VERSIONS:
            raise ValueError(f"version {' or '.join(VERSIONS)} expected, {version!r} given")
        self._version = version
        allegro = hand("allegro-uskin")
        if whole_hand:
            _check_modules(sensors, allegro)
        self._parts: list[_Module | _WholeHand]
        if whole_hand or _is_whole(sensors, allegro):
            self._parts = [_WholeHand(sensors, allegro)]
        else:
            self._parts = [_Module(name, sensor) for name, sensor in sensors.items()]
        self._constant = [_constants(part) for part in self._parts]
        self._counter = 0
        self.modules: dict[int, Sequence[str]] = {
            number: part.names for number, part in enumerate(self._parts, 1)
        }

    @property
    def is_hand(self) -> bool:
        """Whether it is sent as a whole hand, which names its own modules."""
        return isinstance(self._parts[0], _WholeHand)

    @property
    def has_own_stamps(self) -> bool:
        """Whether packets tell the time of each module's sample."""
        return self._version == NEW and not self.is_hand

    def welcome(self) -> bytes:
        """What a client is told first."""
        version = {"version": VERSION_TEXT} if self._version == NEW else {}
        return msgspec.json.encode({"message": "Welcome", **version})

    def packet(
        self,
        samples: Samples,
        time: float,
        sent: float,
        times: Mapping[str, float] | None = None,
    ) -> bytes:
        """The next packet.

        Args:
            samples: (n_taxels, 3) by module.
            time: of the newest of them, since 1970 [s].
            sent: now, since 1970 [s].
            times: of each module's sample, where they differ; told by version 1.8 only.

        Raises:
            ValueError: counts are out of range, or have another shape.
        """
        told: dict[str, Any] = {}
        for number, (part, constant) in enumerate(zip(self._parts, self._constant, strict=True), 1):
            readings = part.readings(samples)
            if readings is not None:
                own = time if times is None or self.is_hand else times[part.names[0]]
                told[str(number)] = self._sensor(number, part, *readings, constant, own)
        top: dict[str, Any] = {"message": self._counter, "time": time, "sensors": len(told)}
        self._counter = (self._counter + 1) % COUNTER
        if self._version == OLD:
            return msgspec.json.encode(top | told)
        top |= {"type": "routine", "version": VERSION_TEXT}
        return msgspec.json.encode(top | told | {"sendtime": sent})

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
        if self._version == OLD:
            return {
                "data": data,
                "sensor": str(number),
                "taxels": len(counts),
                "model": part.model,
                "calibrated": calibrated,
            }
        known = {} if calibrated is None else {"calibrated": calibrated}
        return {
            "time": time,
            "sensor": str(number),
            "data": data,
            "model": part.model,
            "taxels": len(counts),
            **known,
            "integer": flat.tolist(),
            **constant,
        }


class _Module:
    """A module that is a sensor of its own."""

    def __init__(self, name: str, sensor: Sensor) -> None:
        self.names = (name,)
        self.model = MODELS.get(sensor.name, sensor.name)
        self.n_taxels = sensor.n_taxels
        self.rate = sensor.rate
        self._sensor = sensor

    def readings(self, samples: Samples) -> "_Readings | None":
        """Counts and, where it has them, newtons; None without a sample."""
        (name,) = self.names
        return _readings(name, self._sensor, samples[name]) if name in samples else None


class _WholeHand:
    """Modules of one hand as one sensor; those that there are not are at rest."""

    def __init__(self, sensors: Mapping[str, Sensor], whole: Hand) -> None:
        self.names = tuple(whole.modules)
        self.model = WHOLE_HAND
        self.n_taxels = whole.n_taxels
        self.rate = next(iter(sensors.values())).rate
        self._sensors = sensors
        self._places = {name: whole.modules[name].flat_indices for name in sensors}
        self._own = np.concatenate(list(self._places.values()))
        self._rests = _rests(whole.n_taxels)
        self._counts = self._rests[0].copy()
        self._newtons = np.zeros((whole.n_taxels, 3))
        self._calibrated = all(sensor.unit == "N" for sensor in sensors.values())
        self._n_told = 0

    def readings(self, samples: Samples) -> "_Readings | None":
        """Counts and, where it has them, newtons; None without a sample."""
        found = {name: sample for name, sample in samples.items() if name in self._places}
        told = {name: _readings(name, self._sensors[name], one) for name, one in found.items()}
        counts = self._rests[self._n_told % N_RESTS].copy()
        counts[self._own] = self._counts[self._own]
        self._n_told += 1
        for name, one in told.items():
            if one is not None:
                counts[self._places[name]] = one[0]
                self._newtons[self._places[name]] = 0.0 if one[1] is None else one[1]
        self._counts = counts
        return (counts, self._newtons if self._calibrated else None) if any(told.values()) else None


_Readings = tuple[npt.NDArray[np.uint16], npt.NDArray[np.float64] | None]


def _readings(name: str, sensor: Sensor, given: npt.NDArray[Any]) -> _Readings | None:
    """Counts and newtons of a module; None where a count is no number."""
    if given.shape != (sensor.n_taxels, 3):
        raise ValueError(f"{name}: {(sensor.n_taxels, 3)} readings expected, {given.shape} given")
    if sensor.unit == "N":
        made = np.nan_to_num(REST + given / RESOLUTION, nan=float(REST[0]))
        return np.rint(np.clip(made, 0, 65535)).astype(np.uint16), given.astype(np.float64)
    if given.dtype == np.uint16:
        return given.astype(np.uint16), None
    if not np.isfinite(given).all():
        return None
    low, high = given.min(), given.max()
    if not (low > -0.5 and high < 65535.5):
        raise ValueError(
            f"{name}: readings from 0 to 65535 counts expected, {low:.6g} to {high:.6g} given; "
            "packets of a XELA server hold no others"
        )
    return np.rint(given).astype(np.uint16), None


def _constants(part: "_Module | _WholeHand") -> dict[str, Any]:
    """Fields of a sensor that stay the same."""
    temperatures = TEMPERATURE + np.arange(part.n_taxels) % 7 / 10
    return {
        "temp": msgspec.Raw(msgspec.json.encode(temperatures.round(1).tolist())),
        "handedness": "right",
        "ups": msgspec.Raw(msgspec.json.encode([part.rate] * part.n_taxels)),
    }


def _rests(n_taxels: int) -> npt.NDArray[np.uint16]:
    """(N_RESTS, n_taxels, 3) readings of taxels at rest; always the same."""
    random = np.random.default_rng(0)
    base = REST + random.integers(-SPREAD, SPREAD + 1, (1, n_taxels, 3))
    noise = random.integers(-NOISE, NOISE + 1, (N_RESTS, n_taxels, 3))
    return (base + noise).astype(np.uint16)


def is_part_of_hand(sensors: Mapping[str, Sensor]) -> bool:
    """Whether all modules are called, and sized, as an Allegro hand's."""
    try:
        _check_modules(sensors, hand("allegro-uskin"))
    except ValueError:
        return False
    return True


def _is_whole(sensors: Mapping[str, Sensor], whole: Hand) -> bool:
    return set(sensors) == set(whole.modules) and all(
        sensors[name].n_taxels == module.sensor.n_taxels for name, module in whole.modules.items()
    )


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
