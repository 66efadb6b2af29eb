"""Types of sensors and hands: taxel poses, and indices in the flat packet of a hand."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.files import check_keys, read_input
from holdfast.sensors.taxel_numbers import taxel_number

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Unit = Literal["count", "N"]

MAX_RATE = 1e6
"""Maximum sample rate of a sensor [Hz]."""
MAX_SENSOR_FILE_SIZE = 1 << 26
"""Maximum size of the file of a sensor [bytes]."""

MAGNETIC_SENSORS = ("uskin-curved", "uskin-4x4", "uskin-4x6", "anyskin")
"""Built-in sensors whose taxels are magnetometers. Files do not repeat it for them.

The sections of `gtac` lie on different fingers, and half of what they read is no field."""

RESTING_SENSORS = ("gtac", "paxini-120", "xhand")
"""Built-in sensors that rest at exact zero. Files do not repeat it for them."""

SAID_BY_NAME = {"magnetic": MAGNETIC_SENSORS, "rests_at_zero": RESTING_SENSORS}
"""Fields of a sensor that follow from its name, where they are None."""

ROTATION_TOLERANCE = 1e-5
"""Maximum error of a rotation matrix as read; tables are rounded to six digits."""

EXACT_TOLERANCE = 1e-14
"""A rotation matrix with a smaller error is kept unchanged, so that writing and reading a sensor
does not change it."""


EQUAL_TOLERANCE = 1e-9
"""Maximum difference of two equal positions [m], components of rotations or relative rates. The
last digits depend on the C library."""


@dataclass(frozen=True, eq=False)
class Sensor:
    """A tactile sensor: the pose of each of its taxels in the fingertip frame.

    Rotation matrices may have an error of 1e-5; the nearest exact ones are stored.

    Attributes:
        name: name of the sensor.
        positions: (n_taxels, 3) positions of the taxels in the fingertip frame [m].
        rotations: (n_taxels, 3, 3) R_i, from taxel frame to fingertip frame. The z axis of a
            taxel is its outward normal, positive when pressed.
        normal: (3,) unit vector of the sensor's normal in the fingertip frame.
        rate: nominal sample rate [Hz].
        unit: unit of raw readings, `count` or `N`.
        range: smallest and largest reading that the device can send; None if unknown. Readings
            of most taxels near an end of it are a fault.
        magnetic: whether each taxel is a magnetometer, which also reads the earth's field. None
            stands for what is known by the name: True for the built-in `uskin-*` and `anyskin`.
        step: smallest change of a reading [unit]; None if unknown.
        rests_at_zero: whether every reading is exactly zero without contact. None takes what the
            name of a built-in sensor says, false for any other.

    Raises:
        ValueError: a shape is wrong, a number is not finite, a rotation is not valid, or the range
            contradicts `step` or `rests_at_zero`.
    """

    name: str
    positions: Array
    rotations: Array
    normal: Array
    rate: float
    unit: Unit = "count"
    range: tuple[float, float] | None = None
    magnetic: bool | None = None
    step: float | None = None
    rests_at_zero: bool | None = None

    def __post_init__(self) -> None:
        if not self.name:
            raise ValueError("a sensor needs a name, '' given")
        positions = _array(self.positions, f"positions of {self.name}", (None, 3))
        n_taxels = len(positions)
        rotations = _array(self.rotations, f"rotations of {self.name}", (n_taxels, 3, 3))
        normal = _array(self.normal, f"normal of {self.name}", (3,))
        longest = float(np.abs(normal).max())
        if n_taxels == 0 or longest == 0:
            raise ValueError(f"{self.name}: at least one taxel and a normal that is not zero")
        if not 0 < self.rate <= MAX_RATE:
            raise ValueError(f"{self.name}: a rate up to 1 MHz expected, {self.rate} given")
        if self.unit not in ("count", "N"):
            raise ValueError(f"{self.name}: unit 'count' or 'N' expected, {self.unit!r} given")
        for field, names in SAID_BY_NAME.items():
            flag = getattr(self, field)
            flag = self.name in names if flag is None else flag
            if not isinstance(flag, bool):
                raise ValueError(f"{self.name}: {field} true or false expected, {flag!r} given")
            object.__setattr__(self, field, flag)
        if self.range is not None:
            ends = _array(self.range, f"range of {self.name}", (2,))
            low, high = ends.tolist()
            if low >= high:
                raise ValueError(
                    f"range of {self.name}: smallest, largest expected, {low}, {high} given"
                )
            object.__setattr__(self, "range", (low, high))
        self._check_step()
        rotations = _exact_rotations(rotations, self.name)
        length = float(np.linalg.norm(normal)) if longest < 1e100 else np.inf
        if not 1e-100 < length < np.inf:  # the squares in the norm overflow, or all become zero
            normal = normal / longest
            length = float(np.linalg.norm(normal))
        # Values hold read-only arrays: a sensor is shared by models, recordings and streams.
        for name, values in (
            ("positions", positions), ("rotations", rotations), ("normal", normal / length)
        ):  # fmt: skip
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def _check_step(self) -> None:
        low, high = self.range or (-np.inf, np.inf)
        if self.step is not None:
            is_number = isinstance(self.step, int | float) and not isinstance(self.step, bool)
            if not (is_number and 0 < self.step < np.inf and self.step <= high - low):
                expected = f"a step above 0, within the range of {low:g} to {high:g}, expected"
                raise ValueError(f"{self.name}: {expected}, {self.step!r} given")
            object.__setattr__(self, "step", float(self.step))
        if self.rests_at_zero and not low <= 0 <= high:
            raise ValueError(f"{self.name}: a range with zero expected, {low:g} to {high:g} given")

    def __repr__(self) -> str:
        return f"Sensor({self.name!r}, {self.n_taxels} taxels, {self.rate:g} Hz, {self.unit})"

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt(self)

    @property
    def n_taxels(self) -> int:
        """Number of taxels."""
        return len(self.positions)

    def __eq__(self, other: object) -> bool:
        """Return whether two sensors are the same, but for the last digits of numbers."""
        if self is other or not isinstance(other, Sensor):
            return self is other
        fields_of_self, fields_of_other = (
            (x.name, x.n_taxels, x.unit, x.range, x.magnetic, x.step, x.rests_at_zero)
            for x in (self, other)
        )
        return (
            fields_of_self == fields_of_other
            and abs(self.rate - other.rate) <= EQUAL_TOLERANCE * self.rate
            and all(
                np.abs(mine - two).max() <= EQUAL_TOLERANCE
                for mine, two in (
                    (self.positions, other.positions),
                    (self.rotations, other.rotations),
                    (self.normal, other.normal),
                )
            )
        )

    def __hash__(self) -> int:
        # Without the numbers that are compared with a tolerance: equal sensors have one hash.
        return hash((self.name, self.n_taxels))

    def to_dict(self) -> dict[str, Any]:
        """Return the sensor as plain data, in the form that `from_json` reads."""
        fields: dict[str, Any] = {
            "name": self.name,
            "positions": self.positions.tolist(),
            "rotations": self.rotations.tolist(),
            "normal": self.normal.tolist(),
            "rate": self.rate,
            "unit": self.unit,
            "range": None if self.range is None else list(self.range),
        }
        # Only what the name does not say: files of built-in sensors are as before version 0.4.
        for field in ("magnetic", "step", "rests_at_zero"):
            value = getattr(self, field)
            if value not in (None, self.name in SAID_BY_NAME.get(field, ())):
                fields[field] = value
        return fields

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Make a sensor of the data that `to_dict` returns.

        Up to version 0.2 the range was called `limits`.

        Raises:
            ValueError: a field is missing, unknown, or not valid for `Sensor`.
        """
        data = with_range(data)
        needed = {"name", "positions", "rotations", "normal", "rate"}
        allowed = needed | {"unit", "range", "magnetic", "step", "rests_at_zero"}
        if unknown := sorted(set(data) - allowed):
            raise ValueError(f"unknown fields {unknown} in a sensor; it has {sorted(allowed)}")
        if missing := sorted(needed - set(data)):
            raise ValueError(f"fields {missing} are missing in a sensor; it needs {sorted(needed)}")
        return cls(**{**data, "name": str(data["name"]), "rate": float(data["rate"])})

    @classmethod
    def from_json(cls, path: str | Path) -> Self:
        """Read a sensor from a JSON file with the fields of `Sensor`.

        Raises:
            ValueError: the file is not a JSON object, or its fields are not valid.
            OSError: the file cannot be read.
        """
        try:
            text = read_input(path, MAX_SENSOR_FILE_SIZE)
            check_keys(text)
            data = msgspec.json.decode(text, type=dict[str, Any])
        except (ValueError, RecursionError) as cause:  # msgspec's too
            raise ValueError(f"{path} is not a JSON object of a sensor: {cause}") from cause
        try:
            return cls.from_dict(data)
        except (TypeError, ValueError, ArithmeticError) as cause:
            raise ValueError(f"{path}: {cause}") from cause

    @classmethod
    def from_urdf(
        cls,
        path: str | Path,
        base: str,
        *,
        match: str = "taxel",
        rate: float = 150.0,
        normal: npt.ArrayLike = (0.0, 0.0, 1.0),
    ) -> Self:
        """Read a sensor from a URDF file: its taxels are the joints with `match` in their name.

        Args:
            path: path of a URDF file; a xacro file must be expanded first.
            base: link whose frame is the fingertip frame.
            match: text that the names of all taxel joints contain.
            rate: nominal sample rate [Hz].
            normal: normal of the sensor, in the frame of `base`.

        Raises:
            ValueError: the file is not a URDF file, or the link or the joints do not exist.
            OSError: the file cannot be read.
        """
        from holdfast.sensors.urdf import taxel_poses

        positions, rotations = taxel_poses(Path(path), base, match)
        name = Path(path).stem
        return cls(name, positions, rotations, np.asarray(normal, dtype=float), rate)


@dataclass(frozen=True, eq=False)
class HandModule:
    """One sensor of a hand: its taxels in the flat packet, and their poses on the hand.

    Attributes:
        sensor: type of the sensor.
        flat_indices: (n_taxels,) index of taxel 1, 2, ... in the flat packet of the hand, from 0.
        link: link of the hand that carries the sensor.
        positions: (n_taxels, 3) positions in the frame of that link [m].
        rotations: (n_taxels, 3, 3) from taxel frame to the frame of that link.
        grid: (n_taxels, 2) row and column of each taxel on a flat map of the hand.

    Raises:
        ValueError: a shape is wrong, a number is not finite, or a rotation is not valid.
    """

    sensor: Sensor
    flat_indices: npt.NDArray[np.int64]
    link: str
    positions: Array
    rotations: Array
    grid: npt.NDArray[np.int64]

    def __post_init__(self) -> None:
        n, what = self.sensor.n_taxels, f"of {self.sensor.name} on {self.link}"
        rotations = _array(self.rotations, f"rotations {what}", (n, 3, 3))
        exact = _exact_rotations(rotations, f"{self.sensor.name} on {self.link}")
        flat = _array(self.flat_indices, f"flat indices {what}", (n,)).astype(np.int64)
        grid = _array(self.grid, f"grid {what}", (n, 2)).astype(np.int64)
        positions = _array(self.positions, f"positions {what}", (n, 3))
        for name, values in (
            ("positions", positions), ("rotations", exact), ("flat_indices", flat), ("grid", grid)
        ):  # fmt: skip
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt(self)


@dataclass(frozen=True, eq=False)
class Hand:
    """A hand with sensors that report in one flat packet.

    Attributes:
        name: name of the hand.
        modules: its sensors by name; fingertips are `thumb`, `index`, `middle`, `ring`.

    Raises:
        ValueError: the flat indices of the modules are not 0, 1, ..., n_taxels - 1, each once.
    """

    name: str
    modules: Mapping[str, HandModule]

    def __post_init__(self) -> None:
        # Each index once: else `split` would give a reading to two modules, or to none.
        flat = np.sort(np.concatenate([m.flat_indices for m in self.modules.values()]))
        if not np.array_equal(flat, np.arange(len(flat))):
            raise ValueError(f"{self.name}: every flat index must belong to exactly one module")
        object.__setattr__(self, "modules", MappingProxyType(dict(self.modules)))

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt(self)

    @property
    def n_taxels(self) -> int:
        """Number of taxels of all modules."""
        return sum(module.sensor.n_taxels for module in self.modules.values())

    def to_dict(self) -> dict[str, Any]:
        """Return the hand as plain data: of each module its sensor, link and flat indices."""
        modules = {
            name: {
                "sensor": module.sensor.name,
                "n_taxels": module.sensor.n_taxels,
                "link": module.link,
                "flat_indices": module.flat_indices,
            }
            for name, module in self.modules.items()
        }
        return {"name": self.name, "n_taxels": self.n_taxels, "modules": modules}

    def split(self, flat: npt.ArrayLike) -> dict[str, npt.NDArray[Any]]:
        """Split flat packets into the readings of each module.

        Args:
            flat: (..., n_taxels, 3) in the order of the packet.

        Returns:
            (..., n_taxels of the module, 3) by module.

        Raises:
            ValueError: `flat` has another number of taxels or axes.
        """
        readings = np.asarray(flat)
        if readings.shape[-2:] != (self.n_taxels, 3):
            raise ValueError(
                f"({self.n_taxels}, 3) taxels and axes expected for {self.name}, "
                f"{readings.shape[-2:]} given"
            )
        return {name: readings[..., m.flat_indices, :] for name, m in self.modules.items()}


def rebuilt(value: Any) -> tuple[Any, ...]:  # noqa: ANN401 (any dataclass)
    """Return how pickle and copy make a value: by its constructor, which locks its arrays.

    Read-only mappings cannot be pickled, for example for a worker process; they become
    dictionaries.
    """
    return type(value), tuple(_plain(getattr(value, part.name)) for part in fields(value))


def _plain(part: object) -> object:
    if isinstance(part, Mapping):
        return {key: _plain(item) for key, item in part.items()}
    return part


def _array(values: npt.ArrayLike, what: str, shape: tuple[int | None, ...]) -> Array:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as cause:
        raise ValueError(f"{what}: numbers in a regular array expected") from cause
    matches = array.ndim == len(shape) and all(
        want in (None, got) for want, got in zip(shape, array.shape, strict=True)
    )
    if not matches:
        wanted = tuple("n" if size is None else size for size in shape)
        raise ValueError(f"{what}: shape {wanted} expected, {array.shape} given")
    if not np.isfinite(array).all():
        raise ValueError(f"{what}: finite numbers expected, NaN or infinity given")
    return array


def _exact_rotations(rotations: Array, name: str) -> Array:
    """Return the nearest rotation matrices, by polar decomposition."""
    if np.abs(rotations).max(initial=0.0) > 2:
        raise ValueError(f"{name}: components of rotations from -1 to 1 expected")
    # Tables have six digits, and what is no exact rotation changes the length of a force.
    left, _, right = np.linalg.svd(rotations)
    exact: Array = left @ right
    error = np.abs(exact - rotations).max(axis=(1, 2))
    worst = int(error.argmax())
    if error[worst] > ROTATION_TOLERANCE:
        raise ValueError(
            f"{name}: the rotation of taxel {taxel_number(worst)} is {error[worst]:.1e} away from "
            f"a proper rotation; at most {ROTATION_TOLERANCE:.0e} expected"
        )
    signs = np.linalg.det(exact)
    if signs.min() < 0:
        raise ValueError(
            f"{name}: the rotation of taxel {taxel_number(int(signs.argmin()))} is a reflection "
            "(determinant -1); a rotation expected"
        )
    return rotations if error[worst] < EXACT_TOLERANCE else exact


def with_range(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a sensor with the range under its present name."""
    if "limits" not in fields or "range" in fields:
        return dict(fields)
    return {"range" if key == "limits" else key: value for key, value in fields.items()}
