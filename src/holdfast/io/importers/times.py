"""Times of a table or array: their names and units, clocks, and steps that are wrong."""

import math
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from holdfast.errors import RecordingError
from holdfast.sensors.types import Array, Flags

DAY = 86_400.0
"""Length of a day [s]."""
TIME_UNITS = {
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": DAY
}  # fmt: skip
"""Seconds in each unit of time."""
POSSIBLE_RATES = (1.0, 20_000.0)
"""Rates at which the unit of times is believed [Hz]."""
DOUBTFUL_RATES = (5.0, 5000.0)
"""Outside of these rates, times whose name has no unit are not taken as seconds [Hz]."""
UNIX_TIME = (1e9, 4e9)
"""Times of a clock that counts from 1970 [s], of the years 2001 to 2096."""
MAX_STEP = 86_400.0
"""Longest step between two samples of one recording [s]: a clock that jumps by days was set."""
MAX_STEPS_BACK = 0.01
"""Share of samples that are left out because their stamps step back."""
SMOOTHER = 0.5
"""A clock is used in place of an earlier one if its steps vary by less than this share."""
MIN_EPISODE = 10
"""Minimum number of samples from a restart of the times to the next."""

MIN_TURN = 2
"""Minimum number of rows of the same time in a table with a row for each taxel."""

_CLOCK = re.compile(r"(?P<h>\d{1,2}):(?P<m>\d{2}):(?P<s>\d{2}(?:\.\d*)?)")
_DAY = re.compile(r"(?:\d{1,4}[./]\d{1,2}[./]\d{1,4})?")
_UNIT_WORDS = {
    word: unit
    for unit, words in {
        "s": ("s", "sec", "secs", "second", "seconds"),
        "ms": ("ms", "msec", "millis", "milliseconds"),
        "us": ("us", "\N{MICRO SIGN}s", "usec", "micros", "microseconds"),
        "ns": ("ns", "nsec", "nanos", "nanoseconds"),
        "min": ("min", "mins", "minute", "minutes"),
        "h": ("h", "hour", "hours"),
        "d": ("d", "day", "days"),
    }.items()
    for word in words
}
_UNIT_AT_END = re.compile(rf"(?:^|[\W_])(?P<unit>{'|'.join(_UNIT_WORDS)})\W*$", re.IGNORECASE)
_IN_BRACKETS = re.compile(r"[\[(]\s*(?:s|sec|ms|[uµ]s|ns|min)\s*[\])]\s*$")
_NAMES = (
    "time", "t", "timestamp", "stamp", "seconds", "sec", "milliseconds", "millis", "ts", "tus",
    "clock", "elapsed", "zeit", "temps", "tiempo", "tempo", "tijd", "czas",
)  # fmt: skip


class Times(NamedTuple):
    """Times of samples.

    Attributes:
        seconds: (n,) [s].
        unit: in the file.
        reason: what speaks for the unit; empty if the file says it.
    """

    seconds: Array
    unit: str
    reason: str = ""


def time_names(names: Sequence[str]) -> list[str]:
    """Return the columns of times: usual names, with or without a unit, then those with "time".

    Example:
        >>> time_names(["step", "ros_time_ns", "t_us", "t_wall [s]", "x1"])
        ['t_us', 'ros_time_ns', 't_wall [s]']
    """
    unit = re.compile(r"[\W_]*\b(s|sec|ms|us|\N{MICRO SIGN}s|ns|min|h|d)\b\W*$")
    bare = {unit.sub("", re.sub(r"[\W_]+", " ", name).strip().lower()): name for name in names}
    usual = [bare[name] for name in _NAMES if name in bare]
    parts = [n for n in names if "time" in n.lower() or "stamp" in n.lower()]
    units = [name for name in names if _IN_BRACKETS.search(name)]
    return list(dict.fromkeys([*usual, *parts, *units]))


def stated_unit(name: str) -> str | None:
    """Return the unit at the end of the name of a column of times; None without one.

    Example:
        >>> [stated_unit(name) for name in ("time_ms", "t [us]", "tus", "timestamp", "time")]
        ['ms', 'us', 'us', None, None]
    """
    match = _UNIT_AT_END.search(name)
    return _UNIT_WORDS[match["unit"].lower()] if match else "us" if name == "tus" else None


def times_of(name: str, values: Array, unit: str | None, nominal: float) -> Times:
    """Return times in seconds.

    Args:
        name: of their column; it may say the unit.
        values: (n,) in the file.
        unit: that the user says; None if it is not said.
        nominal: rate of the sensor [Hz].

    Raises:
        RecordingError: the unit that is said gives an impossible rate, or without one all steps
            are 1.

    Example:
        >>> times_of("stamp", np.array([0.0, 10.0, 20.0]), None, 100.0).unit
        'ms'
    """
    step = median_step(values)
    stated = unit or stated_unit(name)
    first = next((abs(float(value)) for value in values if np.isfinite(value)), 0.0)
    for epoch in ("s", "ms", "us", "ns"):
        if stated is None and UNIX_TIME[0] <= first * TIME_UNITS[epoch] <= UNIX_TIME[1]:
            stated = epoch
    low, high = POSSIBLE_RATES if stated else DOUBTFUL_RATES
    used = stated or "s"
    rate = 1 / (step * TIME_UNITS[used]) if step else 0.0
    if not step or (low <= rate * (1 + 1e-9) and rate <= high * (1 + 1e-9)):
        return Times(values * TIME_UNITS[used], used)
    likely = min(TIME_UNITS, key=lambda u: abs(math.log(step * TIME_UNITS[u] * nominal)))
    its_rate = 1 / (step * TIME_UNITS[likely])
    mean_rate = (len(values) - 1) / ((values[-1] - values[0]) * TIME_UNITS[used] or np.inf)
    if stated and unit is None and low <= mean_rate <= high:
        raise RecordingError(
            f"column {name!r} with samples that come in bursts given, evenly spaced ones expected: "
            f"give --columns time={mean_rate:.4g}Hz, their mean rate"
        )
    if stated:
        raise RecordingError(
            f"column {name!r} with steps of {step:.6g} given, {rate:.4g} Hz in {stated}; "
            f"{low:g} to {high:g} Hz expected: give --columns time={name}:{likely} "
            f"({its_rate:.4g} Hz), or the unit that is true"
        )
    if (np.diff(values) == 1).all():
        raise RecordingError(
            f"column {name!r} with steps of 1 given: give --columns time=100Hz with the true rate "
            f"if it counts samples, or time={name}:ms if it does not"
        )
    reason = f"steps of {step:.6g}: {its_rate:.4g} Hz in {likely}, {rate:.4g} Hz in s"
    return Times(values * TIME_UNITS[likely], likely, reason)


def smoothest(columns: Mapping[str, Array]) -> str:
    """Return the name of the times to use: the first that increase, unless a later one is smoother.

    The clock of a device has steps that vary less than the times at which a computer received its
    samples.
    """
    best, least = next(iter(columns)), np.inf
    for name, values in columns.items():
        steps = np.diff(values)
        if len(steps) and np.isfinite(steps).all() and np.mean(steps > 0) > 1 - MAX_STEPS_BACK:
            spread = float(np.std(steps) / np.median(steps)) if np.median(steps) > 0 else np.inf
            # Rounded stamps of one clock vary alike; only a clear difference is one of clocks.
            if spread < SMOOTHER * least and (least == np.inf or least > 0.01):
                best, least = name, spread
    return best


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


def increasing(times: Array) -> Flags:
    """Return which samples have a stamp after all before: a stamp that steps back is left out."""
    latest = np.fmax.accumulate(times)
    return np.append(True, times[1:] > latest[:-1])


def true_rate(times: Array) -> float | None:
    """Return the rate of samples whose stamps do not increase [Hz]; None if they do not say it.

    It is that of the median step; of stamps that stand still, that of their number and duration.
    """
    steps = np.diff(times)
    step = float(np.median(steps)) if len(steps) else 0.0
    changes = np.flatnonzero(steps > 0) + 1
    if not step > 0 and len(changes) > 1:
        first, last = changes[0], changes[-1]
        step = float(times[last] - times[first]) / (last - first)
    rate = 1 / step if step > 0 else 0.0
    low, high = POSSIBLE_RATES
    return float(f"{rate:.3g}") if low <= rate <= high else None


def check_steps(name: str, times: Array) -> str:
    """Return what is wrong with times that do not increase, or jump by days; empty if they do not.

    Raises:
        RecordingError: a time is missing.
    """
    steps = np.diff(times)
    wrong = np.flatnonzero(~(steps > 0))
    if not np.isfinite(times).all():
        row = int(np.flatnonzero(~np.isfinite(times))[0])
        raise RecordingError(f"column {name!r} has no time in row {row + 1} of the samples")
    if not len(wrong):
        jumps = np.flatnonzero(steps > MAX_STEP)
        if len(jumps):
            at = int(jumps[0])
            return f"times of {name} jump by {steps[at]:.4g} s at sample {at + 2}"
        return ""
    if len(wrong) == len(steps) and (steps < 0).all():
        raise RecordingError(
            f"times of {name} that fall from sample to sample given, rising ones expected: the "
            f"newest row is first, so sort them: pandas.read_csv(FILE).sort_values({name!r})"
        )
    first = int(wrong[0])
    before, after = times[first], times[first + 1]
    what = "go back" if after < before else "stand still"
    share = 100 * len(wrong) / len(steps)
    return f"times of {name} {what} at sample {first + 1}, in {share:.2g} % of the samples"


def turning_columns(times: Array, columns: Mapping[str, Array]) -> list[str]:
    """Return the columns that have the same values in the same order at each of the times.

    A table with a row for each taxel and time has such columns, and one with coarse times has none.

    Example:
        >>> turning_columns(np.repeat([0.0, 0.1], 3), {"taxel": np.tile([1, 2, 3], 2)})
        ['taxel']
    """
    n_rows = int(np.argmax(times != times[0]))
    if n_rows < MIN_TURN or len(times) % n_rows or (np.diff(times.reshape(-1, n_rows)) != 0).any():
        return []
    return [
        name
        for name, values in columns.items()
        if len(set(values[:n_rows].tolist())) > 1
        and (values.reshape(-1, n_rows) == values[:n_rows]).all()
    ]


def restarts(times: Array) -> list[int]:
    """Return the samples at which the times begin again; none if a clock was set back."""
    back = np.flatnonzero(np.diff(times) < 0) + 1
    if not len(back):
        return []
    latest = times[0] + 2 * median_step(times)
    lengths = np.diff([0, *back, len(times)])
    if (times[back] > latest).any() or lengths.min() < MIN_EPISODE:
        return []
    return [int(k) for k in back]


def median_step(values: Array) -> float:
    """Return the median of the steps above 0; 0 without any."""
    steps = np.diff(values)
    steps = steps[np.isfinite(steps) & (steps > 0)]
    return float(np.median(steps)) if len(steps) else 0.0
