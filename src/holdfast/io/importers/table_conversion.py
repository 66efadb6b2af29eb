"""Recordings of a table with any columns: modules, episodes, times, labels; a guess is reported."""

import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.io.importers.csv_columns import Columns, Layout, column_of_rows
from holdfast.io.importers.csv_times import check_steps, clock_seconds, seconds_of, unit_of_column
from holdfast.io.importers.table import Table, natural_order, with_integer_type
from holdfast.recordings import Label, Recording, Tactile, labels_from_samples
from holdfast.sensors import Sensor, built_in_sensors, sensor, taxel_numbers
from holdfast.sensors.types import Array

TIME = "time"
DEFAULT_MODULE = "finger1"
"""Name of the module if the columns do not name one."""
ANY_MODULE = "*"
"""Key of the sensor of all modules that have none of their own."""

MAX_SHOWN = 6
"""Maximum number of unused columns that a text lists."""
MIN_EPISODE = 10
"""Minimum number of samples from a restart of the times to the next."""
MAX_MODULES = 20
"""Maximum number of modules that rows are divided among without being asked to."""

RowIndices = npt.NDArray[np.intp] | slice
"""RowIndices of a table."""
Settings = Mapping[tuple[str, str | None], str]
"""Value by key (sensor or unit) and module; None for all modules."""
Report = Callable[[str], None]
ReportOnce = Callable[[str, tuple[str, ...]], None]
"""Receives what was guessed, and the lines about it; those of an equal guess are left out."""
TableReader = Callable[[set[str], Columns], tuple[Table, dict[str, list[str]]]]

_COMMENT = re.compile(r"(?P<key>sensor|unit)\s*:\s*(?:(?P<module>[^=]+?)\s*=)?\s*(?P<value>\S+)")


def reported_once(report: Report) -> ReportOnce:
    """Return a function that reports the lines about a guess once."""
    reported: set[str] = set()

    def once(guess: str, lines: tuple[str, ...]) -> None:
        if guess not in reported:
            reported.add(guess)
            for line in lines:
                report(line)

    return once


def recordings_of_table(
    names: Sequence[str],
    read: TableReader,
    what: str,
    sensors: Mapping[str, Sensor],
    columns: Columns | None,
    report: ReportOnce,
    guess: Columns | None = None,
) -> list[Recording]:
    """Return the recordings in a table with any names of the columns; report a guess.

    Args:
        names: of the columns.
        read: returns the table and its cells of text, given the columns of the taxels, which are
            numbers, and all columns.
        what: the table, for the report.
        sensors: as in `read`.
        columns: as in `read`.
        report: receives the guess and its lines.
        guess: the columns with what is known besides.

    Raises:
        RecordingError: columns are missing, or their values contradict each other.
    """
    n_taxels = {one.n_taxels for one in sensors.values()}
    units = {one.unit for one in sensors.values()}
    chosen = (guess or columns or Columns()).completed(names, n_taxels, units)
    layout = chosen.layout(names, n_taxels)
    layout = {module or DEFAULT_MODULE: own for module, own in layout.items()}
    used = {name for own in layout.values() for name in own.values()}
    text = {"label": chosen.label, "cause": chosen.cause}
    of_rows = {
        kind: getattr(chosen, kind) or column_of_rows(kind, [n for n in names if n not in used])
        for kind in ("module", "episode")
    }
    table, found = read(used, chosen)
    cells = {name: found[column] for name, column in text.items() if column in found}
    clock = clock_seconds(found[chosen.time]) if chosen.time in found else None
    modules = _modules_of_rows(found.get(of_rows["module"] or "", []), layout, bool(chosen.module))
    first = next(iter(modules.values()), slice(None))
    times, unit = _times(table, chosen, first) if clock is None else (clock, None)
    episodes = _episodes(
        times, first, found.get(of_rows["episode"] or "", []), bool(chosen.episode)
    )
    known = replace(
        chosen,
        time_unit=None if chosen.rate else unit,
        module=of_rows["module"] if modules else None,
        episode=of_rows["episode"] if len(episodes) > 1 else chosen.episode,
    )
    if known != columns:
        report(str(known), _guess_text(what, known, times[first], layout, names))
    recordings = []
    for episode, rows in episodes.items():
        part = _Part(table, cells, times, rows)
        recording = part.recording(chosen, layout, modules, sensors)
        several = len(episodes) > 1 or chosen.episode
        name = f"{table.path.stem}-{episode}" if several else table.path.stem
        recordings.append(replace(recording, name=name))
    if chosen.signs is None:
        return recordings
    return [_with_signs(recording, chosen.factors) for recording in recordings]


class _Part(NamedTuple):
    """The rows of a file that belong to a recording."""

    table: Table
    cells: Mapping[str, list[str]]
    times: Array
    rows: npt.NDArray[np.intp]

    def recording(
        self,
        columns: Columns,
        layout: Layout,
        modules: Mapping[str, npt.NDArray[np.intp]],
        sensors: Mapping[str, Sensor],
    ) -> Recording:
        """Return the recording; with `modules`, each has the rows of its own."""
        found: dict[str, Tactile] = {}
        of_modules = modules or {"": np.arange(len(self.times))}
        for name, own in of_modules.items():
            rows = np.intersect1d(self.rows, own)
            if not columns.rate:
                check_steps(columns.time or TIME, self.times[rows])
            table = self.table._replace(
                values=self.table.values[rows], first_line=self.table.first_line + int(rows[0])
            )
            cells = {key: [column[row] for row in rows] for key, column in self.cells.items()}
            named = {name: next(iter(layout.values()))} if modules else layout
            settings = settings_of(table)
            found |= recording_of_columns(
                table, cells, self.times[rows], named, settings, sensors
            ).modules
        return Recording(self.table.path.stem, found, {"source": self.table.path.name})


def _modules_of_rows(
    values: list[str], layout: Layout, is_given: bool
) -> dict[str, npt.NDArray[np.intp]]:
    """Return the rows of each module, if a column names it and the modules take turns.

    Raises:
        RecordingError: a module has both columns and rows of its own.
    """
    kinds = sorted(set(values), key=lambda text: natural_order(Path(text)))
    n_changes = sum(a != b for a, b in itertools.pairwise(values))
    takes_turns = 1 < len(kinds) <= MAX_MODULES and n_changes > len(values) / 4
    if not takes_turns and not is_given:
        return {}
    if len(layout) > 1:
        raise RecordingError(
            f"{len(layout)} modules by columns and {len(kinds)} by rows given; one of both expected"
        )
    cells = np.array(values)
    return {
        kind if _number(kind) is None else f"finger{k + 1}": np.flatnonzero(cells == kind)
        for k, kind in enumerate(kinds)
    }


def _number(text: str) -> float | None:
    """Return the number of a text; None if it is none."""
    try:
        return float(text)
    except ValueError:
        return None


def _episodes(
    times: Array, first: RowIndices, values: list[str], is_given: bool
) -> dict[str, npt.NDArray[np.intp]]:
    """Return the rows of each episode: by a column that is given, or from a restart of the times.

    A column of episodes that is not given counts only where times restart.
    """
    rows = np.arange(len(times))
    of_module = rows[first]
    own = times[of_module]
    back = np.flatnonzero(np.diff(own) < 0) + 1
    if is_given:
        found: dict[str, list[int]] = {}
        for row, value in enumerate(values):
            found.setdefault(_episode_name(value), []).append(row)
        return {name: np.array(indices) for name, indices in found.items()}
    if not len(back):
        return {"1": rows}
    if values:
        starts = [0, *(k for k in range(1, len(values)) if values[k] != values[k - 1])]
        names = [_episode_name(values[start]) for start in starts]
    else:
        steps = np.diff(own)
        latest = own[0] + 2 * (float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0)
        lengths = np.diff([0, *back, len(own)])
        if (own[back] > latest).any() or lengths.min() < MIN_EPISODE:
            return {"1": rows}  # a clock that was set back, or no times at all
        starts = [0, *(int(of_module[k]) for k in back)]
        names = [str(k + 1) for k in range(len(starts))]
    if len(set(names)) < len(names):
        return {"1": rows}
    ends = [*starts[1:], len(rows)]
    return {name: rows[start:end] for name, start, end in zip(names, starts, ends, strict=True)}


def _episode_name(value: str) -> str:
    number = _number(value)
    return value if number is None else f"{number:g}"


def _with_signs(recording: Recording, factors: Array) -> Recording:
    """Return the recording with its readings times a factor for each axis."""
    modules = {
        name: replace(module, readings=with_integer_type(module.readings * factors))
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules)


def _times(table: Table, columns: Columns, first: RowIndices) -> tuple[Array, str]:
    """Return the times of all rows, and their unit by the rows of the first module."""
    if columns.rate is not None:
        return np.arange(len(table.values)) / columns.rate, "s"
    name = columns.time or TIME
    values = table.columns([name])[:, 0]
    unit = columns.time_unit or unit_of_column(name, values[first], str(table.path))
    return seconds_of(values, unit)


def _guess_text(
    what: str, columns: Columns, times: Array, layout: Layout, names: Sequence[str]
) -> tuple[str, str]:
    """Return two lines: what was guessed, and the option that says the same."""
    steps = np.diff(times)
    rate = 1 / float(np.median(steps)) if len(steps) and np.median(steps) > 0 else 0.0
    modules = [f"{name} {len(own) // 3} taxels" for name, own in layout.items()]
    used = {columns.time, columns.label, columns.cause, columns.module, columns.episode}
    used |= {name for own in layout.values() for name in own.values()}
    others = [name for name in names if name not in used]
    more = f" and {len(others) - MAX_SHOWN} more" if len(others) > MAX_SHOWN else ""
    unused = (", ".join(others[:MAX_SHOWN]) or "none") + more
    return (
        f"{what}: the columns are a guess: {rate:.4g} Hz, {', '.join(modules)}; "
        f"columns that are not used: {unused}",
        f"  the same as --columns '{columns}' (give this option to correct it)",
    )


def recording_of_columns(
    table: Table,
    cells: Mapping[str, list[str]],
    times: Array,
    layout: Layout,
    settings: Settings,
    sensors: Mapping[str, Sensor],
) -> Recording:
    """Return the recording in the columns of a table.

    Args:
        table: the numbers.
        cells: text by column: `label`, `cause`, `MODULE.label` and `MODULE.cause`.
        times: (n,) of the rows [s].
        layout: columns of the modules.
        settings: from `settings_of`.
        sensors: sensor by module, or of `"*"` for all; they precede those of the settings.

    Raises:
        RecordingError: a sensor is missing or has other taxels, or a label is unknown.
    """
    modules = {
        name: _module(table, times, name, columns, settings, sensors)
        for name, columns in layout.items()
    }
    labelled = {
        name: replace(module, labels=_labels(table, cells, name, module))
        for name, module in modules.items()
    }
    return Recording(table.path.stem, labelled, {"source": table.path.name})


def settings_of(table: Table) -> Settings:
    """Return the values of comments like `# sensor: thumb=uskin-curved`, by key and module."""
    found = (_COMMENT.fullmatch(line) for line in table.comments)
    return {(match["key"], match["module"]): match["value"] for match in found if match}


def _module(
    table: Table,
    times: Array,
    name: str,
    columns: Mapping[tuple[int, str], str],
    settings: Settings,
    sensors: Mapping[str, Sensor],
) -> Tactile:
    # What the user gives comes before what the file says.
    one = sensors.get(name) or sensors.get(ANY_MODULE)
    if one is None:
        stated = settings.get(("sensor", name)) or settings.get(("sensor", None))
        if stated is None:
            n_taxels = len({taxel for taxel, _ in columns})
            raise RecordingError(
                f"the sensor of {name} ({n_taxels} taxels) is missing: --sensor NAME or --sensor "
                f"FILE.json expected, or a line '# sensor: {name}=NAME' above the header; built in "
                f"are {', '.join(built_in_sensors())}; `holdfast sensors --template "
                f"ROWSxCOLUMNS > FILE.json` makes a file of a flat grid"
            )
        try:
            one = sensor(stated)
        except ValueError as cause:
            raise RecordingError(str(cause)) from cause
    wanted = [(number, axis) for number in taxel_numbers(range(one.n_taxels)) for axis in "xyz"]
    if set(columns) != set(wanted):
        n_given = len({taxel for taxel, _ in columns})
        raise RecordingError(
            f"{name}: {n_given} taxels in {len(columns)} columns given; {one.n_taxels} taxels "
            f"x 3 axes from t01 on expected ({one.name})"
        )
    unit = settings.get(("unit", name)) or settings.get(("unit", None))
    if unit not in (None, "count", "N"):
        raise RecordingError(f"unit 'count' or 'N' expected for {name}, {unit!r} given")
    readings = with_integer_type(table.columns([columns[key] for key in wanted]))
    shaped = readings.reshape(-1, one.n_taxels, 3)
    return Tactile(one, times, shaped, unit)  # type: ignore[arg-type]


def _labels(
    table: Table, cells: Mapping[str, list[str]], name: str, module: Tactile
) -> tuple[Label, ...]:
    blank = [""] * module.n_samples
    states = cells.get(f"{name}.label", cells.get("label", blank))
    causes = cells.get(f"{name}.cause", cells.get("cause", blank))
    # A label says UNKNOWN by having no state.
    known = [s.value.lower() for s in ContactState if s is not ContactState.UNKNOWN]
    pairs: list[tuple[ContactState, Cause | None] | None] = []
    for row, words in enumerate(zip(states, causes, strict=True), table.first_line):
        state, cause = (word.strip() for word in words)
        where = f"{table.path}, row {row}"
        if state and state.lower() not in known:
            raise RecordingError(f"{where}: label {state!r} given; {', '.join(known)} are known")
        if state and cause.lower() not in ("", *Cause):
            raise RecordingError(f"{where}: cause {cause!r} given; {', '.join(Cause)} are known")
        named = Cause(cause.lower()) if state and cause else None
        pairs.append((ContactState(state.upper()), named) if state else None)
    return labels_from_samples(module.times, pairs, period=module.period, evidence="csv")
