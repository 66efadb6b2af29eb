"""Recordings from the columns or arrays of a file.

Names and shapes, or options, say which numbers are the times and which the taxels. What is not
said is proposed, see `proposals.py`.
"""

import itertools
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.io.importers import times as of_times
from holdfast.io.importers.columns import THREE_AXES, Columns, named_column, unit_factor
from holdfast.io.importers.layout_findings import layout_findings, mended
from holdfast.io.importers.names import EPISODE_OF_ROWS, MODULE_OF_ROWS
from holdfast.io.importers.stored import StoredArray
from holdfast.io.importers.table import (
    errors_named,
    first_texts,
    natural_order,
    some_names,
    with_integer_type,
)
from holdfast.io.importers.tracks import (
    ANY_MODULE,
    MAX_FINGERS,
    ForeignFile,
    Layout,
    Track,
    rate_beside,
    tracks_of,
)
from holdfast.io.proposals import Proposal, ProposalError, found_lines
from holdfast.recordings import Label, Recording, Tactile, labels_from_samples
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

__all__ = ["ANY_MODULE", "ForeignFile", "recordings_of"]

DEFAULT_MODULE = "finger1"
"""Name of the module if nothing names one."""
MAX_BEYOND_SHARE = 0.5
"""Share of samples beyond the range of a device above which they are no faults of it."""
MAX_OTHER_SHARE = 0.5
"""Share of taxels with a reading up to which the rows of a module are those of another device."""

Rows = npt.NDArray[np.intp]
"""Indices of samples of a table."""


def recordings_of(
    source: ForeignFile,
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
            first groups or its last name, and may have `*`; `a+b` lays two arrays together.
        columns: what the user says of the layout.
        report: receives what was read, and what not.
        accept: take what is proposed.

    Raises:
        ProposalError: the layout is not said, but names or shapes speak for one.
        RecordingError: nothing speaks for a layout, or the data contradict it.
    """
    said = columns or Columns()
    with errors_named(source.path):
        reader = _Reader(Layout(source, dict(sensors), said), said)
        recordings = reader.recordings()
        findings: list[str] = []
        while stop := reader.stop():  # each mends one field of the layout
            findings.append(stop)
            recordings = reader.recordings()
    choices = reader.layout.choices
    if findings or not (accept or all(choice.is_said for choice in choices)):
        raise ProposalError(reader.proposal(findings))
    summary = [] if source.stated else [reader.summary(recordings)]  # holdfast's own says it all
    for line in (*source.notes, *reader.notes, *summary):
        report(f"{source.path.name}: {line}")
    return recordings


class _Reader:
    """Reader of the columns or arrays of one file.

    Attributes:
        layout: of the file.
        notes: lines about what was left out.
    """

    def __init__(self, layout: Layout, said: Columns) -> None:
        self.layout = layout
        self.notes: list[str] = []
        self._said = said
        self._raw: list[tuple[str, Track, Array]] = []
        self._tracks = tracks_of(layout)

    @property
    def _columns(self) -> Columns:
        return self.layout.columns

    def recordings(self) -> list[Recording]:
        """Return the recordings by the layout as it is known."""
        self._raw, self.notes = [], []
        by_end: dict[str, dict[str, Tactile]] = {}
        for track in self._tracks:
            for end, name, module in self._modules(track):
                if name in by_end.setdefault(end, {}):
                    raise RecordingError(f"two modules {name!r} given; each needs its own name")
                by_end[end][name] = module
        path = self.layout.source.path
        for modules in by_end.values():
            _check_overlap(modules)
        return [
            Recording(f"{path.stem}{end}", modules, {"source": path.name})
            for end, modules in by_end.items()
        ]

    def _modules(self, track: Track) -> Iterator[tuple[str, str, Tactile]]:
        """Yield end of the recording's name, name and samples of each module of a track."""
        values = np.asarray(track.values(), dtype=np.float64)
        factor, kept = self._unit(track)
        readings = (
            values[..., :3] if self._columns.axes is None else _picked(values, self._columns.axes)
        )
        by_module = self._rows_by("module", track) or {"": np.arange(len(values))}
        if "" not in by_module and len(track.modules) > 1:
            raise RecordingError(
                f"{len(track.modules)} modules by columns and {len(by_module)} by rows given; one "
                "of both expected"
            )
        by_module = self._with_readings(by_module, readings)
        first = next(iter(by_module.values()))
        times = self._times(track, first, len(values))
        for episode, of_episode in self._episodes(track, times, first).items():
            for row_module, of_module in by_module.items():
                rows = np.intersect1d(of_episode, of_module)
                rows = rows[self._in_order(times[rows])]
                for k, name in enumerate(track.modules):
                    module, raw = row_module or name or DEFAULT_MODULE, readings[rows, k]
                    self._raw.append((module, track, raw))
                    part = mended(raw.copy(), self._columns.missing, self._columns.wrap)
                    is_sample = np.isfinite(part).any(axis=(1, 2))
                    # A row without a reading is no sample if a number stands for it, or if there is
                    # one between any two samples: the rows of a faster device.
                    is_sparse = (
                        is_sample.any()
                        and of_times.median_step(np.flatnonzero(is_sample).astype(np.float64)) > 1
                    )
                    if self._columns.missing is None and is_sparse:
                        n_empty = np.count_nonzero(~is_sample)
                        self.notes.append(f"{n_empty} rows without a reading are left out")
                    is_sample |= self._columns.missing is None and not is_sparse
                    numbers = with_integer_type(factor * part[is_sample])
                    skin = self._skin(track, module, numbers, kept)
                    tactile = Tactile(skin, times[rows][is_sample], numbers, kept)  # type: ignore[arg-type]
                    labels = self._labels(track, module, rows[is_sample], tactile)
                    end = f"{track.recording}{episode and '-' + episode}"
                    yield end, module, replace(tactile, labels=labels)

    def _with_readings(self, by_module: dict[str, Rows], readings: Array) -> dict[str, Rows]:
        """Return the modules by rows, without other devices, which fill few of the cells."""
        is_read = np.isfinite(readings)
        share = {
            name: is_read[rows].all(axis=-1).any(axis=0).mean() for name, rows in by_module.items()
        }
        others = [name for name in share if share[name] <= MAX_OTHER_SHARE]
        if max(share.values()) < 1:
            return by_module
        if others:
            text = "left out, because most of its taxels have no reading: "
            self.notes.append(text + ", ".join(others))
        return {name: rows for name, rows in by_module.items() if name not in others}

    def _skin(self, track: Track, module: str, readings: npt.NDArray[Any], unit: str) -> Sensor:
        """Return the sensor, without its range if most samples cannot come from the device.

        A baseline was subtracted then: what is left may lie below the least reading.
        """
        skin = track.skin
        if skin.range is None or unit != skin.unit or not readings.size:
            return skin
        low, high = skin.range
        beyond = (readings < low) | (readings > high)
        if beyond.any(axis=(1, 2)).mean() <= MAX_BEYOND_SHARE:
            return skin
        self.notes.append(
            f"{module}: readings from {np.nanmin(readings):g} to {np.nanmax(readings):g}, beyond "
            f"the range {low:g} to {high:g} of {skin.name}: taken as differences from a baseline"
        )
        return replace(skin, range=None)

    def _unit(self, track: Track) -> tuple[float, str]:
        """Return the factor to the unit that is kept, and that unit."""
        stated = self.layout.source.stated
        stated_unit = stated.get(("unit", track.modules[0])) or stated.get(("unit", None))
        if stated_unit not in (None, "count", "N"):
            raise RecordingError(f"unit 'count' or 'N' expected, {stated_unit!r} given")
        is_given = bool(self._columns.unit or stated_unit)
        unit = self._columns.unit or stated_unit or track.unit or track.skin.unit
        if is_given or track.unit:
            why = "as given" if is_given else "by the names"
            self.layout.choose("unit", unit, why, is_said=True)
        return unit_factor(unit, track.skin, is_given=is_given)

    def _column(self, track: Track, text: str) -> str:
        """Return the column beside a track that the user names.

        Raises:
            RecordingError: there is none.
        """
        names = list(track.beside)
        name = text if text in names else named_column(names, text.strip("/"))
        name = name if name in names else name.rpartition("/")[2]
        if name not in names:
            raise RecordingError(f"column {text!r} is missing; it has {some_names(names)}")
        self.layout.used.add(name)
        return name

    def _rows_by(self, kind: str, track: Track) -> dict[str, Rows]:
        """Return the rows of each module or recording by a column; none without one."""
        column = getattr(self._columns, kind)
        pattern = MODULE_OF_ROWS if kind == "module" else EPISODE_OF_ROWS
        free = (n for n in track.beside if n not in track.used and pattern.fullmatch(n.strip()))
        name = self._column(track, column) if column else next(free, None)
        if name is None:
            return {}
        cells = _texts(track.beside[name])
        kinds = sorted(set(cells), key=lambda text: natural_order(Path(text)))
        n_changes = sum(a != b for a, b in itertools.pairwise(cells))
        takes_turns = 1 < len(kinds) <= MAX_FINGERS and n_changes > len(cells) / 4
        is_run = (
            n_changes == len(kinds) - 1 > 0 and min(Counter(cells).values()) >= of_times.MIN_EPISODE
        )
        if not column and not (takes_turns if kind == "module" else is_run):
            return {}
        self.layout.used.add(name)
        is_numbered = kind == "module" and all(
            re.fullmatch(r"[-+]?\d+(\.\d*)?", text) for text in kinds
        )
        texts = np.array(cells)
        return {
            f"finger{k + 1}" if is_numbered else text: np.flatnonzero(texts == text)
            for k, text in enumerate(kinds)
        }

    def _episodes(self, track: Track, times: Array, first: Rows) -> dict[str, Rows]:
        """Return the rows of each recording: by a column, or from a restart of the times."""
        rows = np.arange(len(times))
        starts = of_times.restarts(times[first])
        by_column = self._rows_by("episode", track) if self._columns.episode or starts else {}
        if by_column:
            return by_column
        at = [0, *(int(first[k]) for k in starts), len(rows)]
        parts = enumerate(itertools.pairwise(at), start=1)
        return {str(k): rows[a:b] for k, (a, b) in parts} if starts else {"": rows}

    def _times(self, track: Track, first: Rows, n: int) -> Array:
        """Return the times of all rows [s]; the first module has them."""
        name = self._time_name(track, first)
        if name is None:
            return np.arange(n) / (self._columns.rate or 1.0)
        array = track.beside[name]
        values = array.read().reshape(-1)
        if array.kind == "U":
            clock = of_times.clock_seconds(values.tolist())
            if clock is None:
                raise RecordingError(f"column {name!r}: a time expected, {values[0][:40]!r} given")
            return clock
        values = values.astype(np.float64)
        if self.layout.source.stated and self._columns.time is None:  # holdfast's own CSV
            return values
        stamps = of_times.times_of(name, values[first], self._columns.time_unit, track.skin.rate)
        if stamps.reason:
            self._set_time(f"{name}:{stamps.unit}", stamps.reason, time=name, time_unit=stamps.unit)
        times: Array = values * of_times.TIME_UNITS[stamps.unit]
        problem = (
            "" if of_times.restarts(times[first]) else of_times.check_steps(name, times[first])
        )
        is_back = np.diff(times[first]) <= 0
        few_back = np.mean(~of_times.increasing(times[first])) <= of_times.MAX_STEPS_BACK
        if not problem or (is_back.any() and few_back):
            return times
        columns = {other: array.read() for other, array in track.beside.items() if other != name}
        if turning := of_times.turning_columns(times, columns):
            raise RecordingError(
                f"a row for each {' and '.join(turning)} at each of the times of {name!r} given, a "
                f"row for each time expected: pandas.DataFrame.pivot(index={name!r}, "
                f"columns={turning}) makes it, its columns named as t01_x, t01_y, t01_z, t02_x"
            )
        rate = of_times.true_rate(times[first])
        if rate is None:
            raise RecordingError(
                f"{problem}: their last digits are lost; increasing times expected: give "
                "--columns time=100Hz with the true rate if the samples are evenly spaced"
            )
        self._set_time(f"{rate:g}Hz", problem, time=f"{rate:g}Hz", time_unit=None)
        return np.arange(n) / rate

    def _set_time(self, value: str, reason: str, **fields: str | None) -> None:
        self.layout.columns = replace(self._columns, **fields)  # type: ignore[arg-type]
        self.layout.choose("time", value, reason)

    def _time_name(self, track: Track, first: Rows) -> str | None:
        """Return the column of times beside a track; None if there is a rate."""
        choose, text = self.layout.choose, self._columns.time
        if any(choice.what == "time" and not choice.is_said for choice in self.layout.choices):
            choose = lambda *_, **__: None  # noqa: E731 (it is proposed already)
        if self._columns.rate is not None:
            choose("time", str(text), "as given", is_said=True)
            return None
        if text is not None:
            choose("time", str(self._columns).partition(",")[0][5:], "as given", is_said=True)
            return self._column(track, text)
        names = self._own_times(
            track, of_times.time_names([name for name in track.beside if name not in track.used])
        )
        if not names and (rate := rate_beside(self.layout, track)):
            self.layout.columns = replace(self._columns, time=rate)
            choose("time", rate, "a number beside the array", is_said=True)
            return None
        if not names:
            among = f" among {some_names(list(track.beside))}" if track.beside else ""
            raise RecordingError(
                f"no column of times{among}: give --columns time=COLUMN, or time=100Hz with the "
                "true rate if there is none"
            )
        numbers = {
            name: track.beside[name].read().reshape(-1).astype(np.float64)[first]
            for name in names
            if track.beside[name].kind in "biuf"
        }
        best = of_times.smoothest(numbers) if names[0] in numbers else names[0]
        why = "by its name" if best == names[0] else f"its steps vary less than those of {names[0]}"
        choose("time", best, why, is_said=True)
        self.layout.used.add(best)
        return best

    @staticmethod
    def _own_times(track: Track, names: list[str]) -> list[str]:
        """Return the columns of times that name the module of a track; all if none does.

        Raises:
            RecordingError: each of several modules has a column of its own.
        """
        words = {name: re.split(r"[\W_]+", name) for name in names}  # `l` is not in `elapsed`
        own = {
            module: [n for n in names if module and module in words[n]] for module in track.modules
        }
        named = [found[0] for found in own.values() if found]
        if len(set(named)) > 1:
            raise RecordingError(
                f"times of each module given ({', '.join(named)}), one column for all of them "
                "expected: import each by itself, with --columns time=COLUMN,taxels=FIRST..LAST"
            )
        return own[track.modules[0]] if named and len(track.modules) == 1 else names

    def _in_order(self, times: Array) -> npt.NDArray[np.bool_]:
        """Return which samples have a stamp after all before; a few may step back."""
        kept = of_times.increasing(times) | ~np.isfinite(times)
        if n := int(np.count_nonzero(~kept)):
            first = int(np.flatnonzero(~kept)[0]) + 1
            self.notes.append(
                f"{n} samples, the first is {first}, have stamps that step back: left out"
            )
        return kept

    def _labels(self, track: Track, module: str, rows: Rows, tactile: Tactile) -> tuple[Label, ...]:
        """Return the labels of a module by the columns `label` and `cause`."""
        cells = {"cause": [""] * len(rows)}
        for kind in ("label", "cause"):
            column = getattr(self._columns, kind)
            names = [self._column(track, column)] if column else [f"{module}.{kind}", kind]
            if name := next((name for name in names if name in track.beside), None):
                texts = _texts(track.beside[name])
                cells[kind] = [texts[row].strip() for row in rows]
                self.layout.used.add(name)
        # Numbers are classes of another program; a column that the user names must have our words.
        given = set(cells.get("label", ())) - {""}
        if given and not self._columns.label and all(re.fullmatch(r"[\d.]+", x) for x in given):
            text = f"labels {', '.join(sorted(given)[:3])} are not used: words are expected"
            self.notes.extend([text] if text not in self.notes else [])
            return ()
        # A label says UNKNOWN by having no state.
        states = [s.value.lower() for s in ContactState if s is not ContactState.UNKNOWN]
        pairs: list[tuple[ContactState, Cause | None] | None] = []
        for row, state, cause in zip(
            rows.tolist(), cells.get("label", ()), cells["cause"], strict=False
        ):
            for what, word, words in (("label", state, states), ("cause", cause, [*Cause])):
                if state and word and word.lower() not in words:
                    raise RecordingError(
                        f"sample {row + 1}: {what} {word!r} given; {', '.join(words)} are known"
                    )
            named = Cause(cause.lower()) if state and cause else None
            pairs.append((ContactState(state.upper()), named) if state else None)
        if not pairs:
            return ()
        return labels_from_samples(tactile.times, pairs, period=tactile.period, evidence="csv")

    def stop(self) -> str | None:
        """Return the first finding that makes every state wrong, and mend it; None without one.

        Raises:
            RecordingError: no option mends it.
        """
        for module, track, values in self._raw:
            is_open = {
                "missing": self._columns.missing is None,
                "wrap": self._columns.wrap is None,
                "unit": not (self._columns.unit or track.unit or self.layout.source.stated),
                "axes": self._said.axes is None,
            }
            part = mended(values.copy(), self._columns.missing, self._columns.wrap)
            for finding in layout_findings(part, track.skin):
                what, _, value = finding.option.partition("=")
                if not finding.stops or not is_open[what]:
                    continue
                if what == "axes":
                    raise RecordingError(
                        f"{module}: {finding.text}; {THREE_AXES}; --axes 1,2,3 takes them so"
                    )
                self.layout.columns = replace(self._columns, **{what: value})  # type: ignore[arg-type]
                self.layout.choose(what, value, "as said above")
                way = "" if what == "unit" else f" ({what}=none takes it as it is)"
                return f"{module}: {finding.text}{way}"
        return None

    def proposal(self, findings: Sequence[str]) -> Proposal:
        """Return the options that import the file by the layout as it is chosen."""
        order = ("sensor", "array", "time", "unit", "fingers", "taxels", "axes", "missing", "wrap")
        axes = self._columns.axes
        return Proposal(
            str(self.layout.source.path), found_lines(self.layout.arrays),
            sorted(self.layout.choices, key=lambda choice: order.index(choice.what)),
            self.layout.options, str(self._columns), ",".join(map(str, axes)) if axes else "",
            self._columns.unit or "", [*findings],
        )  # fmt: skip

    def summary(self, recordings: Sequence[Recording]) -> str:
        """Return a line about what was read."""
        modules = recordings[0].modules
        rate = next(iter(modules.values())).rate
        names = ", ".join(f"{name} {x.sensor.n_taxels} taxels" for name, x in modules.items())
        said = {choice.what: choice for choice in self.layout.choices}
        time, unit = said.get("time"), said.get("unit")
        by = f" by {time.value}" if time and time.value != f"{rate:g}Hz" else ""
        by += f" ({time.reason})" if time and time.reason not in ("by its name", "as given") else ""
        unit_text = f"; unit {unit.value}" if unit else ""
        used = self.layout.used.union(*(track.used for track in self._tracks))
        last = {name.rpartition("/")[2] for name in used}
        unused = [
            n for n in self.layout.arrays if n not in used and n.rpartition("/")[2] not in last
        ]
        return f"{rate:.4g} Hz{by}; {names}{unit_text}; not used: {first_texts(unused)}"


def _picked(values: Array, axes: tuple[int, ...]) -> Array:
    """Return x, y and z of (..., numbers of a taxel)."""
    numbers = np.array(axes)
    if np.abs(numbers).max() > values.shape[-1]:
        raise RecordingError(
            f"--axes: number {np.abs(numbers).max()} given, each taxel has {values.shape[-1]}"
        )
    picked: Array = values[..., np.abs(numbers) - 1] * np.sign(numbers)
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
    return [x if isinstance(x, str) else "" if np.isnan(x) else f"{x:g}" for x in values]
