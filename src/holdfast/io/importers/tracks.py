"""The columns or arrays of a file that are the taxels of a module: by names, shapes, options."""

import glob
import itertools
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cache, partial
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.io.importers import names as of_names
from holdfast.io.importers.columns import READING_UNITS, RUN, THREE_AXES, Columns, named_column
from holdfast.io.importers.stored import StoredArray, StoredArrays
from holdfast.io.importers.table import first_texts, natural_order, some_names
from holdfast.io.importers.times import time_names
from holdfast.io.proposals import LayoutChoice
from holdfast.sensors import Sensor, built_in_sensors, flat_sensor, sensor

ANY_MODULE = "*"
"""Key of the sensor of all modules that have none of their own."""
MAX_FINGERS = 5
"""Maximum number of modules of an array, or of rows, that no name says."""
MAX_GROUP = 12
"""Maximum number of numbers of a taxel in a proposal."""
PITCH = 5e-3
"""Distance of the taxels of a sensor that is described by their number [m]."""
FORCE_WORDS = {"f", "force", "forces", "tactile", "mag", "b", "skin", "taxel", "taxels", "pressure"}
"""Words that speak for readings where several arrays or columns fit."""
RATE_NAMES = (
    "fs", "rate", "fps", "hz", "frequency", "samplerate", "samplingrate", "samplingfrequency"
)  # fmt: skip
"""Names of a single number that is the rate of the samples [Hz], without blanks and lines."""

_LABEL = re.compile(r"(?:.+\.)?(?:label|cause)")
_RECORDING = re.compile(r"(?:demo|episode|ep|trial|run|recording|seq|rollout)[\W_]*\d+|\d+")
_INDEX = re.compile(r"unnamed.*|index|", re.IGNORECASE)
_ONE_AXIS = re.compile(
    r"(?:f?z|p|press\w*|normal\w*)[\W_]*\d+|.*[\d_](?:f?z|press\w*|normal\w*)", re.I
)


class ForeignFile(NamedTuple):
    """Arrays of a file, and its statements about them.

    Attributes:
        path: of the file.
        arrays: of the file by path; of a table its columns.
        option: of the command line that names an array; `--sensor` for a table.
        stated: `sensor` and `unit` by module, as holdfast's own CSV has them.
        notes: lines about what was skipped.
    """

    path: Path
    arrays: StoredArrays
    option: str = "--array"
    stated: Mapping[tuple[str, str | None], str] = {}
    notes: Sequence[str] = ()


class Track(NamedTuple):
    """Modules with the same times.

    Attributes:
        skin: their sensor.
        modules: their names; empty for the only one.
        values: reads the numbers (n, n_modules, n_taxels, n_numbers of a taxel).
        beside: columns of as many values.
        used: names of the columns or arrays of the taxels.
        unit: that a name says; None without.
        recording: end of the name of the recording.
    """

    skin: Sensor
    modules: tuple[str, ...]
    values: Callable[[], npt.NDArray[Any]]
    beside: Mapping[str, StoredArray]
    used: tuple[str, ...]
    unit: str | None = None
    recording: str = ""


@dataclass
class Layout:
    """The layout of a file, which is completed while it is read.

    Attributes:
        source: the file.
        sensors: by module, by the path of an array, or of `"*"`.
        columns: the layout, completed by what is chosen.
        choices: that it makes.
        options: of the sensors in a proposal.
        used: names of what is read.
    """

    source: ForeignFile
    sensors: dict[str, Sensor]
    columns: Columns
    choices: list[LayoutChoice] = field(default_factory=list)
    options: list[tuple[str, str, str]] = field(default_factory=list)
    used: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        inside = {name.strip("/"): array for name, array in self.source.arrays.items()}
        is_table = self.source.option == "--sensor"
        order = (
            list(inside)
            if is_table
            else sorted(inside, key=lambda n: natural_order(Path(n.replace("/", "_"))))
        )
        self.arrays = {name: inside[name] for name in order}
        for key in self.sensors:
            path = "" if key == ANY_MODULE else key
            self.options.append((self.source.option if path else "--sensor", path, key))

    def choose(self, what: str, value: str, reason: str, *, is_said: bool = False) -> None:
        """Add a choice, in place of the one of the same field."""
        self.choices = [choice for choice in self.choices if choice.what != what]
        self.choices.append(LayoutChoice(what, value, reason, is_said))

    def propose_sensor(self, n_taxels: int, unit: str | None, reason: str = "") -> Sensor:
        """Return a sensor of so many taxels, and propose it."""
        given = next(iter(self.sensors.values()), None)
        unit = self.columns.unit or unit or (given.unit if given is not None else None)
        kept = next((kept for kept, units in READING_UNITS.items() if unit in units), None)
        fitting = [sensor(name) for name in built_in_sensors()]
        fitting = [x for x in fitting if x.n_taxels == n_taxels and kept in (None, x.unit)]
        name, skin = f"1x{n_taxels}", fitting[0] if len(fitting) == 1 else None
        if skin is None:
            skin = flat_sensor(
                f"grid-{name}", 1, n_taxels, PITCH, unit="count" if kept == "count" else "N"
            )
            self.columns = replace(self.columns, unit=unit or skin.unit)
        else:
            name = skin.name
        self.sensors, self.options = {ANY_MODULE: skin}, [("--sensor", "", name)]
        self.choose(
            "sensor", name, f"{n_taxels} taxels{reason}; or a file of your own (holdfast sensors)"
        )
        return skin


def tracks_of(layout: Layout) -> list[Track]:
    """Return the modules of a file.

    Raises:
        RecordingError: nothing is the taxels of a module, or a column or array is missing.
    """
    if layout.source.option == "--sensor":
        return table_tracks(layout, layout.arrays, layout.arrays)
    if not layout.sensors:
        if all(len(array.shape) == 1 for array in layout.arrays.values()):  # columns of a table
            return table_tracks(layout, layout.arrays, layout.arrays)
        _propose_for_arrays(layout)
    names = of_names.different_parts(list(layout.sensors)) if len(layout.sensors) > 1 else [""]
    finder = _ArrayFinder(layout)
    pairs = zip(layout.sensors.items(), names, strict=True)
    return [track for (key, skin), name in pairs for track in finder.tracks(key, skin, name)]


def table_tracks(layout: Layout, columns: StoredArrays, beside: StoredArrays) -> list[Track]:
    """Return the modules of the columns of a table, by their names or as they are given."""
    text, names = layout.columns.taxels, list(columns)
    words = [stated for stated in (layout.columns.label, layout.columns.cause) if stated]
    if missing := [word for word in words if named_column(list(beside), word) not in beside]:
        raise RecordingError(f"column {missing[0]!r} is missing; it has {some_names(list(beside))}")
    if text is None:
        free = [name for name in names if name not in words and not _LABEL.fullmatch(name)]
        modules = _named_modules(layout, free)
    else:
        modules = _consecutive_modules(layout, text, names)
    tracks = []
    beside = {name: array for name, array in beside.items() if not _INDEX.fullmatch(name.strip())}
    for module, titles in modules.items():
        unit = of_names.split_unit(titles[0])[1]
        skin = _sensor_of(layout, module, len(titles) // 3, unit)
        size = len(titles) // skin.n_taxels
        if len(titles) != size * skin.n_taxels or size < len("xyz"):
            raise RecordingError(
                f"{module or 'finger1'}: {len(titles) // 3} taxels in {len(titles)} columns given; "
                f"{skin.n_taxels} taxels x 3 axes from t01 on expected ({skin.name})"
            )
        read = partial(_stacked, columns, titles, (-1, 1, skin.n_taxels, size))
        tracks.append(Track(skin, (module,), read, beside, tuple(titles), unit))
    return tracks


def _stacked(
    columns: StoredArrays, names: Sequence[str], shape: tuple[int, ...]
) -> npt.NDArray[Any]:
    if texts := [name for name in names if columns[name].kind == "U"]:
        cell = columns[texts[0]].read()[0]
        raise RecordingError(f"column {texts[0]!r}: {cell[:40]!r} given, a number expected")
    return np.stack([columns[name].read().reshape(-1) for name in names], axis=1).reshape(shape)


def _consecutive_modules(layout: Layout, text: str, names: Sequence[str]) -> dict[str, list[str]]:
    """Return consecutive columns, of several modules if they are many."""
    run = of_names.run_of(text, names)
    size = 3 * max((skin.n_taxels for skin in layout.sensors.values()), default=len(run) // 3)
    if layout.columns.axes is None and len(run) % 3:
        raise RecordingError(f"taxels={text}: {len(run)} columns given; 3 for each taxel expected")
    n = 1 if layout.columns.axes is not None or not size or len(run) % size else len(run) // size
    size = len(run) // n
    return {f"finger{k + 1}" if n > 1 else "": run[k * size : (k + 1) * size] for k in range(n)}


def _named_modules(layout: Layout, names: Sequence[str]) -> dict[str, list[str]]:
    """Return the columns of each module by their names.

    Raises:
        RecordingError: no name means a taxel.
    """
    n_taxels = {skin.n_taxels for skin in layout.sensors.values()}
    groups = of_names.named_groups(names, n_taxels)
    if is_other := not groups and bool(n_taxels):
        groups = of_names.named_groups(names, ())
    units = {unit for of in READING_UNITS.values() for unit in of} | {None}
    has_imu = {"a", "g"} <= {word for group in groups for word in group.words}
    wrenches = [group.words - {"f"} for group in groups if "f" in group.words]
    others = {}
    for group in groups:
        what = of_names.quantity_of(group.words)
        if has_imu and group.words <= {"a", "g"}:
            what = "accelerometer and gyroscope"
        elif "t" in group.words and group.words - {"t"} in wrenches:
            what = "torque"
        if what or group.unit not in units:
            others[group] = what or f"in {group.unit}"
    groups = {group: cells for group, cells in groups.items() if group not in others}
    if not groups:
        raise _no_taxels(names, n_taxels, {group.head: what for group, what in others.items()})
    form = min(group.form for group in groups)
    groups = {group: cells for group, cells in groups.items() if group.form == form}
    modules = of_names.module_names(list(groups))
    is_own = all(re.fullmatch(r".+[._]t", group.head) for group in groups)
    columns = [[cells[cell] for cell in sorted(cells)] for cells in groups.values()]
    by_module = dict(zip(modules, columns, strict=True))
    first: of_names.Group = next(iter(groups))
    if len(groups) > 1 and not is_own and not of_names.are_fingers(modules):
        first = next((group for group in groups if group.words & FORCE_WORDS), first)
        titles = by_module.pop(modules[list(groups).index(first)])
        rest = first_texts([other[0] for other in by_module.values()])
        layout.columns = replace(layout.columns, taxels=f"{titles[0]}{RUN}{titles[-1]}")
        layout.choose(
            "taxels", f"{titles[0]}{RUN}{titles[-1]}", f"by its name; {rest} would fit, too"
        )
        by_module = {"": titles}
    else:
        titles = columns[0]
        layout.choose(
            "taxels",
            f"{titles[0]} ... {titles[-1]}",
            f"{len(titles) // 3} by their names",
            is_said=True,
        )
    if len(by_module) > 1:
        layout.choose("fingers", ", ".join(by_module), "by the names", is_said=True)
    if is_other:
        skins = " or ".join(skin.name for skin in layout.sensors.values())
        layout.propose_sensor(len(titles) // 3, first.unit, f" of x, y and z, not those of {skins}")
    return by_module


def _no_taxels(
    names: Sequence[str], n_taxels: set[int], others: Mapping[str, str]
) -> RecordingError:
    """Return the reason for which no columns are taxels."""
    bare = [of_names.split_unit(name)[0] for name in names]
    axes = {name[-1].lower() for name in bare if re.search(r"\d[\W_]*[a-z]?[xyz]$", name, re.I)}
    many = max(Counter(re.sub(r"\d+", "0", name) for name in bare).values(), default=0)
    is_few = many in {k * n for n in n_taxels for k in (1, 2) if n > 1} or len(axes) in (1, 2)
    last = 3 * next(iter(n_taxels), 5) + 1
    what = f"columns {some_names(names)}"
    advice = (
        f"give --columns time=COLUMN,taxels=FIRST{RUN}LAST (or numbers, taxels=2{RUN}{last}; "
        "time=100Hz without times) if consecutive columns are x, y, z of taxel after taxel"
    )
    if of_names.POLAR & of_names.words_of(" ".join(names)):
        advice = "of a size and a direction write x = size * cos(direction), y = size * "
        advice += "sin(direction) and z to columns x0, y0, z0, x1, ..., without 65535 and the like"
    elif others:
        what += "".join(f", {head}... ({what})" for head, what in others.items())
        advice = f"the others have normal force alone; {THREE_AXES}"
    elif is_few or sum(map(bool, map(_ONE_AXIS.fullmatch, bare))) > len("xyz"):
        advice = THREE_AXES
    return RecordingError(f"no columns are named as x, y and z of taxels: {what} given; {advice}")


def _sensor_of(layout: Layout, module: str, n_taxels: int, unit: str | None) -> Sensor:
    """Return the sensor of a module of a table: the one given, or that the file names."""
    name = module or "finger1"
    if skin := layout.sensors.get(name) or layout.sensors.get(ANY_MODULE):
        return skin
    stated = layout.source.stated
    text = stated.get(("sensor", name)) or stated.get(("sensor", None))
    if text is None:
        return layout.propose_sensor(n_taxels, unit)
    try:
        return sensor(text)
    except ValueError as cause:
        raise RecordingError(str(cause)) from cause


def _propose_for_arrays(layout: Layout) -> None:
    """Propose a sensor for the first array, beside times, whose last axis is x, y and z.

    Or for the first with as many numbers a sample as a built-in sensor has.
    """
    finder = _ArrayFinder(layout)
    sizes = [len("xyz") * sensor(name).n_taxels for name in built_in_sensors()]
    readings = [
        array.shape
        for name, array in layout.arrays.items()
        if array.kind in "iuf" and finder.is_reading(name) and time_names(list(finder.beside(name)))
    ]
    taxels = [shape for shape in readings if len(shape) in (2, 3) and shape[-1] == len("xyz")]
    flat = [shape for shape in readings if len(shape) == 2 and shape[1] in sizes]
    if shapes := taxels + flat:
        layout.propose_sensor(prod(shapes[0][1:]) // len("xyz"), None)
        return
    first = max(layout.arrays, key=lambda name: prod(layout.arrays[name].shape), default="PATH")
    slash = "/" if layout.source.option == "--topic" else ""
    raise RecordingError(
        f"it has {listed(layout.arrays)}: give the array and its sensor, as "
        f"{layout.source.option} {slash}{first}=SENSOR"
    )


def listed(arrays: StoredArrays) -> str:
    """Return the paths and shapes of arrays for a message: larger ones first, one of a kind."""
    kinds = {re.sub(r"\d+", "0", name): name for name in reversed(list(arrays))}
    names = sorted(kinds.values(), key=lambda n: (-len(arrays[n].shape), -prod(arrays[n].shape)))
    return first_texts([f"{name[-60:]} {arrays[name].shape}" for name in names])


def rate_beside(layout: Layout, track: Track) -> str | None:
    """Return the rate that a single number beside an array states, as `100Hz`."""
    for name, array in layout.arrays.items():
        group, _, last = name.rpartition("/")
        is_near = not group or f"{track.used[0]}/".startswith(f"{group}/")
        is_rate = re.sub(r"[\W_]", "", last.lower()) in RATE_NAMES and array.kind in "iuf"
        if is_near and is_rate and prod(array.shape) == 1 and array.read().item() > 0:
            return f"{array.read().item():.10g}Hz"
    return None


class _Axes(NamedTuple):
    """How the axes of an array are understood.

    Attributes:
        axis: that of the samples.
        n_samples: its size.
        n_modules: number of modules.
        is_episodes: whether the axis before counts recordings.
    """

    axis: int
    n_samples: int
    n_modules: int
    is_episodes: bool = False


class _ArrayFinder:
    """Finds the arrays of the taxels in a file."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._arrays = layout.arrays

    def tracks(self, key: str, skin: Sensor, module: str) -> list[Track]:
        """Return the modules in the arrays that a key names."""
        option_key, key = key, key.strip("/")
        summands = [self._named(part) for part in key.split("+")]
        if len(summands) > 1 and all(len(paths) == 1 for paths in summands):
            return self._at([paths[0] for paths in summands], skin, module)
        named = self._named(key)
        if not named:
            raise RecordingError(f"no array {key!r}; it has {listed(self._arrays)}")
        readings = [name for name in named if self.is_reading(name)]
        wide = [name for name in readings if len(self._arrays[name].shape) > 1]
        is_clear = key in self._arrays or len(wide) == 1 or len(named) == 1
        if is_clear and (key != ANY_MODULE or self._layout.columns.taxels):
            return self._at([key if key in self._arrays else (wide or named)[0]], skin, module)
        fitting = [name for name in readings if self._fits(name, skin)]
        if not fitting and (tracks := self._of_columns(named, skin)):
            return tracks
        is_said = bool(fitting)
        fitting = fitting or [n for n in readings if self._axes(n, skin) or self._group(n, skin)]
        if not fitting and len(readings) == 1:
            raise self._misfit(readings[0], skin)
        if not fitting:
            others = [f"{n} is a {what}" for n in named if (what := self._quantity(n))]
            raise RecordingError(
                f"it has {listed(self._arrays)}; none has {skin.n_taxels} taxels x 3 axes a sample "
                f"({skin.name}): give another sensor; {'; '.join([*others[:2], THREE_AXES])}"
            )
        parts = of_names.different_parts(fitting, by_group=True)
        names, ends = [module] * len(fitting), [f"-{part}" for part in parts]
        if len(fitting) == 1 or not all(map(_RECORDING.fullmatch, parts)):
            ends = [""] * len(fitting)
        if len(fitting) > 1 and not any(ends):
            names = of_names.different_parts(fitting)
            if of_names.are_fingers(names):
                self._layout.choose("fingers", ", ".join(names), "by the names", is_said=True)
            else:
                best = next((n for n in fitting if of_names.words_of(n) & FORCE_WORDS), fitting[0])
                rest = first_texts([name for name in fitting if name != best])
                self._layout.choose("array", best, f"by its name; {rest} would fit, too")
                fitting, names, ends, is_said = [best], [module], [""], False
        if not is_said:
            self._propose_arrays(fitting, option_key, skin)
        triples = zip(fitting, names, ends, strict=True)
        return [track for path, name, end in triples for track in self._at([path], skin, name, end)]

    def _propose_arrays(self, paths: Sequence[str], key: str, skin: Sensor) -> None:
        """Propose arrays for the sensor of a key."""
        layout, option = self._layout, self._layout.source.option
        slash = "/" if option == "--topic" else ""
        if key == ANY_MODULE:  # the name of a sensor that was proposed, too
            key = next(name for _, path, name in layout.options if not path)
        options = [(option, f"{slash}{path}", key) for path in paths]
        layout.options = [*options, *(x for x in layout.options if x[2] != key)]
        if not any(choice.what == "array" for choice in layout.choices):
            shape = self._arrays[paths[0]].shape
            layout.choose("array", ", ".join(paths), f"{skin.n_taxels} taxels in shape {shape}")

    def _fits(self, name: str, skin: Sensor) -> bool:
        """Return whether an array has the taxels of a sensor by its last axes, or by names."""
        words = self._arrays[name].columns
        is_named = bool(words) and bool(of_names.named_groups(words, {skin.n_taxels}))
        return is_named or self._axes(name, skin, is_exact=False) is not None

    def is_reading(self, name: str) -> bool:
        """Return whether an array may be readings by its name."""
        return self._quantity(name) is None and not time_names([name.rpartition("/")[2]])

    def beside(self, name: str) -> dict[str, StoredArray]:
        """Return the arrays of single values beside an array: in its group, or one around it."""
        columns = self._layout.columns
        texts = (columns.time, columns.label, columns.cause, columns.module, columns.episode)
        named = {text.strip("/") for text in texts if text}
        nearest: dict[str, str] = {}  # of one name, the nearest
        for other in sorted(self._arrays, key=len):
            shape, (group, _, last) = self._arrays[other].shape, other.rpartition("/")
            is_near = not group or f"{name}/".startswith(f"{group}/") or other in named
            if other != name and len(shape) in (1, 2) and is_near:
                nearest[other if other in named else last] = other
        return {last: self._arrays[other] for last, other in nearest.items()}

    def _quantity(self, name: str) -> str | None:
        return of_names.quantity_of(of_names.words_of("/".join(name.split("/")[-2:])))

    def _named(self, key: str) -> list[str]:
        """Return the paths of the arrays that a key may mean: also those in a group of its name."""
        key = key.strip("/")
        if key in self._arrays:
            return [key]
        forms = (key, f"*/{glob.escape(key)}", f"{glob.escape(key)}/*")
        return [name for name in self._arrays if any(fnmatchcase(name, form) for form in forms)]

    def _times(self, name: str) -> StoredArray | None:
        """Return the times beside an array; None if there are none, or a rate."""
        if self._layout.columns.rate is not None:
            return None
        beside = self.beside(name)
        text = (self._layout.columns.time or "").strip("/")
        usual = [text] if text else time_names(list(beside))
        return next((beside[word] for word in usual if word in beside), None)

    def _axes(self, name: str, skin: Sensor, *, is_exact: bool = True) -> _Axes | None:
        """Return how the axes of an array are understood; None if it does not fit a sensor.

        The samples are the axis that is as long as the times, or else the first. The last axis has
        the numbers of a taxel; an array that is given may have one axis for taxels and numbers.
        """
        array, times = self._arrays[name], self._times(name)
        shape, n_taxels = array.shape, skin.n_taxels
        if array.kind not in "biuf" or not shape:
            return None
        n_times = shape[0] if times is None else max(times.shape, default=0)
        for axis in (k for k, n in enumerate(shape) if n == n_times):
            for is_episodes in (True, False) if axis == 1 and len(shape) > 2 else (False,):
                rest = shape[axis + 1 :] if is_episodes else (*shape[:axis], *shape[axis + 1 :])
                inner = {prod(rest[k:-1]) for k in range(len(rest))}
                size = 3 if self._layout.columns.axes is None or not rest else rest[-1]
                n_modules = prod(rest) // (n_taxels * size)
                fits = rest[-1:] == (size,) and n_taxels in inner
                if not fits and is_exact and rest and n_taxels not in inner:
                    size = 3 if self._layout.columns.axes is None else rest[-1] // n_taxels
                    n_modules = prod(rest) // max(n_taxels * size, 1)
                    fits = size > 0 and n_modules > 0 and rest[-1] % (n_taxels * size) == 0
                if fits and (n_modules == 1 or not is_episodes):
                    return _Axes(axis, shape[axis], n_modules, is_episodes)
        return None

    def _group(self, name: str, skin: Sensor) -> int:
        """Return how many numbers each taxel has in an array of more than three; 0 without."""
        array = self._arrays[name]
        inner = {prod(array.shape[k:-1]) for k in range(1, len(array.shape))}
        fits = array.kind in "biuf" and skin.n_taxels in inner
        return array.shape[-1] if fits and 3 < array.shape[-1] <= MAX_GROUP else 0

    def _at(self, paths: Sequence[str], skin: Sensor, module: str, end: str = "") -> list[Track]:
        """Return the tracks of an array, or of arrays that are laid beside each other."""
        layout, path, array = self._layout, paths[0], self._arrays[paths[0]]
        if array.kind == "O":
            array.read()  # which gives the reason
        beside = self.beside(path)
        if len(paths) == 1 and len(array.shape) == 2 and (layout.columns.taxels or array.columns):
            words = array.columns or tuple(f"column{k + 1}" for k in range(array.shape[1]))
            columns = {
                word: StoredArray(array.shape[:1], array.kind, partial(_part, array, np.s_[:, k]))
                for k, word in enumerate(words)
            }
            near = {n: x for n, x in beside.items() if prod(x.shape) == array.shape[0]}
            if tracks := self._of_table(columns, near | columns, skin):
                layout.used.add(path)
                return [t._replace(modules=tuple(m or module for m in t.modules)) for t in tracks]
        axes = [self._axes(x, skin) for x in paths]
        if len(paths) > 1:
            sizes = [self._arrays[x].shape[0] for x in paths]
            axes = [_Axes(0, n, 1) if len(set(sizes)) == 1 else None for n in sizes]
        if axes[0] is None and self._group(path, skin):
            values = np.asarray(array.read(), dtype=np.float64).reshape(-1, array.shape[-1])
            numbers, reason = likely_axes(values)
            layout.columns = replace(layout.columns, axes=numbers)
            layout.choose("axes", ",".join(map(str, numbers)), reason)
            axes = [self._axes(path, skin)]
        if (first := axes[0]) is None:
            raise self._misfit(path, skin)
        n = first.n_modules
        if n > MAX_FINGERS:
            raise RecordingError(
                f"{path!r} has shape {array.shape}, of {n} modules or samples in its second axis: "
                "give times of the samples as --columns time=ARRAY, or one axis of samples "
                "(numpy.reshape)"
            )
        what = f"{skin.n_taxels} of {skin.name} in shape {array.shape}"
        layout.choose("taxels", " + ".join(paths), what, is_said=True)
        if n > 1:
            layout.choose("fingers", str(n), "an axis of the array", is_said=True)
        layout.used.update(paths)
        names = [f"finger{k + 1}" for k in range(n)] if n > 1 else [""]
        modules = tuple("/".join(filter(None, (module, name))) for name in names)
        reads = [cache(self._arrays[x].read) for x in paths]  # once for all recordings
        tracks = []
        for k in range(array.shape[0] if first.is_episodes else 1):
            part = (k,) if first.is_episodes else ()
            size = (first.n_samples, n, skin.n_taxels, -1)
            read = partial(_arranged, reads, part, first.axis - len(part), size)
            near = {}
            for name, other in beside.items():
                if part and other.shape[:2] == array.shape[:2]:
                    near[name] = StoredArray(other.shape[1:2], other.kind, partial(_part, other, k))
                elif prod(other.shape) == first.n_samples:
                    near[name] = other
            number = f"-{k + 1}" if part else ""
            tracks.append(Track(skin, modules, read, near, tuple(paths), None, f"{end}{number}"))
        return tracks

    def _of_columns(self, named: Sequence[str], skin: Sensor) -> list[Track]:
        """Return the tracks of single columns, in the first group with names of taxels."""
        groups: dict[str, dict[str, StoredArray]] = {}
        for name in named:
            shape, (group, _, last) = self._arrays[name].shape, name.rpartition("/")
            if prod(shape) == max(shape, default=0) > 1:
                groups.setdefault(group, {})[last] = self._arrays[name]
        large = [columns for columns in groups.values() if len(columns) > len("xyz")]
        return next(filter(None, (self._of_table(table, table, skin) for table in large)), [])

    def _of_table(self, columns: StoredArrays, beside: StoredArrays, skin: Sensor) -> list[Track]:
        """Return the tracks of columns as of a table; none without names of taxels."""
        before = replace(self._layout, sensors={ANY_MODULE: skin})
        try:
            tracks = table_tracks(before, columns, beside)
        except RecordingError:
            if self._layout.columns.taxels:
                raise
            return []
        self._layout.choices, self._layout.columns = before.choices, before.columns
        return tracks

    def _misfit(self, name: str, skin: Sensor) -> RecordingError:
        shape, n = self._arrays[name].shape, skin.n_taxels
        what = ": give another --sensor, or --axes for more numbers of a taxel"
        if shape[-2:] == (3, n):
            what = "; swap its last axes in Python: numpy.swapaxes(array, -1, -2)"
        elif shape[1:] == (3 * n + 1,):
            what = f"; give --columns time=1,taxels=2{RUN}{3 * n + 1} if the first is the time"
        elif n > 1 and shape[-1:] in ((1,), (2,), (n,), (2 * n,)):
            what = f"; {THREE_AXES}"
        return RecordingError(
            f"{name!r} has shape {shape}; (samples, {n}, 3) or (samples, {3 * n}) expected "
            f"({skin.name}){what}"
        )


def _part(array: StoredArray, index: Any) -> npt.NDArray[Any]:  # noqa: ANN401 (of an array)
    return np.ravel(array.read()[index])


def _arranged(
    reads: Sequence[Callable[[], npt.NDArray[Any]]],
    part: tuple[int, ...],
    axis: int,
    shape: tuple[int, ...],
) -> npt.NDArray[Any]:
    """Return (n, n_modules, n_taxels, numbers of a taxel) of arrays, beside each other."""
    parts = [np.moveaxis(read()[part], axis, 0).reshape(shape) for read in reads]
    return np.concatenate(parts, axis=-1)


def likely_axes(values: npt.NDArray[Any]) -> tuple[tuple[int, int, int], str]:
    """Return which of several numbers of a taxel are likely x, y and z, and what speaks for it.

    Args:
        values: (n, number of numbers).

    Example:
        >>> force = np.random.default_rng(0).normal(size=(50, 3))
        >>> likely_axes(np.hstack([force / 10, force]))[0]
        (4, 5, 6)
    """
    size = values.shape[1]
    moving = values[(values != values[:, :1]).any(axis=1)]  # a sentinel is in all numbers
    spans = np.ptp(moving, axis=0) if len(moving) > 9 else np.zeros(size)
    for norm, x, y in itertools.permutations(range(size), 3):
        length = np.hypot(moving[:, x], moving[:, y])
        if x < y and spans[norm] and np.allclose(moving[:, norm], length, atol=1e-4 * spans.max()):
            is_angle = (np.abs(moving).max(axis=0) < 3.15) & (moving.min(axis=0) < 0)
            is_angle[[norm, x, y]] = True
            z = int(np.argmax(np.where(is_angle, -1.0, spans)))
            return (x + 1, y + 1, z + 1), f"number {norm + 1} is the length of {x + 1} and {y + 1}"
    if size == 6 and spans.all():
        alike = [np.corrcoef(moving[:, k], moving[:, k + 3])[0, 1] for k in range(3)]
        if min(alike) > 0.9:
            return (4, 5, 6), "the first three follow the last three: displacement, then force"
    return (1, 2, 3), "the first three"
