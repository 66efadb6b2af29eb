"""Columns of a CSV file of any logger: which hold the time and the taxels, as given or guessed.

They are written as in `--columns`: `time=stamp:ms,taxels=F{axis}{taxel},label=state`.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import product, takewhile

import numpy as np

from holdfast.errors import RecordingError
from holdfast.io.importers.table import some_names
from holdfast.sensors.taxel_numbers import FIRST_TAXEL, taxel_number, taxel_numbers
from holdfast.sensors.types import Array

Layout = Mapping[str, Mapping[tuple[int, str], str]]
"""Column by taxel (from 1) and axis, by module; the module is empty without a name."""

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
MAX_PATTERNS = 1 << 18
"""Maximum number of patterns that a guess compares; 368 taxels have some thousand."""
MAX_GUESSED_NAME = 200
"""Maximum length of the name of a column that a guess considers [characters]."""
DAY = 86_400.0
"""Length of a day [s]."""
MAX_EQUAL_SHARE = 90.0
"""Share of equal times from which they were written with too few digits [%]."""
RUN = ".."
"""Between the first and the last of consecutive columns."""

_RUN_HINT = ", and taxels=2..16 (numbers of columns) for x, y, z of taxel after taxel"
_FIELDS = ("time", "taxels", "signs", "label", "cause", "module", "episode")
_OF_ROWS = {
    "module": re.compile(r"(?:sensor|module|finger)(?:[_ ]?id)?", re.IGNORECASE),
    "episode": re.compile(r"(?:episode|trial)(?:[_ ]?(?:id|index))?", re.IGNORECASE),
}
"""Names of columns that say to which module or episode a row belongs."""
_UNIT = re.compile(r"(?:^|[\W_])(?P<unit>mm|um|µm|m|N|mN|counts?)\W*$")
_TIME_NAMES = (
    "time", "t", "timestamp", "stamp", "seconds", "sec", "milliseconds", "millis",
    "zeit", "temps", "tiempo", "tempo", "tijd", "czas",
)  # fmt: skip
_CLOCK = re.compile(r"(?P<h>\d{1,2}):(?P<m>\d{2}):(?P<s>\d{2}(?:\.\d*)?)")
_RATE = re.compile(r"(?P<rate>\d+(?:\.\d+)?)\s*hz", re.IGNORECASE)
_UNIT_WORDS = {
    **dict.fromkeys(("s", "sec", "secs", "seconds"), "s"),
    **dict.fromkeys(("ms", "millis", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "micros", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nanos", "nanoseconds"), "ns"),
}
_UNIT_AT_END = re.compile(rf"(?:^|[\W_])(?P<unit>{'|'.join(_UNIT_WORDS)})\W*$", re.IGNORECASE)
_ONE_FINGER = re.compile(r"(?P<module>.+)(?P<rest>[._]t\{taxel\}[._]\{axis\})")
_TOKEN = re.compile(r"\d+|[A-Za-z]+|[^A-Za-z\d]+")
_WORD = re.compile(r"\{\w+\}|\d+|[A-Za-z]+|[^A-Za-z\d{]+")
_PLACEHOLDERS = {
    "{module}": r"(?P<module>.+?)",
    "{taxel}": r"(?P<taxel>\d+)",
    "{axis}": r"(?P<axis>[xyzXYZ])",
}


@dataclass(frozen=True)
class Columns:
    """Columns of a CSV file.

    Attributes:
        time: column of the times, or a rate such as `100Hz` if there is none.
        time_unit: key of `TIME_UNITS`; None if it follows from the times.
        taxels: names of the taxel columns with `{taxel}`, `{axis}` and `{module}` in place of
            what differs; or FIRST..LAST, consecutive columns x, y, z of taxel after taxel, of
            module after module. A column can also be given by its number, from 1.
        signs: of the axes x, y and z, such as `+--` for a sensor whose z falls when it is pressed;
            None for `+++`.
        label: column of the states; None without.
        cause: column of the causes; None without.
        module: column that says of which module a row is; None without.
        episode: column that says of which recording a row is; None without.
    """

    time: str | None = None
    time_unit: str | None = None
    taxels: str | None = None
    signs: str | None = None
    label: str | None = None
    cause: str | None = None
    module: str | None = None
    episode: str | None = None

    @classmethod
    def parse(cls, text: str) -> "Columns":
        """Return the columns that a text describes; those that it leaves out are None.

        Raises:
            ValueError: a part is not FIELD=COLUMN, or its field or unit is unknown.

        Example:
            >>> Columns.parse("time=stamp:ms,taxels=F{axis}{taxel}").time_unit
            'ms'
        """
        given: dict[str, str] = {}
        for part in text.split(","):
            field, _, column = (word.strip() for word in part.partition("="))
            if field not in _FIELDS or not column or field in given:
                raise ValueError(
                    f"--columns: {', '.join(f'{name}=COLUMN' for name in _FIELDS)} expected, each "
                    f"once, {part!r} given"
                )
            given[field] = column
        if not re.fullmatch("[+-]{3}", given.get("signs", "+++")):
            raise ValueError(f"--columns: signs=+-- or the like expected, {given['signs']!r} given")
        time, colon, unit = given.get("time", "").rpartition(":")
        if colon and unit in TIME_UNITS:
            given |= {"time": time, "time_unit": unit}
        return cls(**given)

    def __str__(self) -> str:
        unit = f":{self.time_unit}" if self.time_unit else ""
        time = self.time and self.time + unit
        others = (self.signs, self.label, self.cause, self.module, self.episode)
        values = (time, self.taxels, *others)
        found = zip(_FIELDS, values, strict=True)
        return ",".join(f"{field}={value}" for field, value in found if value)

    @property
    def factors(self) -> Array:
        """(3,) 1 or -1 for each axis."""
        return np.array([1.0 if sign == "+" else -1.0 for sign in self.signs or "+++"])

    @property
    def rate(self) -> float | None:
        """Rate of the samples [Hz] if there is no column of times; else None."""
        match = _RATE.fullmatch(self.time or "")
        return float(match["rate"]) if match else None

    def completed(
        self, names: Sequence[str], n_taxels: Collection[int], units: Collection[str] = ()
    ) -> "Columns":
        """Return the same columns, with a guess for the time and the taxels if not given.

        Args:
            names: names of the columns of the file.
            n_taxels: numbers of taxels that the sensors of the file have, if known.
            units: units of the sensors, if known.

        Raises:
            RecordingError: nothing in the header looks like times or taxels.
        """
        given = None if self.rate is not None else self.time
        time = named_column(names, given) if given else self.time
        time = time or _guessed_time(names) or _first_of_run(names, n_taxels)
        others = [name for name in names if name != time]
        taxels = self.taxels or _guessed_taxels(others, n_taxels, units)
        taxels = taxels or _guessed_run(others, n_taxels) or _guessed_taxels(others, (), units)
        label = self.label or ("label" if "label" in names else None)
        cause = self.cause or ("cause" if "cause" in names else None)
        if time is None:
            raise RecordingError(
                f"no column of times among {some_names(names)}: give --columns time=COLUMN, or "
                "time=100Hz if there is none" + (_RUN_HINT if names[:1] == ("column1",) else "")
            )
        if taxels is None:
            raise RecordingError(
                f"no taxel columns such as x1, y1, z1, x2 among {some_names(names)}: give "
                "--columns 'taxels=F{axis}{taxel}' or, for consecutive columns, "
                "taxels=FIRST..LAST, or --sensor alone if all other columns are x, y, z of its "
                "taxels"
            )
        return replace(self, time=time, taxels=taxels, label=label, cause=cause)

    def layout(self, names: Sequence[str], n_taxels: Collection[int] = ()) -> Layout:
        """Return the column of each taxel and axis, by module.

        Args:
            names: names of the columns of the file.
            n_taxels: numbers of taxels that the sensors of the file have; if it is one, a longer
                run of columns has several modules.

        Raises:
            RecordingError: no column has a name of this form, or the file lacks one.
        """
        pattern = self.taxels or ""
        is_run = RUN in pattern
        layout = _run_layout(pattern, names, n_taxels) if is_run else pattern_layout(pattern, names)
        if not layout:
            raise RecordingError(f"no column is named as {pattern!r}; it has {some_names(names)}")
        return layout


def column_of_rows(kind: str, names: Sequence[str]) -> str | None:
    """Return the column that says of which module or episode a row is; None without one.

    Example:
        >>> column_of_rows("module", ("t_us", "sensor_id", "x1"))
        'sensor_id'
    """
    return next((name for name in names if _OF_ROWS[kind].fullmatch(name.strip())), None)


def named_column(names: Sequence[str], text: str) -> str:
    """Return the column of a name, or of a number from 1; the text itself without such a column.

    Example:
        >>> named_column(("t", "x1"), "2")
        'x1'
    """
    is_number = text not in names and text.isdecimal() and 1 <= int(text) <= len(names)
    return names[int(text) - 1] if is_number else text


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
        _check_clear(name, step, where)
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
    if match := _CLOCK.fullmatch(text):
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


def _check_clear(name: str, step: float, where: str) -> None:
    """Check that times without a unit have a single plausible one."""
    low, high = DOUBTFUL_STEPS
    if not low < step <= high:
        return
    counted = "a number of samples, " if step == 1 else ""
    samples = ", or time=100Hz with the true rate if it counts samples" if counted else ""
    raise RecordingError(
        f"{where}: column {name!r} with steps of {step:.6g} and without a unit given, which may be "
        f"{counted}{1 / step:.4g} Hz in s or {1e3 / step:.4g} Hz in ms: give --columns "
        f"time={name}:s or time={name}:ms{samples}"
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


def _guessed_time(names: Sequence[str]) -> str | None:
    """Return the column of times: a usual name, with or without a unit, or one with "time"."""
    bare = {re.sub(r"[\W_]*\b(s|ms|us|ns)\b\W*$", "", _spaced(name)): name for name in names}
    usual = (bare[name] for name in _TIME_NAMES if name in bare)
    part = (name for name in names if "time" in name.lower() or "stamp" in name.lower())
    return next(usual, next(part, None))


def _spaced(name: str) -> str:
    return re.sub(r"[\W_]+", " ", name).strip().lower()


def pattern_layout(pattern: str, names: Sequence[str]) -> Layout:
    """Return the columns whose names fit a pattern, by module; taxels are counted from 1.

    Example:
        >>> pattern_layout("{module}_{axis}{taxel}", ("t", "a_x0", "a_y0", "a_z0"))
        {'a': {(1, 'x'): 'a_x0', (1, 'y'): 'a_y0', (1, 'z'): 'a_z0'}}
    """
    if "{axis}" not in pattern:
        raise RecordingError(f"taxels={pattern}: {{axis}}, or FIRST{RUN}LAST, expected in it")
    expression = re.escape(pattern)
    for placeholder, group in _PLACEHOLDERS.items():
        expression = expression.replace(re.escape(placeholder), group, 1)
    found: dict[str, dict[tuple[int, str], str]] = {}
    for name in names:
        if match := re.fullmatch(expression, name):
            words = match.groupdict()
            key = (int(words.get("taxel", str(FIRST_TAXEL))), words["axis"].lower())
            found.setdefault(words.get("module", ""), {})[key] = name
    return {module: _from_one(columns) for module, columns in found.items()}


def _from_one(columns: Mapping[tuple[int, str], str]) -> dict[tuple[int, str], str]:
    first = min(taxel for taxel, _ in columns)
    return {(taxel_number(taxel - first), axis): name for (taxel, axis), name in columns.items()}


def _run_layout(text: str, names: Sequence[str], n_taxels: Collection[int]) -> Layout:
    """Return consecutive columns, three for each taxel; of several modules if they are many."""
    ends = [named_column(names, word.strip()) for word in text.split(RUN, 1)]
    if missing := [name for name in ends if name not in names]:
        raise RecordingError(f"taxels={text}: no column {missing[0]!r}; it has {some_names(names)}")
    run = names[names.index(ends[0]) : names.index(ends[1]) + 1]
    if not run or len(run) % 3:
        raise RecordingError(f"taxels={text}: {len(run)} columns given; 3 for each taxel expected")
    size = 3 * next(iter(n_taxels)) if len(set(n_taxels)) == 1 else len(run)
    if len(run) % size:
        size = len(run)
    starts = range(0, len(run), size)
    return {
        f"finger{k + 1}" if len(starts) > 1 else "": {
            (taxel_number(n // 3), "xyz"[n % 3]): name
            for n, name in enumerate(run[start : start + size])
        }
        for k, start in enumerate(starts)
    }


def _guessed_taxels(
    names: Sequence[str], n_taxels: Collection[int], units: Collection[str]
) -> str | None:
    """Return the pattern of the taxel columns: the one that most columns fit completely.

    Of several with other units, as displacements and forces, it is that of the sensors' unit.

    Raises:
        RecordingError: the names have too many numbers, or several units that no sensor decides.
    """
    found: dict[str, dict[tuple[int, str], str]] = {}
    pairs = ((name, *one) for name in names for one in _patterns(name))
    for n, (name, pattern, key) in enumerate(pairs):
        if n == MAX_PATTERNS:
            raise RecordingError(
                f"the names of {len(names)} columns have too many numbers and axes to guess from: "
                "give --columns"
            )
        found.setdefault(pattern, {})[key] = name
    sizes = {
        pattern: len(columns)
        for pattern, columns in found.items()
        if _is_complete(_from_one(columns)) and (not n_taxels or len(columns) // 3 in n_taxels)
    }
    if not sizes:
        return None
    most = max(sizes.values())
    return _with_module(_of_one_unit([p for p, size in sizes.items() if size == most], units))


def _of_one_unit(patterns: list[str], units: Collection[str]) -> list[str]:
    """Return the patterns of one unit: that of the sensors if there are several."""
    stated = [match and match["unit"] for match in map(_UNIT.search, patterns)]
    if len(set(stated)) < 2 or None in stated:
        return patterns
    if not (fitting := [p for p, unit in zip(patterns, stated, strict=True) if unit in units]):
        raise RecordingError(
            f"columns in {' and '.join(sorted(map(str, set(stated))))} fit: give --columns "
            f"'taxels={patterns[0]}' or 'taxels={patterns[-1]}'"
        )
    return fitting


def _guessed_run(names: Sequence[str], n_taxels: Collection[int]) -> str | None:
    """Return all columns as x, y, z of taxel after taxel, if a sensor has so many."""
    run = [name for name in names if name not in ("label", "cause")]
    fits = any(len(run) == 3 * n for n in n_taxels) and run == list(names[: len(run)])
    return f"{run[0]}{RUN}{run[-1]}" if fits else None


def _first_of_run(names: Sequence[str], n_taxels: Collection[int]) -> str | None:
    """Return the first column as that of times, if the others are those of a sensor."""
    return names[0] if _guessed_run(names[1:], n_taxels) else None


def _patterns(name: str) -> Iterator[tuple[str, tuple[int, str]]]:
    """Yield a name with each of its numbers and axis letters replaced, and that taxel and axis."""
    if len(name) > MAX_GUESSED_NAME:
        return
    tokens = _TOKEN.findall(name)
    numbers = [k for k, token in enumerate(tokens) if token.isdigit()]
    for k, token in enumerate(tokens):
        if token[-1].lower() not in "xyz":
            continue
        letter, axis = token[-1].lower(), {k: token[:-1] + "{axis}"}
        for number in numbers:
            both = axis | {number: "{taxel}"}
            pattern = "".join(both.get(place, word) for place, word in enumerate(tokens))
            yield pattern, (int(tokens[number]), letter)
        yield "".join(axis.get(place, word) for place, word in enumerate(tokens)), (1, letter)


def _is_complete(columns: Collection[tuple[int, str]]) -> bool:
    n = len(columns) // 3
    return n > 0 and set(columns) == set(product(taxel_numbers(range(n)), "xyz"))


def _with_module(patterns: Sequence[str]) -> str:
    """Return one pattern for those of several modules: `{module}` replaces the word that differs.

    Example:
        >>> _with_module(["f1_{axis}{taxel}", "f2_{axis}{taxel}"])
        '{module}_{axis}{taxel}'
    """
    if len(patterns) == 1 and (single := _ONE_FINGER.fullmatch(patterns[0])):
        return "{module}" + single["rest"]
    words = [_WORD.findall(pattern) for pattern in patterns]
    start = _common_start(words)
    while start and start[-1].isalnum():  # "f1" and "f2" are whole names
        start = start[:-1]
    rest = [word[len(start) :] for word in words]
    end = _common_start([each[::-1] for each in rest])[::-1]
    names = ["".join(each[: len(each) - len(end)]) for each in rest]
    if len(patterns) == 1 or any("{" in name or not name for name in names):
        return patterns[0]
    return "".join([*start, "{module}", *end])


def _common_start(lists: Sequence[Sequence[str]]) -> list[str]:
    columns = zip(*lists, strict=False)
    return [words[0] for words in takewhile(lambda words: len(set(words)) == 1, columns)]
