"""Recordings from named arrays of numbers, whatever file they were in.

An array becomes a table: its columns are numbered, and other arrays of its length are columns too.
So times, units, episodes and signs are those of tables, and so are `--columns`. Which arrays hold
taxels is given by their paths, or follows from their shapes if it is clear; it is reported.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cache, partial
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.io.importers.csv_columns import (
    RUN,
    THREE_AXES,
    Columns,
    column_of_rows,
    guessed_taxels,
    guessed_time,
)
from holdfast.io.importers.table import Table, errors_named, first_texts, natural_order
from holdfast.io.importers.table_conversion import (
    ANY_MODULE,
    MAX_MODULES,
    Report,
    ReportOnce,
    recordings_of_table,
    reported_once,
)
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

RATE_NAMES = (
    "fs", "rate", "fps", "hz", "frequency", "samplerate", "samplingrate", "samplingfrequency"
)  # fmt: skip
"""Names of a single number that is the rate of the samples [Hz], without blanks and lines."""
KIND_NAMES = ("type", "topic", "kind", "channel")
"""Names in records of what kind a record is."""

_DIGITS = re.compile(r"\d+")
_PART_OF_HAND = re.compile(r"finger|thumb|sensor|module|skin|pad|tip|hand|left|right", re.I)
"""What the name of a group says if groups are modules of one hand, not recordings."""


class StoredArray(NamedTuple):
    """An array that is read when it is needed.

    Attributes:
        shape: its shape.
        kind: of its values, as in NumPy: `f`, `i`, `U` for text.
        read: reads it.
        columns: names of its columns, if they are known.
    """

    shape: tuple[int, ...]
    kind: str
    read: Callable[[], npt.NDArray[Any]]
    columns: tuple[str, ...] = ()


StoredArrays = Mapping[str, StoredArray]
"""Arrays of a file by path: names of groups and of the array with slashes between them."""


class _Layout(NamedTuple):
    """How the axes of an array are understood.

    Attributes:
        axis: of the samples.
        inner: order of the other axes.
        is_episodes: whether the axis before that of the samples counts recordings.
    """

    axis: int
    inner: tuple[int, ...]
    is_episodes: bool = False


def in_memory(values: npt.NDArray[Any], columns: Sequence[str] = ()) -> StoredArray:
    """Return an array that is in memory; dates become seconds."""
    if values.dtype.kind == "M":
        values = values.astype("M8[ns]").astype(np.int64) * 1e-9
    return StoredArray(values.shape, values.dtype.kind, lambda: values, tuple(columns))


def recordings_of_arrays(
    path: Path,
    arrays: StoredArrays,
    sensors: Mapping[str, Sensor],
    columns: Columns | None,
    report: Report,
    option: str = "--array",
) -> Iterator[Recording]:
    """Yield the recordings in the arrays of a file.

    Args:
        path: of the file; its stem is the name of the recordings.
        arrays: all arrays.
        sensors: sensor by the path of an array, or of `"*"` if one array fits. A path may lack its
            first groups or its last name, and may have `*`.
        columns: of the tables that the arrays become.
        report: receives what was guessed.
        option: of the command line that names an array.

    Raises:
        RecordingError: no array fits a sensor, several do, or there are no times.
    """
    once = reported_once(report)
    choice = _Choice(path, arrays, columns or Columns(), option)
    if single := choice.single_columns(sensors):
        n = prod(next(iter(single.values())).shape)
        table = _table(choice, (), np.empty((n, 0)), single)
        of_all = dict.fromkeys([ANY_MODULE], next(iter(sensors.values())))
        with errors_named(path):
            yield from recordings_of_table(
                table[0].names, lambda *_: table, path.name, of_all, columns, once
            )
        return
    for group, wanted in choice.by_group(sensors).items():
        names = _short_names(list(wanted)) if len(wanted) > 1 else [""]
        found: dict[str, Recording] = {}
        for (array_path, one), module in zip(wanted.items(), names, strict=True):
            with errors_named(path):
                parts = _recordings(choice, array_path, one, once)
            for recording in parts:
                several = len(recording.modules) > 1
                modules = {
                    f"{module}/{name}" if module and several else module or name: values
                    for name, values in recording.modules.items()
                }
                known = found[recording.name].modules if recording.name in found else {}
                found[recording.name] = replace(recording, modules={**known, **modules})
        for recording in found.values():
            end = recording.name.removeprefix(path.stem)
            yield replace(recording, name=f"{path.stem}{group and '-' + group}{end}")


def listed(arrays: StoredArrays) -> str:
    """Return the paths and shapes of arrays for a message: larger ones first, one of a kind."""
    return first_texts([f"{name[-60:]} {arrays[name].shape}" for name in _by_size(arrays)])


def _by_size(arrays: StoredArrays) -> list[str]:
    """Return the first path of each kind of paths, those of larger arrays first."""
    kinds = {_DIGITS.sub("0", name): name for name in reversed([*arrays])}
    shapes = {name: arrays[name].shape for name in kinds.values()}
    return sorted(shapes, key=lambda name: (-len(shapes[name]), -prod(shapes[name])))


class _Choice:
    """The choice of arrays in a file."""

    def __init__(self, path: Path, arrays: StoredArrays, columns: Columns, option: str) -> None:
        self.path = path
        inside = {name.strip("/"): array for name, array in arrays.items()}
        order = sorted(inside, key=lambda name: natural_order(Path(name.replace("/", "_"))))
        self.arrays = {name: inside[name] for name in order}
        self.columns = columns
        self._option = option
        self.listed = listed(self.arrays)

    def by_group(self, sensors: Mapping[str, Sensor]) -> dict[str, dict[str, Sensor]]:
        """Return the sensor of each array to read, by the name of each recording.

        Raises:
            RecordingError: no array fits, or several that are no recordings of one kind.
        """
        if not sensors:
            first, *_ = [*_by_size(self.arrays), "PATH"]
            raise RecordingError(
                f"{self.path} has {self.listed}: give the array and its sensor, as "
                f"{self._option} {first}=SENSOR"
            )
        groups: dict[str, dict[str, Sensor]] = {}
        for key, one in sensors.items():
            paths = self._paths(key.strip("/"), one)
            names = _short_names(paths) if len(paths) > 1 else [""]
            for path, name in zip(paths, names, strict=True):
                groups.setdefault(name, {})[path] = one
        return groups

    def single_columns(self, sensors: Mapping[str, Sensor]) -> StoredArrays:
        """Return the arrays that are the columns of a table, if no array fits a sensor for all."""
        if len(sensors) != 1:
            return {}
        ((key, one),) = sensors.items()
        named = self._named(key.strip("/"))
        if key in self.arrays or not named or any(self.layout(name, one) for name in named):
            return {}
        lengths = Counter(prod(self.arrays[name].shape) for name in named)
        n_rows = max(lengths, key=lambda n: (n > 1, lengths[n]))
        paths = [name for name in named if self.arrays[name].shape == (n_rows,)]
        return {name: self.arrays[name] for name in paths} if len(paths) >= 3 * one.n_taxels else {}

    def _paths(self, key: str, one: Sensor) -> list[str]:
        """Return the paths of the arrays that a key means."""
        if key in self.arrays:
            return [key]
        named = self._named(key)
        fitting = [
            name
            for name in named
            if self.layout(name, one) and not guessed_time([name.rpartition("/")[2]])
        ]
        if not named:
            raise RecordingError(f"{self.path} has no array {key!r}; it has {self.listed}")
        if not fitting and len(named) == 1:
            return named  # reading it gives the reason
        if not fitting:
            raise RecordingError(
                f"{self.path} has {self.listed}; none has {one.n_taxels} taxels x 3 axes a sample "
                f"({one.name}): give another sensor; {THREE_AXES}"
            )
        alike = {_DIGITS.sub("0", name) for name in fitting}
        parents = {name.rpartition("/")[0] for name in fitting}
        if len(fitting) > 1 and (
            len(alike) > 1 or len(parents) < len(fitting) or _PART_OF_HAND.search(min(parents))
        ):
            slash = "/" if self._option == "--topic" else ""
            options = " ".join(f"{self._option} {slash}{name}={one.name}" for name in fitting[:2])
            raise RecordingError(
                f"{self.path}: {len(fitting)} arrays fit {one.name}: give the one, or several for "
                f"one hand, as {options}"
            )
        return fitting

    def _named(self, key: str) -> list[str]:
        """Return the paths of the arrays that a key may mean: also those in a group of its name."""
        return [
            name
            for name in self.arrays
            if key == ANY_MODULE
            or fnmatchcase(name, key)
            or f"/{name}".endswith(f"/{key}")
            or name.startswith(f"{key}/")
        ]

    def layout(self, name: str, one: Sensor) -> _Layout | None:
        """Return how the axes of an array are understood; None if it does not fit a sensor.

        The axis of the samples is the one with as many values as the times. Where there are no
        such times, it is the longest, or else the first.
        """
        array = self.arrays[name]
        shape, size = array.shape, 3 * one.n_taxels
        if array.kind not in "biuf" or len(shape) < 2:
            return None
        beside = self.beside(name)
        time = beside.get(self.columns.time or guessed_time(list(beside)) or "")
        n_times = 0 if time is None else prod(self.arrays[time].shape)
        timed = [axis for axis, n in enumerate(shape) if n == n_times]
        for axis in timed or [int(np.argmax(shape)), *([0] if shape[0] > 1 else [])]:
            inner = [other for other in range(len(shape)) if other != axis]
            threes = [other for other in inner if shape[other] == 3]
            is_flat = len(inner) == 1 or shape[inner[-1]] == size
            if not is_flat and shape[inner[-1]] != 3:
                if len(threes) != 1:
                    continue
                inner.remove(threes[0])
                inner.append(threes[0])
            products = {prod(shape[other] for other in inner[k:]) for k in range(len(inner))}
            n_values = prod(shape[other] for other in inner)
            is_table = self.columns.taxels or n_values == size + 1  # the first is the time
            if is_table and len(shape) == 2:
                return _Layout(axis, tuple(inner))
            if n_values % size == 0 and (len(inner) == 1 or size in products):
                is_episodes = n_values > size and len(shape) > 2 and axis == 1
                if size <= n_values <= MAX_MODULES * size or is_episodes:
                    return _Layout(axis, tuple(inner), is_episodes)
        return None

    def beside(self, name: str) -> dict[str, str]:
        """Return the paths of the single columns beside an array, by their last names.

        Beside it is what is in its group or a group around it; of one name, the nearest. Columns
        that are given by their paths are beside every array.
        """
        found: dict[str, str] = {}
        for other in sorted(self.arrays, key=len):
            shape, (group, _, last) = self.arrays[other].shape, other.rpartition("/")
            is_column = other != name and prod(shape) == max(shape, default=1)
            if is_column and (not group or f"{name}/".startswith(f"{group}/")):
                found[last] = other
        fields = ("time", "label", "cause", "module", "episode")
        given = [text for field in fields if (text := getattr(self.columns, field))]
        return found | {text: text.strip("/") for text in given if text.strip("/") in self.arrays}

    def episodes(self, lead: tuple[int, ...]) -> Iterator["_Choice"]:
        """Yield the choice of each recording of arrays whose first axes count them.

        Args:
            lead: sizes of these axes: of recordings, and of samples.
        """
        whole = cache(lambda name: self.arrays[name].read())  # once for all recordings

        def part(name: str, number: int) -> npt.NDArray[Any]:
            return np.asarray(whole(name)[number])

        for number in range(lead[0]):
            arrays = {
                name: array._replace(shape=array.shape[1:], read=partial(part, name, number))
                if array.shape[:2] == lead
                else array
                for name, array in self.arrays.items()
            }
            yield _Choice(self.path, arrays, self.columns, self._option)

    def rate(self, name: str) -> str | None:
        """Return the rate that a single number beside an array states, as `100Hz`."""
        for last, other in self.beside(name).items():
            array = self.arrays[other]
            is_rate = re.sub(r"[\W_]", "", last.lower()) in RATE_NAMES and array.kind in "iuf"
            if is_rate and prod(array.shape) == 1 and (value := float(array.read().item())) > 0:
                return f"{value:.10g}Hz"
        return None


def _recordings(
    choice: _Choice,
    path: str,
    one: Sensor,
    report: ReportOnce,
) -> list[Recording]:
    """Return the recordings in an array, with the columns beside it."""
    array, layout = choice.arrays[path], choice.layout(path, one)
    if layout is None:
        if array.kind == "O":
            array.read()  # which gives the reason
        few = array.shape[-1:] in ((1,), (2,), (one.n_taxels,), (2 * one.n_taxels,))
        raise RecordingError(
            f"{path!r} has shape {array.shape}; (samples, {one.n_taxels}, 3) or (samples, "
            f"{3 * one.n_taxels}) expected ({one.name})"
            + (
                f"; {THREE_AXES}"
                if few
                else ": give another --sensor, or --columns taxels=FIRST..LAST"
            )
        )
    if layout.is_episodes:
        recordings = []
        for k, part in enumerate(choice.episodes(array.shape[:2]), start=1):
            recordings += [
                replace(recording, name=f"{recording.name}-{k}")
                for recording in _recordings(part, path, one, report)
            ]
        return recordings
    values = np.asarray(array.read(), dtype=np.float64).transpose(layout.axis, *layout.inner)
    return _of_rows(choice, path, values.reshape(len(values), -1), one, report)


def _of_rows(
    choice: _Choice, path: str, rows: Array, one: Sensor, report: ReportOnce
) -> list[Recording]:
    """Return the recordings in the rows of an array, with the columns beside it."""
    stored, given = choice.arrays[path], choice.columns
    n, width = rows.shape
    found = {last: choice.arrays[other] for last, other in choice.beside(path).items()}
    beside = {last: array for last, array in found.items() if prod(array.shape) == n}
    numbered = tuple(f"column{k + 1}" for k in range(width))
    names = stored.columns if len(stored.columns) == width else numbered
    time = given.time or guessed_time(list(beside)) or choice.rate(path)
    taxels = given.taxels
    is_named = guessed_taxels(names, {one.n_taxels}, {one.unit}) is not None
    if taxels is None and not is_named and width % (3 * one.n_taxels) == 0:
        taxels = f"{names[0]}{RUN}{names[-1]}"
    if time is None and width == 3 * one.n_taxels + 1:  # the first is the time
        beside = {}
    elif time is None:
        raise RecordingError(
            f"no times beside {path!r} {stored.shape}: give --columns time=100Hz with the true "
            f"rate, or time=ARRAY; it has {choice.listed}"
        )
    guess = replace(given, time=time, taxels=taxels)
    what = f"{choice.path.name}: {path} {stored.shape}"
    table = _table(choice, names, rows, beside)
    return recordings_of_table(
        table[0].names, lambda *_: table, what, {ANY_MODULE: one}, given, report, guess
    )


def _table(
    choice: _Choice, names: Sequence[str], rows: Array, beside: StoredArrays
) -> tuple[Table, dict[str, list[str]]]:
    """Return rows as a table, with other columns beside them, and its cells of text."""
    given = choice.columns
    words = {"label", "cause", given.label, given.cause, given.module, given.episode}
    words |= {column_of_rows(kind, list(beside)) for kind in ("module", "episode")}
    numbers, cells = [rows], {}
    for name, array in beside.items():
        values = array.read().reshape(len(rows))
        numbers.append((np.full(len(rows), np.nan) if array.kind == "U" else values)[:, None])
        if array.kind == "U" or name in words:
            cells[name] = [x if isinstance(x, str) else f"{x:g}" for x in values.tolist()]
    return Table(choice.path, (*names, *beside), np.hstack(numbers), 1, ()), cells


def _short_names(paths: Sequence[str]) -> list[str]:
    """Return the parts in which paths differ.

    Example:
        >>> _short_names(["data/demo_0/tactile", "data/demo_1/tactile"])
        ['demo_0', 'demo_1']
    """
    parts = [path.split("/") for path in paths]
    if len({len(one) for one in parts}) > 1:
        return list(paths)
    differ = [len(set(words)) > 1 for words in zip(*parts, strict=True)]
    return ["/".join(word for word, own in zip(one, differ, strict=True) if own) for one in parts]


def arrays_of_records(records: Iterable[Mapping[str, Any]]) -> dict[str, StoredArray]:
    """Return arrays of the values in records, such as lines of JSON or messages of ROS.

    Records with arrays of the same names and shapes are one group; those of the largest group have
    paths without a first name. Of a list of records with x, y and z, such as fx, fy and fz, the
    three become one array. What not all records of a group have is left out.

    Args:
        records: values by name: numbers, texts, lists of numbers or of records, and records.
    """
    groups: dict[tuple[object, ...], list[dict[str, Any]]] = {}
    for record in records:
        leaves = dict(_leaves(record, ""))
        kinds = tuple(leaves.get(name) for name in KIND_NAMES)
        shapes = ((name, np.shape(one)) for name, one in leaves.items() if np.ndim(one))
        groups.setdefault((*kinds, *sorted(shapes)), []).append(leaves)
    with_arrays = [key for key in groups if len(key) > len(KIND_NAMES)] or list(groups)
    found: dict[str, StoredArray] = {}
    for k, key in enumerate(sorted(with_arrays, key=lambda key: -len(groups[key]))):
        rows = groups[key]
        words = [word for word in key[: len(KIND_NAMES)] if isinstance(word, str)]
        prefix = "" if len(with_arrays) == 1 else f"{'/'.join(words) or f'part{k + 1}'}/"
        for name in rows[0]:
            values = [row[name] for row in rows if name in row]
            is_alike = len({(np.shape(one), isinstance(one, str)) for one in values}) == 1
            if len(values) == len(rows) and is_alike:
                found.setdefault(prefix + name, in_memory(np.array(values)))
    return found


def _leaves(value: Any, path: str) -> Iterator[tuple[str, Any]]:  # noqa: ANN401 (any JSON value)
    """Yield the numbers, texts and arrays of numbers in a value, by path."""
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from _leaves(one, f"{path}/{key}" if path else str(key))
    elif isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
        rows = [dict(_leaves(one, "")) for one in value]
        columns = {
            name: np.array([row[name] for row in rows], dtype=np.float64)
            for name in rows[0]
            if all(np.shape(row.get(name, "")) == np.shape(rows[0][name]) for row in rows)
            and not any(isinstance(row[name], str) for row in rows)
        }
        for name, column in joined_axes(columns).items():
            yield f"{path}/{name}", column
    elif isinstance(value, list | np.ndarray):
        with suppress(ValueError, TypeError):  # texts, or lists of several lengths
            yield path, np.array(value, dtype=np.float64)
    elif isinstance(value, str | int | float):
        yield path, value


def joined_axes(columns: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Return arrays with those of x, y and z of one name as one array, the axis last.

    Example:
        >>> joined_axes({axis: np.zeros(4) for axis in ("fx", "fy", "fz")})["f"].shape
        (4, 3)
    """
    found = dict(columns)
    for name in columns:
        triple = [re.sub(r"x(?=$|[\W_])", axis, name) for axis in "xyz"]
        if len(set(triple)) == 3 and all(one in found for one in triple):
            joined = re.sub(r"[\W_]?x(?=$|[\W_])", "", name) or "xyz"
            if joined not in found:
                found[joined] = np.stack([found.pop(one) for one in triple], axis=-1)
    return found
