"""Times of a table: their unit by their steps and their name, clocks, and steps that are wrong."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from holdfast.errors import RecordingError
from holdfast.sensors.types import Array

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Seconds in each unit of time."""
PLAUSIBLE_RATES = (5.0, 5000.0)
"""Rates that decide the unit of times without one [Hz]; it is unambiguous, because units are a
factor of 1000 apart."""
DOUBTFUL_STEPS = (0.2, 1.0)
"""Steps of times without a unit that are 1 to 5 Hz in s, or 1000 to 5000 Hz in ms; a step of 1 may
also be a number of samples."""
STATED_RATES = (0.5, 50_000.0)
"""Rates at which the unit that a header names is believed [Hz]."""
DAY = 86_400.0
"""Length of a day [s]."""
MAX_EQUAL_SHARE = 90.0
"""Share of equal times from which they were written with too few digits [%]."""

_CLOCK = re.compile(r"(?P<h>\d{1,2}):(?P<m>\d{2}):(?P<s>\d{2}(?:\.\d*)?)")
_DAY = re.compile(r"(?:\d{1,4}[./]\d{1,2}[./]\d{1,4})?")
_UNIT_WORDS = {
    **dict.fromkeys(("s", "sec", "secs", "seconds"), "s"),
    **dict.fromkeys(("ms", "millis", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "micros", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nanos", "nanoseconds"), "ns"),
}
_UNIT_AT_END = re.compile(rf"(?:^|[\W_])(?P<unit>{'|'.join(_UNIT_WORDS)})\W*$", re.IGNORECASE)


def stated_unit(name: str) -> str | None:
    """Return the unit at the end of the name of a column of times; None without one.

    Example:
        >>> [stated_unit(name) for name in ("time_ms", "t [us]", "timestamp", "time")]
        ['ms', 'us', None, None]
    """
    match = _UNIT_AT_END.search(name)
    return _UNIT_WORDS[match["unit"].lower()] if match else None


def unit_of_column(name: str, values: Array, where: str) -> str:
    """Return the unit of a column of times: as its name states, or that of a plausible rate.

    Args:
        name: name of the column.
        values: (n,) times.
        where: the file, for messages.

    Raises:
        RecordingError: name and values contradict each other, or two units are possible.
    """
    step = _median_step(values)
    unit = stated_unit(name)
    if unit is None:
        low, high = DOUBTFUL_STEPS
        if low < step <= high:  # two units are plausible
            counted = "a number of samples, " if step == 1 else ""
            samples = ", or time=100Hz with the true rate if it counts samples" if counted else ""
            raise RecordingError(
                f"{where}: column {name!r} with steps of {step:.6g} and without a unit given, "
                f"which may be {counted}{1 / step:.4g} Hz in s or {1e3 / step:.4g} Hz in ms: give "
                f"--columns time={name}:s or time={name}:ms{samples}"
            )
        return _unit_of(values)
    rate = 1 / (step * TIME_UNITS[unit]) if step else 0.0
    low, high = STATED_RATES
    if step and not low <= rate <= high:
        likely = _unit_of(values)
        raise RecordingError(
            f"{where}: column {name!r} with steps of {step:.6g} given, {rate:.4g} Hz in {unit}; "
            f"{PLAUSIBLE_RATES[0]:g} to {PLAUSIBLE_RATES[1]:g} Hz expected: give --columns "
            f"time={name}:{likely}, or the unit that is true"
        )
    return unit


def clock_seconds(cells: Sequence[str]) -> Array | None:
    """Return wall-clock times in seconds, past midnight too; None if the first cell has none.

    Args:
        cells: dates with times (ISO 8601), or times such as 23:59:59.999.

    Raises:
        RecordingError: another cell has no such time.

    Example:
        >>> clock_seconds(["23:59:59.5", "00:00:00,5"]).tolist()
        [86399.5, 86400.5]
    """
    times = []
    for row, cell in enumerate(cells):
        time = _clock_time(cell)
        if time is None and row == 0:
            return None
        if time is None:
            raise RecordingError(f"time {cell[:40]!r} given after {cells[0][:40]!r}")
        times.append(time)
    values = np.array(times)
    if "-" in cells[0]:  # with a date
        return values
    days: Array = np.cumsum(np.diff(values, prepend=values[0]) < -DAY / 2)
    return values + DAY * days


def _clock_time(cell: str) -> float | None:
    """Return the seconds of a date with a time, or since midnight; None if it is neither."""
    text = cell.strip().replace(",", ".")
    day, _, clock = text.rpartition(" ")  # of a day such as 21.11.2026 only its midnight counts
    if (match := _CLOCK.fullmatch(clock)) and _DAY.fullmatch(day):
        return 3600 * int(match["h"]) + 60 * int(match["m"]) + float(match["s"])
    try:
        date = datetime.fromisoformat(text) if "-" in text[1:] else None
    except ValueError:
        return None
    if date is None:
        return None
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def check_steps(name: str, times: Array) -> None:
    """Check that times increase; name the option that works if they do not.

    Args:
        name: of their column.
        times: (n,) in the unit of the file.

    Raises:
        RecordingError: a time is not later than the one before.
    """
    steps = np.diff(times)
    wrong = np.flatnonzero(~(steps > 0))
    if not len(wrong):
        return
    first, share = int(wrong[0]), 100 * len(wrong) / len(steps)
    option = "give --columns time=100Hz with the true rate"
    before, after = times[first], times[first + 1]
    if not np.isfinite(after) or not np.isfinite(before):
        raise RecordingError(f"column {name!r} has no time in row {first + 2} of the samples")
    if after < before:
        raise RecordingError(
            f"column {name!r}: times go back at sample {first + 1}: {after:.12g} after "
            f"{before:.12g}; strictly increasing times expected: {option} if the samples are "
            "evenly spaced, or cut the file there"
        )
    lost = ": their last digits are lost" if share > MAX_EQUAL_SHARE else ""
    raise RecordingError(
        f"column {name!r}: times stand still at sample {first + 1}: {after:.12g} after "
        f"{before:.12g}, in {share:.0f} % of the samples{lost}; strictly increasing times "
        f"expected: {option} if the samples are evenly spaced"
    )


def _median_step(values: Array) -> float:
    """Return the median of the steps above 0; 0 without any."""
    steps = np.diff(values)
    steps = steps[np.isfinite(steps) & (steps > 0)]
    return float(np.median(steps)) if len(steps) else 0.0


def seconds_of(values: Array, unit: str | None) -> tuple[Array, str]:
    """Return times in seconds, and their unit; without one, that of a plausible rate.

    Example:
        >>> times, unit = seconds_of(np.array([0.0, 10.0, 20.0]), None)
        >>> times.tolist(), unit
        ([0.0, 0.01, 0.02], 'ms')
    """
    known = unit or _unit_of(values)
    return values * TIME_UNITS[known], known


def _unit_of(values: Array) -> str:
    step = _median_step(values)
    low, high = PLAUSIBLE_RATES
    fitting = (
        unit for unit, size in TIME_UNITS.items() if low <= 1 / max(step * size, 1e-12) < high
    )
    return next(fitting, "s")
