"""Columns of a CSV file of any logger: which hold the time and the taxels, as given or guessed.

They are written as in `--columns`: `time=stamp:ms,taxels=F{axis}{taxel},label=state`.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product, takewhile

import numpy as np

from holdfast.errors import RecordingError
from holdfast.io.importers.csv_times import TIME_UNITS
from holdfast.io.importers.table import some_names
from holdfast.sensors.taxel_numbers import FIRST_TAXEL, taxel_number, taxel_numbers
from holdfast.sensors.types import Array

Layout = Mapping[str, Mapping[tuple[int, str], str]]
"""Column by taxel (from 1) and axis, by module; the module is empty without a name."""

MAX_GUESSED_NAME = 200
"""Maximum length of the name of a column that a guess considers [characters]."""
THREE_AXES = "three axes (x, y, z) of each taxel are needed: normal force and shear"
"""Answer to data of one or two axes."""
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
    "time", "t", "timestamp", "stamp", "seconds", "sec", "milliseconds", "millis", "ts", "clock",
    "zeit", "temps", "tiempo", "tempo", "tijd", "czas",
)  # fmt: skip
_RATE = re.compile(r"(?P<rate>\d+(?:\.\d+)?)\s*hz", re.IGNORECASE)
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
        fields = ("label", "cause", "module", "episode", *(() if self.rate else ("time",)))
        texts = {field: getattr(self, field) for field in fields if getattr(self, field)}
        given = {field: named_column(names, text) for field, text in texts.items()}
        if missing := [column for column in given.values() if column not in names]:
            raise RecordingError(f"column {missing[0]!r} is missing; it has {some_names(names)}")
        time = given.get("time", self.time)
        time = time or guessed_time(names)
        if time is None and _guessed_run(names[1:], n_taxels):  # the rest is that of a sensor
            time = names[0]
        others = [name for name in names if name != time]
        taxels = self.taxels or guessed_taxels(others, n_taxels, units)
        taxels = taxels or _few_axes(others) or _guessed_run(others, n_taxels)
        taxels = taxels or guessed_taxels(others, (), units)
        given = {name: name for name in ("label", "cause") if name in names} | given
        if time is None:
            raise RecordingError(
                f"no column of times among {some_names(names)}: give --columns time=COLUMN, or "
                "time=100Hz if there is none" + (_RUN_HINT if names[:1] == ("column1",) else "")
            )
        if taxels is None and any(len(others) in (n, 2 * n) for n in n_taxels if n > 1):
            raise RecordingError(
                f"{len(others)} columns given for {' or '.join(map(str, n_taxels))} taxels; "
                f"{THREE_AXES}"
            )
        if taxels is None:
            raise RecordingError(
                f"no taxel columns such as x1, y1, z1, x2 among {some_names(names)}: give "
                "--columns 'taxels=F{axis}{taxel}' or, for consecutive columns, taxels=FIRST..LAST"
            )
        return replace(self, **{**given, "time": time, "taxels": taxels})

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
        axes = sorted({axis for columns in layout.values() for _, axis in columns})
        if len(axes) < len("xyz"):
            raise RecordingError(f"{' and '.join(axes)} alone given, as {pattern!r}; {THREE_AXES}")
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


def guessed_time(names: Sequence[str]) -> str | None:
    """Return the column of times: a usual name, with or without a unit, or one with "time"."""
    unit = re.compile(r"[\W_]*\b(s|ms|us|ns)\b\W*$")
    bare = {unit.sub("", re.sub(r"[\W_]+", " ", name).strip().lower()): name for name in names}
    usual = (bare[name] for name in _TIME_NAMES if name in bare)
    part = (name for name in names if "time" in name.lower() or "stamp" in name.lower())
    return next(usual, next(part, None))


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


def _few_axes(names: Sequence[str]) -> str | None:
    """Return the pattern of most of the columns if it has taxels of one or two axes only."""
    found: dict[str, set[tuple[int, str]]] = {}
    for name in names:
        for pattern, key in _patterns(name):
            found.setdefault(pattern, set()).add(key)
    for pattern, keys in found.items():
        axes = {axis for _, axis in keys}
        taxels = {taxel for taxel, _ in keys}
        if len(taxels) > 1 and len(axes) < len("xyz") and 2 * len(keys) > len(names):
            return pattern if len(keys) == len(taxels) * len(axes) else None
    return None


def guessed_taxels(
    names: Sequence[str], n_taxels: Collection[int], units: Collection[str]
) -> str | None:
    """Return the pattern of the taxel columns: the one that most columns fit completely.

    Of several with other units, as displacements and forces, it is that of the sensors' unit.

    Raises:
        RecordingError: the names have several units that no sensor decides.
    """
    found: dict[str, dict[tuple[int, str], str]] = {}
    for name in names:
        for pattern, key in _patterns(name):
            found.setdefault(pattern, {})[key] = name
    sizes: dict[str, int] = {}
    for pattern, columns in found.items():
        n_complete = len(columns) // 3
        whole = set(product(taxel_numbers(range(n_complete)), "xyz"))
        # Of a complete pattern each taxel has its three axes, and no number is left out.
        fits = not n_taxels or n_complete in n_taxels
        if n_complete and fits and set(_from_one(columns)) == whole:
            sizes[pattern] = len(columns)
    if not sizes:
        return None
    most = max(sizes.values())
    patterns = [pattern for pattern, size in sizes.items() if size == most]
    stated = [match and match["unit"] for match in map(_UNIT.search, patterns)]
    if len(set(stated)) > 1 and None not in stated:
        fitting = [p for p, unit in zip(patterns, stated, strict=True) if unit in units]
        if not fitting:
            raise RecordingError(
                f"columns in {' and '.join(sorted(map(str, set(stated))))} fit: give --columns "
                f"'taxels={patterns[0]}' or 'taxels={patterns[-1]}'"
            )
        patterns = fitting
    return _with_module(patterns)


def _guessed_run(names: Sequence[str], n_taxels: Collection[int]) -> str | None:
    """Return all columns as x, y, z of taxel after taxel, if a sensor has so many."""
    run = [name for name in names if name not in ("label", "cause")]
    fits = any(len(run) == 3 * n for n in n_taxels) and run == list(names[: len(run)])
    return f"{run[0]}{RUN}{run[-1]}" if fits else None


def _patterns(name: str) -> Iterator[tuple[str, tuple[int, str]]]:
    """Yield a name with each of its numbers and axis letters replaced, and that taxel and axis."""
    if len(name) > MAX_GUESSED_NAME:
        return
    tokens = _TOKEN.findall(name)
    numbers = [k for k, token in enumerate(tokens) if token.isdecimal()]
    for k, token in enumerate(tokens):
        if token[-1].lower() not in "xyz":
            continue
        letter, axis = token[-1].lower(), {k: token[:-1] + "{axis}"}
        for number in numbers:
            both = axis | {number: "{taxel}"}
            pattern = "".join(both.get(index, word) for index, word in enumerate(tokens))
            yield pattern, (int(tokens[number]), letter)
        yield "".join(axis.get(index, word) for index, word in enumerate(tokens)), (1, letter)


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
