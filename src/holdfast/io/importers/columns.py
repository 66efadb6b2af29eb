"""The layout of numbers in a file: time, unit, recordings, fingers, taxels and axes.

It is the same for tables, arrays and bags. It is written as in `--columns`, such as
`time=stamp:ms,taxels=2..16`; `--axes` and `--unit` stand beside it.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from holdfast.errors import RecordingError
from holdfast.io.importers.times import TIME_UNITS
from holdfast.sensors import Sensor

READING_UNITS = {
    "N": {"N": 1.0, "mN": 1e-3, "g": 9.80665e-3},
    "count": {"count": 1.0, "uT": 1.0, "mT": 1e3},
}
"""Factor of each unit of readings, by the unit that is kept: 1 uT is kept as 1 count."""
THREE_AXES = "three axes (x, y, z) of each taxel are needed: normal force and shear"
"""Answer to data of one or two axes."""
RUN = ".."
"""Between the first and the last of consecutive columns."""
NOT_CHECKED = "none"
"""Value of `missing` and `wrap` with which the readings are taken as they are."""

_FIELDS = (
    "time", "taxels", "label", "cause", "module", "episode", "missing", "wrap", "decimal"
)  # fmt: skip
_RATE = re.compile(r"(?P<rate>\d+(?:\.\d+)?)\s*hz", re.IGNORECASE)
_AXES = re.compile(r"-?[1-9]\d*,-?[1-9]\d*,-?[1-9]\d*")


@dataclass(frozen=True)
class Columns:
    """The layout of numbers in a file; None is what the file says.

    Attributes:
        time: column or array of the times, or a rate such as `100Hz` if there is none.
        time_unit: key of `TIME_UNITS`.
        taxels: FIRST..LAST, consecutive columns of taxel after taxel, of module after module, by
            names or by numbers from 1.
        axes: which numbers of the group of a taxel are x, y and z, from 1; a negative number turns
            the sign. The group is the last axis of an array, or the columns of a taxel.
        unit: of the readings, one of `READING_UNITS`.
        label: column of the states.
        cause: column of the causes.
        module: column that says of which module a row is.
        episode: column that says of which recording a row is.
        missing: number that stands for a reading that is missing, in all three axes of a taxel.
        wrap: period of readings that wrap, or that are signed and were kept unsigned, such as
            65536 for 16 bits.
        decimal: `comma` or `point`; the other one separates thousands.
    """

    time: str | None = None
    time_unit: str | None = None
    taxels: str | None = None
    axes: tuple[int, int, int] | None = None
    unit: str | None = None
    label: str | None = None
    cause: str | None = None
    module: str | None = None
    episode: str | None = None
    missing: str | None = None
    wrap: str | None = None
    decimal: str | None = None

    @classmethod
    def parse(cls, text: str | None, axes: str | None = None, unit: str | None = None) -> "Columns":
        """Return the layout that the texts of `--columns`, `--axes` and `--unit` describe.

        Raises:
            ValueError: a part has another form, or its field or unit is unknown.

        Example:
            >>> Columns.parse("time=stamp:ms,taxels=2..16", "2,3,-1").axes
            (2, 3, -1)
        """
        fields: dict[str, str] = {}
        for part in [] if text is None else text.split(","):
            field, _, column = (word.strip() for word in part.partition("="))
            if field not in _FIELDS or not column or field in fields:
                raise ValueError(
                    f"--columns: {', '.join(f'{name}=COLUMN' for name in _FIELDS)} expected, each "
                    f"once, {part!r} given"
                )
            fields[field] = column
        for field in ("missing", "wrap"):
            value = fields.get(field, NOT_CHECKED)
            if value != NOT_CHECKED and not re.fullmatch(r"-?\d+(\.\d*)?(e\d+)?", value):
                raise ValueError(f"--columns: {field}=NUMBER or none expected, {value!r} given")
        if RUN not in fields.get("taxels", RUN):
            raise ValueError(
                f"--columns: taxels=FIRST{RUN}LAST expected, {fields['taxels']!r} given; names as "
                "Fx1 need no option"
            )
        if fields.get("decimal", "comma") not in ("comma", "point"):
            raise ValueError(
                f"--columns: decimal=comma or point expected, {fields['decimal']!r} given"
            )
        numbers = tuple(map(int, axes.split(","))) if axes and _AXES.fullmatch(axes) else None
        if axes is not None and (numbers is None or len({*map(abs, numbers)}) < len("xyz")):
            raise ValueError(
                f"--axes: the numbers of x, y and z from 1 expected, such as 2,3,-4, {axes!r} given"
            )
        names = [name for units in READING_UNITS.values() for name in units]
        if unit not in (None, *names):
            raise ValueError(f"--unit: {', '.join(names)} expected, {unit!r} given")
        time, colon, time_unit = fields.get("time", "").rpartition(":")
        more = {"time": time, "time_unit": time_unit} if colon and time_unit in TIME_UNITS else {}
        return cls(**{**fields, **more}, axes=numbers, unit=unit)  # type: ignore[arg-type]

    def __str__(self) -> str:
        unit = f":{self.time_unit}" if self.time_unit and self.rate is None else ""
        values = {name: getattr(self, name) for name in _FIELDS}
        values["time"] = self.time and self.time + unit
        return ",".join(f"{field}={value}" for field, value in values.items() if value)

    @property
    def rate(self) -> float | None:
        """Rate of the samples [Hz] if there is no column of times; else None."""
        match = _RATE.fullmatch(self.time or "")
        return float(match["rate"]) if match else None


def unit_factor(unit: str, skin: Sensor, *, is_given: bool) -> tuple[float, str]:
    """Return the factor to the unit that is kept, and that unit.

    Args:
        unit: of the readings in the file.
        skin: the sensor.
        is_given: whether the user says it; then a sensor in counts may have readings in newtons.

    Raises:
        RecordingError: the unit cannot be converted.
    """
    kept = skin.unit
    if is_given and kept == "count" and unit in READING_UNITS["N"]:
        kept = "N"
    if unit not in READING_UNITS[kept]:
        names = ", ".join(READING_UNITS[skin.unit])
        raise RecordingError(
            f"readings in {unit} given; {names} expected for {skin.name}"
            + ("; give --unit if the name of the column is wrong" if not is_given else "")
        )
    return READING_UNITS[kept][unit], kept


def named_column(names: Sequence[str], text: str) -> str:
    """Return the column of a name, or of a number from 1; the text itself without such a column.

    Example:
        >>> named_column(("t", "x1"), "2")
        'x1'
    """
    is_number = text not in names and text.isdecimal() and 1 <= int(text) <= len(names)
    return names[int(text) - 1] if is_number else text
