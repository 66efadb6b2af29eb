"""Recordings from the columns or arrays of a file.

Names and shapes, or options, say which numbers are the times and which the taxels. What is not
said is proposed, see `proposals.py`.
"""

import itertools
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.io.importers.columns import (
    NOT_CHECKED,
    RUN,
    THREE_AXES,
    READING_UNITS,
    Columns,
    named_column,
    unit_factor,
)
from holdfast.io.importers.layout_findings import layout_findings, mended
from holdfast.io.importers.names import (
    EPISODE_OF_ROWS,
    MODULE_OF_ROWS,
    POLAR,
    are_fingers,
    different_parts,
    module_names,
    named_groups,
    pattern_layout,
    quantity_of,
    run_of,
    split_unit,
)
from holdfast.io.proposals import Choice, Proposal, ProposalError, found_lines
from holdfast.io.importers.stored import StoredArray, StoredArrays, in_memory
from holdfast.io.importers.table import (
    errors_named,
    first_texts,
    natural_order,
    some_names,
    with_integer_type,
)
from holdfast.io.importers.times import (
    check_steps,
    clock_seconds,
    increasing,
    restarts,
    smoothest,
    time_names,
    times_of,
    true_rate,
)
from holdfast.recordings import Label, Recording, Tactile, labels_from_samples
from holdfast.sensors import Sensor, built_in_sensors, flat_sensor, sensor
from holdfast.sensors.types import Array

ANY_MODULE = "*"
"""Key of the sensor of all modules that have none of their own."""
DEFAULT_MODULE = "finger1"
"""Name of the module if nothing names one."""
MAX_FINGERS = 5
"""Maximum number of modules of an array, or of rows, that no name says."""
MAX_GROUP = 12
"""Maximum number of numbers of a taxel in a proposal."""
RATE_NAMES = (
    "fs", "rate", "fps", "hz", "frequency", "samplerate", "samplingrate", "samplingfrequency"
)  # fmt: skip
"""Names of a single number that is the rate of the samples [Hz], without blanks and lines."""
FORCE_WORDS = {
    "f",
    "force",
    "forces",
    "fn",
    "tactile",
    "mag",
    "b",
    "skin",
    "taxel",
    "taxels",
    "pressure",
}
"""Words of names that speak for readings where several arrays or columns fit."""
PITCH = 5e-3
"""Distance of the taxels of a sensor that is described by its number of taxels [m]."""

_LABEL = re.compile(r"(?:(?P<module>.+)\.)?(?P<column>label|cause)")
_RECORDINGS = re.compile(r"(?:demo|episode|ep|trial|run|recording|seq|rollout)[\W_]*\d+|\d+")
_INDEX = re.compile(r"(?:unnamed.*|index|)", re.IGNORECASE)


class Source(NamedTuple):
    """What a file has.

    Attributes:
        path: of the file.
        arrays: of the file by path; of a table its columns.
        option: of the command line that names an array.
        stated: text of `sensor` and `unit` by module, of holdfast's own CSV.
        notes: lines about what was skipped.
    """

    path: Path
    arrays: StoredArrays
    option: str = "--array"
    stated: Mapping[tuple[str, str | None], str] = {}
    notes: Sequence[str] = ()

    @property
    def is_table(self) -> bool:
        """Whether the arrays are the columns of a table."""
        return self.option == "--sensor"


@dataclass(frozen=True)
class Track:
    """Modules with the same times.

    Attributes:
        skin: their sensor.
        modules: their names; empty for the only one.
        values: reads the numbers (n, n_modules, n_taxels, n_numbers of a taxel).
        beside: columns of as many values.
        unit: that a name says; None without.
        used: names that are not among what is left.
        recording: end of the name of the recording.
    """

    skin: Sensor
    modules: tuple[str, ...]
    values: Callable[[], npt.NDArray[Any]]
    beside: Mapping[str, StoredArray]
    unit: str | None = None
    used: tuple[str, ...] = ()
    recording: str = ""


def recordings_of(
    source: Source,
    sensors: Mapping[str, Sensor],
    columns: Columns | None,
    report: Callable[[str], None],
    *,
    accept: bool = False,
) -> list[Recording]:
    """Return the recordings in the columns or arrays of a file.

    Args:
        source: the file; its stem is the name of the recordings.
        sensors: sensor by module, or by the path of an array, or of `"*"`. A path may lack its
            first groups or its last name, and may have `*`; `a+b` lays two arrays beside each other.
        columns: what the user says of the layout.
        report: receives what was read, and what not.
        accept: take what is proposed.

    Raises:
        ProposalError: the layout is not said, but names or shapes speak for one.
        RecordingError: nothing speaks for a layout, or the data contradict it.
    """
    with errors_named(source.path):
        reader = _Reader(source, dict(sensors), columns or Columns())
        recordings = reader.recordings()
        findings: list[str] = []
        for _ in range(3):  # a finding may hide another
            stop = reader.stop()
            if stop is None:
                break
            findings.append(stop)
            recordings = reader.recordings()
    if findings or not (accept or all(choice.is_said for choice in reader.choices)):
        raise ProposalError(reader.proposal(findings))
    for line in (*source.notes, *reader.notes):
        report(f"{source.path.name}: {line}")
    report(f"{source.path.name}: {reader.summary(recordings)}")
    return recordings


class _Reader:
    """Reader of the columns or arrays of one file.

    Attributes:
        columns: the layout, completed by what is chosen.
        choices: of the layout.
        notes: lines about what was left out.
    """

    def __init__(self, source: Source, sensors: dict[str, Sensor], columns: Columns) -> None:
        self.source = source
        self.columns = columns
        self.choices: list[Choice] = []
        self.notes: list[str] = []
        self._sensors = sensors
        self._given = columns
        self._options = [
            (
                source.option if key != ANY_MODULE else "--sensor",
                "" if key == ANY_MODULE else key,
                key,
            )
            for key in sensors
        ]
        inside = {name.strip("/"): array for name, array in source.arrays.items()}
        order = sorted(inside, key=lambda name: natural_order(Path(name.replace("/", "_"))))
        self.arrays = inside if source.is_table else {name: inside[name] for name in order}
        self._raw: list[tuple[str, Sensor, Array]] = []
        self._used: set[str] = set()
        self._tracks: list[Track] | None = None

    def choose(self, what: str, value: str, reason: str, *, is_said: bool = False) -> None:
        """Add a choice, or replace that of the same field."""
        if what in ("time", "taxels", "unit", "axes", "missing", "wrap", "decimal"):
            self.choices = [choice for choice in self.choices if choice.what != what]
        choice = Choice(what, value, reason, is_said)
        if choice not in self.choices:
            self.choices.append(choice)

    # --- recordings

    def recordings(self) -> list[Recording]:
        """Return the recordings by the layout as it is known."""
        self._raw = []
        if self._tracks is None:
            self._tracks = self._table_tracks() if self.source.is_table else self._array_tracks()
        found: dict[str, dict[str, Tactile]] = {}
        for track in self._tracks:
            for end, name, module in self._modules(track):
                modules = found.setdefault(end, {})
                if name in modules:
                    raise RecordingError(f"two modules {name!r}: give each its own name")
                modules[name] = module
        stem, facts = self.source.path.stem, {"source": self.source.path.name}
        for modules in found.values():
            _check_overlap(modules)
        return [Recording(f"{stem}{end}", modules, facts) for end, modules in found.items()]

    def _modules(self, track: Track) -> Iterator[tuple[str, str, Tactile]]:
        """Yield end of the recording's name, name and samples of each module of a track."""
        values = np.asarray(track.values(), dtype=np.float64)
        unit, factor, kept = self._unit(track)
        readings = (
            values[..., :3] if self.columns.axes is None else _with_axes(values, self.columns)
        )
        rows = np.arange(len(values))
        by_module = self._rows_by("module", track) or {"": rows}
        if "" not in by_module and len(track.modules) > 1:
            raise RecordingError(
                f"{len(track.modules)} modules by columns and {len(by_module)} by rows given; one "
                "of both expected"
            )
        times = self._times(track, next(iter(by_module.values())))
        episodes = self._episodes(track, times, next(iter(by_module.values())))
        for episode, of_episode in episodes.items():
            for row_module, of_module in by_module.items():
                own = np.intersect1d(of_episode, of_module)
                own = own[self._kept(times[own])]
                for k, name in enumerate(track.modules):
                    module = row_module or name or DEFAULT_MODULE
                    self._raw.append((module, track.skin, readings[own, k]))
                    part = mended(readings[own, k].copy(), self.columns.missing, self.columns.wrap)
                    is_read = (
                        np.isfinite(part).any(axis=(1, 2)) if self.columns.missing else slice(None)
                    )
                    numbers = with_integer_type(factor * part[is_read])
                    tactile = Tactile(track.skin, times[own][is_read], numbers, kept)  # type: ignore[arg-type]
                    labels = self._labels(track, module, own[is_read], tactile)
                    end = f"{track.recording}{episode and '-' + episode}"
                    yield end, module, replace(tactile, labels=labels)

    def _unit(self, track: Track) -> tuple[str, float, str]:
        stated = self.source.stated.get(("unit", track.modules[0])) or self.source.stated.get(
            ("unit", None)
        )
        if stated not in (None, "count", "N"):
            raise RecordingError(f"unit 'count' or 'N' expected, {stated!r} given")
        is_given = self.columns.unit is not None or stated is not None
        unit = self.columns.unit or stated or track.unit or track.skin.unit
        factor, kept = unit_factor(unit, track.skin, is_given=is_given)
        if unit != track.skin.unit:
            self.choose(
                "unit", unit, "as given" if is_given else "the header says it", is_said=True
            )
        return unit, factor, kept

    def _rows_by(self, kind: str, track: Track) -> dict[str, npt.NDArray[np.intp]]:
        """Return the rows of each module or recording by a column; none without one."""
        given = getattr(self.columns, kind)
        pattern = MODULE_OF_ROWS if kind == "module" else EPISODE_OF_ROWS
        free = [name for name in track.beside if name not in track.used]
        name = (
            named_column(list(track.beside), given)
            if given
            else next(
                (name for name in free if pattern.fullmatch(name.rpartition("/")[2].strip())), None
            )
        )
        if name is None:
            return {}
        if name not in track.beside:
            raise RecordingError(
                f"column {name!r} is missing; it has {some_names(list(track.beside))}"
            )
        cells = _texts(track.beside[name])
        kinds = sorted(set(cells), key=lambda text: natural_order(Path(text)))
        if not given:
            n_changes = sum(a != b for a, b in itertools.pairwise(cells))
            if kind == "module" and not (
                1 < len(kinds) <= MAX_FINGERS and n_changes > len(cells) / 4
            ):
                return {}
            if kind == "episode" and (
                len(kinds) < 2 or n_changes >= len(kinds) or min(Counter(cells).values()) < 10
            ):
                return {}
        self._used.add(name)
        texts = np.array(cells)
        is_number = all(_is_number(text) for text in kinds)
        return {
            f"finger{k + 1}" if kind == "module" and is_number else text: np.flatnonzero(
                texts == text
            )
            for k, text in enumerate(kinds)
        }

    def _episodes(
        self, track: Track, times: Array, first: npt.NDArray[np.intp]
    ) -> dict[str, npt.NDArray[np.intp]]:
        """Return the rows of each recording: by a column, or from a restart of the times."""
        rows = np.arange(len(times))
        starts = restarts(times[first]) if self.columns.rate is None else []
        if self.columns.episode or starts:
            if by_column := self._rows_by("episode", track):
                return by_column
        if not starts:
            return {"": rows}
        at = [0, *(int(first[k]) for k in starts), len(rows)]
        return {str(k + 1): rows[a:b] for k, (a, b) in enumerate(itertools.pairwise(at))}

    # --- times

    def _times(self, track: Track, first: npt.NDArray[np.intp]) -> Array:
        """Return the times of all rows [s]."""
        n = len(next(iter(track.beside.values())).read()) if track.beside else 0
        n = n or len(track.values())
        name = self._time_name(track, first)
        if name is None:
            rate = self.columns.rate
            self.choose("time", f"{rate:g}Hz", "as given", is_said=True)
            return np.arange(n) / rate if rate else np.arange(n)
        array = track.beside[name]
        self._used.add(name)
        values = np.asarray(array.read()).reshape(-1)
        if array.kind == "U":
            clock = clock_seconds(values.tolist())
            if clock is None:
                raise RecordingError(f"column {name!r}: a time expected, {values[0][:40]!r} given")
            return clock
        last = name.rpartition("/")[2]
        is_own = bool(self.source.stated) and self.columns.time is None
        given_unit = "s" if is_own and last == "time" else self.columns.time_unit
        if is_own and given_unit:
            return values.astype(np.float64)
        found = times_of(last, values[first].astype(np.float64), given_unit, track.skin.rate)
        if found.reason:
            self.columns = replace(self.columns, time=name, time_unit=found.unit)
            self.choose("time", f"{name}:{found.unit}", found.reason)
        times = np.full(n, np.nan)
        times[first] = found.seconds
        if len(first) < n:
            factor = times_of(last, values[first].astype(np.float64), found.unit, track.skin.rate)
            times = values * (factor.seconds[-1] / values[first][-1] if values[first][-1] else 1.0)
        problem = "" if restarts(times[first]) else check_steps(last, times[first])
        kept = increasing(times[first])
        if problem and np.mean(~kept) > 0.01:
            rate = true_rate(times[first])
            if rate is None:
                raise RecordingError(
                    f"{problem}: their last digits are lost; strictly increasing times expected: "
                    "give --columns time=100Hz with the true rate if the samples are evenly spaced"
                )
            self.columns = replace(self.columns, time=f"{rate:g}Hz", time_unit=None)
            self.choose(
                "time", f"{rate:g}Hz", f"{problem}; evenly spaced by their number and steps"
            )
            return np.arange(n) / rate
        return times

    def _kept(self, times: Array) -> npt.NDArray[np.bool_]:
        """Return which samples have a stamp after all before; a few may step back."""
        kept = increasing(times)
        if not kept.all() and np.isfinite(times).all():
            n = int(np.count_nonzero(~kept))
            self.notes.append(
                f"{n} stamp{'s' * (n != 1)} step{'s' * (n == 1)} back, the first at sample "
                f"{int(np.flatnonzero(~kept)[0]) + 1}: left out"
            )
            return kept
        return np.ones(len(times), dtype=np.bool_)

    def _time_name(self, track: Track, first: npt.NDArray[np.intp]) -> str | None:
        """Return the column of times beside a track; None if there is a rate."""
        names = [name for name in track.beside if name not in track.used]
        if self.columns.rate is not None:
            return None
        if text := self.columns.time:
            name = text.strip("/")
            fitting = [n for n in names if n == name or n.endswith(f"/{name}")]
            name = fitting[-1] if fitting else named_column(list(track.beside), name)
            if name not in track.beside:
                raise RecordingError(
                    f"column {text!r} is missing; it has {some_names(list(track.beside))}"
                )
            self.choose(
                "time",
                str(Columns(time=text, time_unit=self.columns.time_unit))[5:],
                "as given",
                is_said=True,
            )
            return name
        last = {name.rpartition("/")[2]: name for name in names}
        usable = [last[name] for name in time_names(list(last)) if last[name] in track.beside]
        if usable:
            numbers = {
                name: np.asarray(track.beside[name].read(), dtype=np.float64).reshape(-1)[first]
                for name in usable
                if track.beside[name].kind in "biuf"
            }
            best = smoothest(numbers) if usable[0] in numbers and len(numbers) > 1 else usable[0]
            why = "the steps of other clocks vary more" if best != usable[0] else "by its name"
            self.choose("time", best, why, is_said=True)
            return best
        if rate := self._rate(track):
            self.columns = replace(self.columns, time=rate)
            self.choose("time", rate, "a number beside the array", is_said=True)
            return None
        raise RecordingError(
            f"no column of times among {some_names(names)}: give --columns time=COLUMN, or "
            "time=100Hz with the true rate if there is none"
            + (f", and taxels=2{RUN}16 (numbers of columns) for x, y, z of taxel after taxel"
               if self.source.is_table and self.columns.taxels is None else "")
        )  # fmt: skip

    def _rate(self, track: Track) -> str | None:
        """Return the rate that a single number beside an array states, as `100Hz`."""
        for name, array in self.arrays.items():
            last = re.sub(r"[\W_]", "", name.rpartition("/")[2].lower())
            is_near = "/" not in name or any(
                used.startswith(name.rpartition("/")[0]) for used in track.used
            )
            if last in RATE_NAMES and is_near and prod(array.shape) == 1 and array.kind in "iuf":
                value = float(array.read().item())
                return f"{value:.10g}Hz" if value > 0 else None
        return None

    # --- columns of a table

    def _table_tracks(self, names: Sequence[str] | None = None) -> list[Track]:
        """Return the tracks of the columns of a table."""
        names = list(self.arrays) if names is None else list(names)
        if doubled := [name for name, n in Counter(names).items() if n > 1]:
            raise RecordingError(
                f"two columns are named {doubled[0]!r}; one name for each expected"
            )
        labels = {self.columns.label, self.columns.cause}
        for text in labels - {None}:
            if named_column(names, str(text)) not in names:
                raise RecordingError(f"column {text!r} is missing; it has {some_names(names)}")
        free = [name for name in names if name not in labels and not _LABEL.fullmatch(name)]
        n_taxels = {one.n_taxels for one in self._sensors.values()}
        taxels = self.columns.taxels
        if taxels is not None and RUN in taxels:
            layout = self._run_layout(taxels, names)
            units: dict[str, str | None] = dict.fromkeys(layout)
        elif taxels is not None:
            layout = {
                module: [cells[cell] for cell in sorted(cells)]
                for module, cells in pattern_layout(taxels, names).items()
            }
            units = {module: split_unit(own[0])[1] for module, own in layout.items()}
        else:
            layout, units = self._named_layout(free, n_taxels)
        beside = {name: self.arrays[name] for name in names if not _INDEX.fullmatch(name.strip())}
        used = {name for own in layout.values() for name in own}
        self._used |= used
        tracks = []
        for module, own in layout.items():
            skin = self._sensor_of(module or DEFAULT_MODULE, len(own), units[module])
            n_numbers = len(own) // skin.n_taxels
            if len(own) != n_numbers * skin.n_taxels or n_numbers < 3:
                raise RecordingError(
                    f"{module or DEFAULT_MODULE}: {len(own) // 3} taxels in {len(own)} columns given; "
                    f"{skin.n_taxels} taxels x 3 axes from t01 on expected ({skin.name})"
                )
            shape = (1, skin.n_taxels, n_numbers)
            tracks.append(
                Track(skin, (module,), lambda own=own, shape=shape: self._stacked(own, shape), beside,
                      units[module], tuple(own))
            )  # fmt: skip
        return tracks

    def _stacked(self, names: Sequence[str], shape: tuple[int, ...]) -> npt.NDArray[Any]:
        columns = [np.asarray(self.arrays[name].read()).reshape(-1) for name in names]
        return np.stack(columns, axis=1).reshape(-1, *shape)

    def _run_layout(self, text: str, names: Sequence[str]) -> dict[str, list[str]]:
        """Return consecutive columns, of several modules if they are many."""
        run = run_of(text, names)
        sizes = {one.n_taxels for one in self._sensors.values()} or {len(run) // 3}
        size = 3 * max(sizes)
        if self.columns.axes is None and len(run) % 3:
            raise RecordingError(
                f"taxels={text}: {len(run)} columns given; 3 for each taxel expected"
            )
        if self.columns.axes is not None or len(run) % size or len(run) == size:
            return {"": run}
        return {f"finger{k + 1}": run[k * size : (k + 1) * size] for k in range(len(run) // size)}

    def _named_layout(
        self, names: Sequence[str], n_taxels: set[int]
    ) -> tuple[dict[str, list[str]], dict[str, str | None]]:
        """Return the columns of each module, and their units, by their names."""
        groups = named_groups(names, n_taxels)
        other_size = not groups and bool(n_taxels)
        if other_size:  # another sensor?
            groups = named_groups(names, ())
        units = READING_UNITS["count"] | READING_UNITS["N"]
        others = {}
        words = [group.words for group in groups]
        has_imu = {"a"} in words and {"g"} in words
        for group in list(groups):
            what = quantity_of(group.words) or (
                "accelerometer and gyroscope" if has_imu and group.words in ({"a"}, {"g"}) else None
            )
            if what:
                others[group] = what
            elif group.unit is not None and group.unit not in units:
                others[group] = f"in {group.unit}"
        fitting = {group: cells for group, cells in groups.items() if group not in others}
        if not fitting:
            raise self._no_taxels(names, n_taxels, {g.head: what for g, what in others.items()})
        if len({group.form for group in fitting}) > 1:
            form = min(group.form for group in fitting)
            fitting = {group: cells for group, cells in fitting.items() if group.form == form}
        modules = module_names(list(fitting))
        is_own = all(re.fullmatch(r"(.+)[._]t", group.head) for group in fitting)
        if len(fitting) > 1 and not is_own and not are_fingers(modules):
            best = [g for g in fitting if g.words & FORCE_WORDS] or list(fitting)
            rest = ", ".join(next(iter(fitting[g].values())) for g in fitting if g != best[0])
            fitting, modules = {best[0]: fitting[best[0]]}, [""]
            self._propose_run(fitting[best[0]], names, f"other columns fit, too: {rest}")
        layout = {
            module: [cells[cell] for cell in sorted(cells)]
            for module, cells in zip(modules, fitting.values(), strict=True)
        }
        first = next(iter(layout.values()))
        if self.columns.taxels is None:
            n = len(first) // 3
            names_of = f"{first[0]} ... {first[-1]}" if len(first) > 3 else ", ".join(first)
            self.choose("taxels", names_of, f"{n} by their names", is_said=True)
            if len(layout) > 1:
                self.choose("fingers", ", ".join(layout), "by the names", is_said=True)
        if other_size:
            self._propose_sensor(len(first) // 3, next(iter(fitting)).unit, n_taxels)
        return layout, {m: g.unit for m, g in zip(modules, fitting, strict=True)}

    def _propose_run(
        self, cells: Mapping[tuple[int, str], str], names: Sequence[str], reason: str
    ) -> None:
        own = [cells[cell] for cell in sorted(cells)]
        start = list(self.arrays).index(own[0])
        if list(self.arrays)[start : start + len(own)] != own:
            raise RecordingError(f"{reason}: give --columns taxels=PATTERN")
        self.columns = replace(self.columns, taxels=f"{own[0]}{RUN}{own[-1]}")
        self.choose("taxels", f"{own[0]}{RUN}{own[-1]}", reason)

    def _no_taxels(
        self, names: Sequence[str], n_taxels: set[int], others: Mapping[str, str]
    ) -> RecordingError:
        """Return the reason for which no columns are taxels."""
        words = {word.lower() for name in names for word in re.findall("[A-Za-z]+", name)}
        if polar := sorted(words & POLAR):
            return RecordingError(
                f"columns of size and direction ({polar[0]}) given, no x, y and z: write x = "
                "tangential * cos(direction), y = tangential * sin(direction), z = normal to "
                "columns x0, y0, z0, x1, ... in Python; 65535 and the like must be left empty"
            )
        if others:
            listed = ", ".join(f"{head or 'x, y, z'}... ({what})" for head, what in others.items())
            n_others = len(names) - 3 * len(others)
            more = "; the other columns have normal force alone" if n_others > 3 else ""
            return RecordingError(f"no forces of taxels: {listed} given{more}; {THREE_AXES}")
        axes = Counter(
            (re.sub(r"\d+", "0", name[:-1]), name[-1].lower())
            for name in (split_unit(name)[0] for name in names) if name[-1:].lower() in "xyz"
        )  # fmt: skip
        numbered = Counter(re.sub(r"\d+", "0", name) for name in names)
        few = [
            head
            for (head, _), n in axes.items()
            if n > 1 and len([h for h, _ in axes if h == head]) < 3
        ]
        most = max(numbered.values(), default=0)
        if (
            few
            or most in {k * n for n in n_taxels for k in (1, 2) if n > 1}
            or any(
                re.search(r"z0$|f0$|^p0$|press|normal", name.lower()) and n > 3
                for name, n in numbered.items()
            )
        ):
            return RecordingError(f"columns {some_names(names)} given; {THREE_AXES}")
        n = next(iter(n_taxels), 0)
        size = f" of {n} taxels" if n else ""
        return RecordingError(
            f"no columns are named as x, y and z{size}: {some_names(names)} given; give --columns "
            f"time=COLUMN,taxels=FIRST{RUN}LAST (or numbers, taxels=2{RUN}{3 * n + 1 if n else 16}; "
            "time=100Hz without times) if consecutive columns are x, y, z of taxel after taxel"
        )

    # --- sensors

    def _sensor_of(self, module: str, n_columns: int, unit: str | None) -> Sensor:
        """Return the sensor of a module of a table: the one given, or that the file names."""
        if skin := self._sensors.get(module) or self._sensors.get(ANY_MODULE):
            return skin
        stated = self.source.stated.get(("sensor", module)) or self.source.stated.get(
            ("sensor", None)
        )
        if stated is not None:
            try:
                return sensor(stated)
            except ValueError as cause:
                raise RecordingError(str(cause)) from cause
        return self._propose_sensor(n_columns // 3, unit, set())

    def _propose_sensor(self, n_taxels: int, unit: str | None, instead_of: set[int]) -> Sensor:
        """Return a sensor of so many taxels, and propose it."""
        kept = next((kept for kept, units in READING_UNITS.items() if unit in units), None)
        fitting = [sensor(name) for name in built_in_sensors()]
        fitting = [one for one in fitting if one.n_taxels == n_taxels and kept in (None, one.unit)]
        reason = f"{n_taxels} taxels"
        if instead_of:
            reason += f" of x, y and z in the file, not {' or '.join(map(str, sorted(instead_of)))}"
        if len(fitting) == 1:
            skin, name = fitting[0], fitting[0].name
        else:
            name = f"1x{n_taxels}"
            skin = flat_sensor(
                f"grid-{name}", 1, n_taxels, PITCH, unit="count" if kept == "count" else "N"
            )
            given = self.columns.unit or unit or skin.unit
            self.columns = replace(self.columns, unit=given)
        self._sensors = {ANY_MODULE: skin}
        self._options = [("--sensor", "", name)]
        self.choose("sensor", name, reason + "; or your own file (holdfast sensors --template)")
        return skin

    # --- arrays

    def _array_tracks(self) -> list[Track]:
        """Return the tracks of the arrays that sensors are given for, or that fit one."""
        if not self._sensors:
            self._propose_array_sensor()
        tracks: list[Track] = []
        for key, skin in self._sensors.items():
            tracks += self._tracks_of(key, skin)
        several = len(tracks) > 1 and len(self._sensors) > 1
        if several:
            keys = list(self._sensors)
            names = different_parts(keys)
            named = []
            for track in tracks:
                key = next(
                    k for k in keys if track.used and any(self._is_named(u, k) for u in track.used)
                )
                part = names[keys.index(key)]
                modules = tuple(f"{part}/{m}" if m else part for m in track.modules)
                named.append(replace(track, modules=modules))
            return named
        return tracks

    def _tracks_of(self, key: str, skin: Sensor) -> list[Track]:
        """Return the tracks of the arrays that a key names."""
        key = key.strip("/")
        if "+" in key and key not in self.arrays:
            parts = [self._single(part, skin) for part in key.split("+")]
            return self._tracks_at(parts, skin, "", "", is_exact=True)
        named = [name for name in self.arrays if self._is_named(name, key)]
        if not named:
            raise RecordingError(f"no array {key!r}; it has {self.listed}")
        if key != ANY_MODULE and (key in self.arrays or len(named) == 1):
            return self._tracks_at(
                [key if key in self.arrays else named[0]], skin, "", "", is_exact=True
            )
        is_reading = [n for n in named if self._quantity(n) is None and n not in self._all_times]
        fitting = [name for name in is_reading if self._fit(name, skin)]
        if fitting:
            return self._chosen(fitting, skin, key)
        if tracks := self._column_tracks(named):
            return tracks
        return self._loose(is_reading, named, skin, key)

    def _chosen(self, fitting: Sequence[str], skin: Sensor, key: str) -> list[Track]:
        """Return the tracks of the arrays that fit: one, recordings, or fingers."""
        if len(fitting) == 1:
            return self._tracks_at([fitting[0]], skin, "", "")
        parts = different_parts(fitting)
        groups = [name.rpartition("/")[0] for name in fitting]
        is_recordings = len(set(groups)) == len(fitting) and all(map(_RECORDINGS.fullmatch, parts))
        if is_recordings:
            return [
                track
                for name, part in zip(fitting, parts, strict=True)
                for track in self._tracks_at([name], skin, "", f"-{part}")
            ]
        if are_fingers(parts) or self._words_are_fingers(fitting):
            tracks = [
                track
                for name, part in zip(fitting, parts, strict=True)
                for track in self._tracks_at([name], skin, part, "")
            ]
            self.choose("fingers", ", ".join(parts), "by the names of the arrays", is_said=True)
            return tracks
        best = next((n for n in fitting if self._words(n) & FORCE_WORDS), fitting[0])
        rest = first_texts([name for name in fitting if name != best])
        self._set_array(best, key)
        self.choose("array", best, f"fits {skin.name}, as does {rest}")
        return self._tracks_at([best], skin, "", "", is_exact=True)

    def _loose(
        self, names: Sequence[str], named: Sequence[str], skin: Sensor, key: str
    ) -> list[Track]:
        """Return the tracks of an array that fits in other ways, and propose it."""
        best = next(
            (n for n in names if self._fit(n, skin, is_exact=True) or self._group(n, skin)), None
        )
        if best is None:
            if len(named) == 1 and named[0] in names:
                return self._tracks_at([named[0]], skin, "", "", is_exact=True)  # gives the reason
            quantities = {n: what for n in named if (what := self._quantity(n))}
            left_out = "".join(
                f"; {n} is no reading ({what})" for n, what in [*quantities.items()][:2]
            )
            raise RecordingError(
                f"it has {self.listed}{left_out}; none has {skin.n_taxels} taxels x 3 axes a sample "
                f"({skin.name}): give another sensor; {THREE_AXES}"
            )
        self._set_array(best, key)
        self.choose(
            "array", best, f"its shape {self.arrays[best].shape} has {skin.n_taxels} taxels"
        )
        return self._tracks_at([best], skin, "", "", is_exact=True)

    def _set_array(self, name: str, key: str) -> None:
        sensor_key = next(k for _, _, k in self._options if k.strip("/") == key)
        slash = "/" if self.source.option == "--topic" else ""
        self._options = [
            (self.source.option, f"{slash}{name}", sensor_key)
            if k == sensor_key
            else (option, path, k)
            for option, path, k in self._options
        ]

    def _tracks_at(
        self,
        paths: Sequence[str],
        skin: Sensor,
        module: str,
        recording: str,
        *,
        is_exact: bool = False,
    ) -> list[Track]:
        """Return the tracks of an array, or of arrays that are laid beside each other."""
        array = self.arrays[paths[0]]
        if array.kind == "O":
            array.read()  # which gives the reason
        words = array.columns or ()
        if len(paths) == 1 and len(array.shape) == 2 and (self.columns.taxels or words):
            if tracks := self._expanded(paths[0], skin, module):
                return tracks
        layouts = [self._fit(path, skin, is_exact=is_exact) for path in paths]
        if len(paths) == 1 and layouts[0] is None and (size := self._group(paths[0], skin)):
            self._propose_axes(paths[0], skin, size)
            layouts = [self._fit(paths[0], skin, is_exact=True)]
        if None in layouts:
            raise self._misfit(paths[layouts.index(None)], skin)
        first: _Layout = layouts[0]  # type: ignore[assignment]
        if first.n_modules > MAX_FINGERS:
            raise RecordingError(
                f"{paths[0]!r} has shape {array.shape}, of {first.n_modules} modules or samples in "
                "its second axis: give times of the samples as --columns time=ARRAY, or write the "
                "array with one axis of samples (numpy.reshape)"
            )
        if first.n_modules > 1:
            self.choose(
                "fingers",
                str(first.n_modules),
                f"an axis of {paths[0]} {array.shape}",
                is_said=True,
            )
        self.choose(
            "taxels",
            paths[0],
            f"{skin.n_taxels} of {skin.name} in shape {array.shape}",
            is_said=True,
        )
        self._used |= {*paths}
        n_recordings = array.shape[0] if first.is_episodes else 0
        # One module has the name of its array only if there are others.
        names = (
            tuple(f"finger{k + 1}" for k in range(first.n_modules))
            if first.n_modules > 1
            else ("",)
        )
        modules = tuple(f"{module}/{n}" if module and n else module or n for n in names)
        read = {path: _once(self.arrays[path].read) for path in paths}
        tracks = []
        for k in range(max(n_recordings, 1)):
            index = (k,) if n_recordings else ()

            def values(index: tuple[int, ...] = index) -> npt.NDArray[Any]:
                return np.concatenate(
                    [layout.arranged(read[path]()[index], skin.n_taxels)  # type: ignore[union-attr]
                     for path, layout in zip(paths, layouts, strict=True)], axis=-1
                )  # fmt: skip

            beside = {}
            for name, other in self._beside(paths[0]).items():
                shape = other.shape
                if n_recordings and shape[:2] == array.shape[:2]:
                    beside[name] = other._replace(
                        shape=shape[1:2], read=lambda other=other, k=k: other.read()[k].reshape(-1)
                    )
                elif prod(shape) == first.n_samples:
                    beside[name] = other
            end = f"{recording}-{k + 1}" if n_recordings else recording
            tracks.append(Track(skin, modules, values, beside, None, tuple(paths), end))
        return tracks

    def _fit(self, name: str, skin: Sensor, *, is_exact: bool = False) -> "_Layout | None":
        """Return how the axes of an array are understood; None if it does not fit a sensor.

        The samples are the axis that is as long as the times, or else the first.
        """
        array = self.arrays[name]
        if array.kind not in "biuf" or not array.shape:
            return None
        size = 3 if self.columns.axes is None else None
        times = self._time_beside(name)
        shape = array.shape
        axes = [0]
        if times is not None:
            n_times = max(times.shape, default=0)
            axes = [k for k, n in enumerate(shape) if n == n_times]
        for axis in axes:
            before, rest = shape[:axis], shape[axis + 1 :]
            if axis == 1 and len(rest) > 0:
                if layout := _arranged(shape[1], rest, skin.n_taxels, size, is_exact=is_exact):
                    if layout.n_modules == 1:
                        return layout._replace(is_episodes=True)
            layout = _arranged(shape[axis], before + rest, skin.n_taxels, size, is_exact=is_exact)
            if layout is not None:
                return layout._replace(axis=axis)
        return None

    def _group(self, name: str, skin: Sensor) -> int:
        """Return how many numbers each taxel has in an array of more than three; 0 without."""
        array = self.arrays[name]
        shape = array.shape
        if array.kind not in "biuf" or len(shape) < 2 + (skin.n_taxels > 1):
            return 0
        n = shape[-1]
        inner = [prod(shape[k:-1]) for k in range(1, len(shape))]
        return n if 3 < n <= MAX_GROUP and skin.n_taxels in inner else 0

    def _propose_axes(self, name: str, skin: Sensor, size: int) -> None:
        """Propose which of more than three numbers of a taxel are x, y and z."""
        values = np.asarray(self.arrays[name].read(), dtype=np.float64).reshape(-1, size)
        axes, reason = likely_axes(values)
        self.columns = replace(self.columns, axes=axes)
        self.choose("axes", ",".join(map(str, axes)), reason)

    def _misfit(self, name: str, skin: Sensor) -> RecordingError:
        shape = self.arrays[name].shape
        n = skin.n_taxels
        few = shape[-1:] in ((1,), (2,), (n,), (2 * n,)) and n > 1
        if shape[-2:] == (3, n):
            what = "; swap its last axes in Python: numpy.swapaxes(array, -1, -2)"
        elif few:
            what = f"; {THREE_AXES}"
        elif not self._time_beside(name) and self.columns.rate is None:
            what = ", beside times: give --columns time=ARRAY or time=100Hz"
        else:
            what = ": give another --sensor, or --axes for more numbers of a taxel"
        return RecordingError(
            f"{name!r} has shape {shape}; (samples, {n}, 3) or (samples, {3 * n}) expected "
            f"({skin.name}){what}"
        )

    def _expanded(self, name: str, skin: Sensor, module: str) -> list[Track]:
        """Return the tracks of the columns of an array of two axes, by their names or numbers."""
        array = self.arrays[name]
        width = array.shape[1]
        words = array.columns or tuple(f"column{k + 1}" for k in range(width))
        columns = {
            word: StoredArray(array.shape[:1], array.kind, lambda k=k: array.read()[:, k])
            for k, word in enumerate(words)
        }
        beside = {
            n: one for n, one in self._beside(name).items() if prod(one.shape) == array.shape[0]
        }
        try:
            made = _Reader(Source(self.source.path, {**columns, **beside}, "--sensor"),
                           {ANY_MODULE: skin}, self.columns)  # fmt: skip
            tracks = made._table_tracks(list(columns))
        except RecordingError:
            if self.columns.taxels:
                raise
            return []  # names of other things: the order is x, y, z of taxel after taxel
        self.choices += made.choices
        self._used.add(name)
        return [replace(one, beside={**columns, **beside}, modules=tuple(m or module for m in one.modules))
                for one in tracks]  # fmt: skip

    def _column_tracks(self, named: Sequence[str]) -> list[Track]:
        """Return the tracks of the columns in the first group that has taxels by their names."""
        groups: dict[str, list[str]] = {}
        for name in named:
            shape = self.arrays[name].shape
            if prod(shape) == max(shape, default=0) > 1:
                groups.setdefault(name.rpartition("/")[0], []).append(name)
        for group, names in groups.items():
            if len(names) < 3:
                continue
            inside = {name.removeprefix(f"{group}/"): self.arrays[name] for name in names}
            skins = {ANY_MODULE: next(iter(self._sensors.values()))}
            made = _Reader(Source(self.source.path, inside, "--sensor"), skins, self.columns)
            try:
                tracks = made._table_tracks()
            except ProposalError:
                raise
            except RecordingError:
                continue
            self.choices += made.choices
            self.columns = made.columns
            return tracks
        return []

    def _propose_array_sensor(self) -> None:
        """Propose a sensor for the array whose last axis is x, y and z."""
        for name, array in self.arrays.items():
            shape = array.shape
            is_taxels = (
                len(shape) in (2, 3) and shape[-1] == 3 and shape[0] > 20 and array.kind in "iuf"
            )
            if is_taxels and self._quantity(name) is None and self._time_beside(name) is not None:
                self._propose_sensor(prod(shape[1:-1]), None, set())
                return
        first = next(iter(sorted(self.arrays, key=lambda n: -prod(self.arrays[n].shape))), "PATH")
        raise RecordingError(
            f"it has {self.listed}: give the array and its sensor, as {self.source.option} "
            f"{'/' if self.source.option == '--topic' else ''}{first}=SENSOR"
        )

    def _single(self, key: str, skin: Sensor) -> str:
        named = [name for name in self.arrays if self._is_named(name, key)]
        if len(named) != 1 and key not in self.arrays:
            raise RecordingError(f"{len(named)} arrays {key!r}; it has {self.listed}")
        return key if key in self.arrays else named[0]

    def _is_named(self, name: str, key: str) -> bool:
        key = key.strip("/")
        return (
            key in (ANY_MODULE, name)
            or fnmatchcase(name, key)
            or f"/{name}".endswith(f"/{key}")
            or name.startswith(f"{key}/")
        )

    def _words(self, name: str) -> set[str]:
        return {word.lower() for word in re.findall("[A-Za-z]+", name)}

    def _words_are_fingers(self, names: Sequence[str]) -> bool:
        """Return whether paths differ in a part that names a finger; the rest may repeat it."""
        parts = [re.split(r"[/_.]", name) for name in names]
        if len({len(part) for part in parts}) > 1:
            return False
        differ = [set(words) for words in zip(*parts, strict=True) if len(set(words)) > 1]
        return any(len(words) == len(names) and are_fingers(words) for words in differ)

    def _quantity(self, name: str) -> str | None:
        return quantity_of(self._words("/".join(name.split("/")[-2:])) - {"b"})

    def _beside(self, name: str) -> dict[str, StoredArray]:
        """Return the arrays of single values beside an array: in its group, or one around it."""
        found: dict[str, StoredArray] = {}
        given = {(self.columns.time or "").strip("/")}
        for other in sorted(self.arrays, key=len):
            shape, group = self.arrays[other].shape, other.rpartition("/")[0]
            is_near = not group or f"{name}/".startswith(f"{group}/") or other in given
            if other != name and prod(shape) > 1 and len(shape) <= 2 and is_near:
                found[other] = self.arrays[other]
        # Of one name, the nearest.
        last = {other.rpartition("/")[2]: other for other in found}
        return {other: found[other] for other in found if last[other.rpartition("/")[2]] == other}

    def _time_beside(self, name: str) -> StoredArray | None:
        """Return the times beside an array, of which only the shape is used."""
        if self.columns.rate is not None:
            return None
        beside = {other: one for other, one in self._beside(name).items() if one.shape}
        lasts = {other.rpartition("/")[2]: one for other, one in beside.items()}
        text = (self.columns.time or "").strip("/")
        if text:
            return beside.get(text) or lasts.get(text)
        found = time_names(list(lasts))
        return lasts[found[0]] if found else None

    @cached_property
    def _all_times(self) -> set[str]:
        return {name for name in self.arrays if time_names([name.rpartition("/")[2]])}

    @property
    def listed(self) -> str:
        """Paths and shapes of the arrays: larger ones first, one of a kind."""
        kinds = {re.sub(r"\d+", "0", name): name for name in reversed(list(self.arrays))}
        names = sorted(
            kinds.values(), key=lambda n: (-len(self.arrays[n].shape), -prod(self.arrays[n].shape))
        )
        return first_texts([f"{name[-60:]} {self.arrays[name].shape}" for name in names])

    # --- labels, findings, proposal

    def _labels(
        self, track: Track, module: str, rows: npt.NDArray[np.intp], tactile: Tactile
    ) -> tuple[Label, ...]:
        """Return the labels of a module by the columns `label` and `cause`."""
        cells = {}
        for kind in ("label", "cause"):
            given = getattr(self.columns, kind)
            name = named_column(list(track.beside), given) if given else None
            for candidate in (name, f"{module}.{kind}", kind):
                if candidate in track.beside:
                    texts = _texts(track.beside[candidate])
                    cells[kind] = [texts[row].strip() for row in rows]
                    self._used.add(str(candidate))
                    break
        if "label" not in cells:
            return ()
        # A label says UNKNOWN by having no state.
        known = [s.value.lower() for s in ContactState if s is not ContactState.UNKNOWN]
        causes = cells.get("cause", [""] * len(rows))
        pairs: list[tuple[ContactState, Cause | None] | None] = []
        for row, state, cause in zip(rows.tolist(), cells["label"], causes, strict=True):
            if state and state.lower() not in known:
                raise RecordingError(
                    f"sample {row + 1}: label {state!r} given; {', '.join(known)} are known"
                )
            if state and cause.lower() not in ("", *Cause):
                raise RecordingError(
                    f"sample {row + 1}: cause {cause!r} given; {', '.join(Cause)} are known"
                )
            named = Cause(cause.lower()) if state and cause else None
            pairs.append((ContactState(state.upper()), named) if state else None)
        return labels_from_samples(tactile.times, pairs, period=tactile.period, evidence="csv")

    def stop(self) -> str | None:
        """Return the first finding that makes every state wrong, and mend it; None without one."""
        checked = {
            "missing": self.columns.missing is None,
            "wrap": self.columns.wrap is None,
            "unit": self.columns.unit is None and not self.source.stated,
            "axes": self._given.axes is None,
        }
        for module, skin, values in self._raw:
            changed = mended(values.copy(), self.columns.missing, self.columns.wrap)
            for finding in layout_findings(changed, skin):
                text = f"{module}: {finding.text}"
                what, _, value = finding.option.partition("=")
                if not finding.stops:
                    self.notes += [] if text in self.notes else [text]
                elif what == "axes" and checked["axes"]:
                    raise RecordingError(
                        f"{text}; {THREE_AXES}; --axes 1,2,3 takes the numbers as they are"
                    )
                elif checked.get(what) and not (what == "unit" and self._has_unit):
                    self.columns = replace(self.columns, **{what: value})
                    self.choose(what, value, finding.text)
                    return (
                        f"{text} ({what}={NOT_CHECKED} takes it as it is)"
                        if what != "unit"
                        else text
                    )
        return None

    @property
    def _has_unit(self) -> bool:
        return any(track.unit for track in self._tracks or ())

    def proposal(self, findings: Sequence[str]) -> Proposal:
        """Return the options that import the file by the layout as it is chosen."""
        order = ("sensor", "array", "time", "unit", "fingers", "taxels", "axes", "missing", "wrap")
        choices = sorted(self.choices, key=lambda c: order.index(c.what) if c.what in order else 9)
        axes = self.columns.axes
        return Proposal(
            str(self.source.path), found_lines(self.arrays), choices, self._options,
            str(self.columns), ",".join(map(str, axes)) if axes else "", self.columns.unit or "",
            [*findings],
        )  # fmt: skip

    def summary(self, recordings: Sequence[Recording]) -> str:
        """Return a line about what was read."""
        modules = recordings[0].modules
        first = next(iter(modules.values()))
        names = ", ".join(f"{name} {one.sensor.n_taxels} taxels" for name, one in modules.items())
        said = [
            f"{c.what} {c.value} ({c.reason})" for c in self.choices if c.what in ("time", "unit")
        ]
        unused = first_texts([name for name in self.arrays if name not in self._used])
        return f"{first.rate:.4g} Hz, {names}; {'; '.join([*said, ''])}not used: {unused}"


class _Layout(NamedTuple):
    """How the axes of an array are understood.

    Attributes:
        axis: of the samples.
        n_samples: its size.
        n_modules: number of modules.
        size: number of numbers of each taxel; 0 if it is what is left.
        is_episodes: whether the axis before that of the samples counts recordings.
    """

    axis: int
    n_samples: int
    n_modules: int
    is_episodes: bool = False

    def arranged(self, values: npt.NDArray[Any], n_taxels: int) -> npt.NDArray[Any]:
        """Return values as (n, n_modules, n_taxels, numbers of a taxel)."""
        return np.moveaxis(values, self.axis, 0).reshape(
            self.n_samples, self.n_modules, n_taxels, -1
        )


def _arranged(
    n_samples: int, rest: tuple[int, ...], n_taxels: int, size: int | None, *, is_exact: bool
) -> _Layout | None:
    """Return the layout of axes beside that of the samples; None if they do not fit.

    Args:
        n_samples: number of samples.
        rest: sizes of the other axes.
        n_taxels: of the sensor.
        size: numbers of each taxel; None for any.
        is_exact: whether the array is named, so that it may have one axis for taxels and numbers.
    """
    products = {prod(rest[k:]) for k in range(len(rest) + 1)}
    if size is None:  # the user names the numbers
        last = rest[-1] if rest else 1
        inner = [prod(rest[k:-1]) for k in range(len(rest))]
        if n_taxels in inner:
            return _Layout(0, n_samples, prod(rest) // (n_taxels * last))
        fits = len(rest) == 1 and rest[0] % n_taxels == 0
        return _Layout(0, n_samples, 1) if fits else None
    whole = n_taxels * size
    n_modules = prod(rest) // whole if rest else 0
    is_last = rest[-1:] == (size,) and whole in products
    is_flat = is_exact and (
        rest[-1:] == (whole,) or (len(rest) == 1 and n_modules and rest[0] % whole == 0)
    )
    return _Layout(0, n_samples, n_modules) if is_last or is_flat else None


def likely_axes(values: Array) -> tuple[tuple[int, int, int], str]:
    """Return which of several numbers of a taxel are likely x, y and z, and what speaks for it.

    Args:
        values: (n, number of numbers).

    Example:
        >>> force = np.random.default_rng(0).normal(size=(50, 3))
        >>> likely_axes(np.hstack([force / 10, force]))[0]
        (4, 5, 6)
    """
    size = values.shape[1]
    moving = values[(np.abs(values - values[0]) > 0).any(axis=1)]
    # A sentinel is in all numbers.
    moving = moving[(moving != moving[:, :1]).any(axis=1)]
    scale = float(np.abs(moving).max()) if len(moving) else 1.0
    for x, y in itertools.combinations(range(size), 2):
        length = np.hypot(moving[:, x], moving[:, y])
        for norm in (k for k in range(size) if k not in (x, y)):
            if len(moving) > 9 and np.allclose(moving[:, norm], length, atol=1e-4 * scale):
                spans = [
                    np.ptp(moving[:, k]) if k not in (x, y, norm) else -1.0 for k in range(size)
                ]
                bounded = [
                    abs(moving[:, k]).max() <= 3.15 and moving[:, k].min() < 0 for k in range(size)
                ]
                z = max(range(size), key=lambda k: spans[k] if not bounded[k] else -0.5)
                return (
                    x + 1,
                    y + 1,
                    z + 1,
                ), f"number {norm + 1} is the length of {x + 1} and {y + 1}"
    if size == 6 and len(moving) > 9:
        with np.errstate(invalid="ignore", divide="ignore"):
            alike = [np.corrcoef(moving[:, k], moving[:, k + 3])[0, 1] for k in range(3)]
        if min(alike) > 0.9:
            return (4, 5, 6), "the first three follow the last three: displacement, then force"
    return (1, 2, 3), "the first three"


def _with_axes(values: npt.NDArray[Any], columns: Columns) -> npt.NDArray[Any]:
    """Return x, y and z of (..., numbers of a taxel)."""
    numbers = np.array(columns.axes)
    if np.abs(numbers).max() > values.shape[-1]:
        raise RecordingError(
            f"--axes {','.join(map(str, numbers))}: number {np.abs(numbers).max()} given, each taxel "
            f"has {values.shape[-1]}"
        )
    picked: npt.NDArray[Any] = values[..., np.abs(numbers) - 1] * np.sign(numbers)
    return picked


def _check_overlap(modules: Mapping[str, Tactile]) -> None:
    """Check that modules have samples at the same time.

    Raises:
        RecordingError: they have not.
    """
    spans = {name: (m.times[0], m.times[-1]) for name, m in modules.items() if m.n_samples}
    for (first, a), (second, b) in itertools.combinations(spans.items(), 2):
        if a[1] < b[0] or b[1] < a[0]:
            raise RecordingError(
                f"{first} has times {a[0]:.6g} to {a[1]:.6g} s and {second} {b[0]:.6g} to "
                f"{b[1]:.6g} s, two clocks that do not overlap: import them one by one"
            )


def _texts(array: StoredArray) -> list[str]:
    """Return the cells of a column as text."""
    values = array.read().reshape(-1).tolist()
    return [x if isinstance(x, str) else "" if x != x else f"{x:g}" for x in values]


def _is_number(text: str) -> bool:
    return re.fullmatch(r"[-+]?\d+(\.\d*)?", text) is not None


def _once(read: Callable[[], npt.NDArray[Any]]) -> Callable[[], npt.NDArray[Any]]:
    kept: list[npt.NDArray[Any]] = []

    def again() -> npt.NDArray[Any]:
        if not kept:
            kept.append(read())
        return kept[0]

    return again
