"""Import of CSV files: the generic CSV of docs/importing.md, and files of any other logger.

In the generic CSV the names of the columns are fixed. The columns of any other file are given
(`Columns`), or guessed from its header; what was guessed is reported.
"""

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.io.importers.csv_columns import (
    TIME_UNITS,
    Columns,
    Layout,
    seconds_of,
    unit_of_column,
)
from holdfast.io.importers.table import (
    Table,
    csv_files,
    errors_named,
    header_line,
    name_prefixes,
    read_table,
    with_integer_type,
)
from holdfast.recordings import Label, Recording, Tactile, labels_from_samples
from holdfast.sensors import Sensor, built_in_sensors, sensor, taxel_number, taxel_numbers
from holdfast.sensors.types import Array, Unit

TIME = "time"
DEFAULT_MODULE = "finger1"
"""Name of the module if the columns do not name one."""
ANY_MODULE = "*"
"""Key of the sensor of all modules that have none of their own."""

Settings = Mapping[tuple[str, str | None], str]
"""Value by key (sensor or unit) and module; None for all modules."""
Report = Callable[[str], None]

_TAXEL = re.compile(r"(?:(?P<module>.+)[._])?t(?P<taxel>\d+)[._](?P<axis>[xyz])")
_TEXT = re.compile(r"(?:(?P<module>.+)\.)?(?P<column>label|cause)")
_COMMENT = re.compile(r"(?P<key>sensor|unit)\s*:\s*(?:(?P<module>[^=]+?)\s*=)?\s*(?P<value>\S+)")


def can_read(path: Path) -> bool:
    """Return whether `path` is such a CSV file, or a folder with one."""
    return any(_is_header(header_line(file)) for file in csv_files(path))


def can_guess(path: Path) -> bool:
    """Return whether `path` is a CSV file, or a folder with one: by its name, or its columns."""
    files = csv_files(path)
    return any(f.suffix.lower() == ".csv" or _is_guessable(header_line(f), ()) for f in files)


def read(
    path: Path,
    sensors: Mapping[str, Sensor] | None = None,
    columns: Columns | None = None,
    report: Report = lambda _: None,
) -> Iterator[Recording]:
    """Read the recording in a CSV file, or those in the CSV files of a folder.

    Args:
        path: path of the file or folder.
        sensors: sensor by module, or of `"*"` for all; they precede those that the file names.
        columns: columns of the file; by default those of the generic CSV, or a guess.
        report: receives a text about each different guess.

    Raises:
        RecordingError: there is no CSV file, or one has another form.
    """
    reported: set[str] = set()

    def report_once(guess: str, lines: tuple[str, ...]) -> None:
        if guess not in reported:
            reported.add(guess)
            for line in lines:
                report(line)

    return (
        replace(recording, name=f"{prefix}{recording.name}")
        for file, prefix in name_prefixes(parts(path, columns, sensors)).items()
        for recording in [_recording(file, sensors or {}, columns, report_once)]
    )


def parts(
    path: Path, columns: Columns | None = None, sensors: Mapping[str, Sensor] | None = None
) -> list[Path]:
    """Return the file, or the CSV files of a folder with columns that can be read.

    If none can, return all of them, so that reading the first gives the reason.

    Args:
        path: path of the file or folder.
        columns: as in `read`.
        sensors: as in `read`.

    Raises:
        RecordingError: there is no CSV file.
    """
    files = csv_files(path)
    if not files:
        raise RecordingError(f"no CSV file in {path}; files NAME.csv expected")
    if path.is_file() or columns:
        return files
    n_taxels = _numbers_of_taxels(sensors or {})
    generic = [file for file in files if _is_header(header_line(file))]
    guessable = (file for file in files if _is_guessable(header_line(file), n_taxels))
    return generic or list(guessable) or files


def _is_header(names: tuple[str, ...]) -> bool:
    return TIME in names and any(_TAXEL.fullmatch(name) for name in names)


def _numbers_of_taxels(sensors: Mapping[str, Sensor]) -> set[int]:
    return {one.n_taxels for one in sensors.values()}


def _is_guessable(names: tuple[str, ...], n_taxels: Collection[int]) -> bool:
    try:
        Columns().completed(names, n_taxels)
    except RecordingError:
        return False
    return True


def _recording(
    path: Path,
    sensors: Mapping[str, Sensor],
    columns: Columns | None,
    report: Callable[[str, tuple[str, ...]], None],
) -> Recording:
    with errors_named(path):
        if columns is None and _is_header(header_line(path)):
            return _generic(path, sensors, report)
        return _of_any_logger(path, sensors, columns or Columns(), report)


def _generic(
    path: Path, sensors: Mapping[str, Sensor], report: Callable[[str, tuple[str, ...]], None]
) -> Recording:
    names = header_line(path)
    table, cells = read_table(path, [name for name in names if _TEXT.fullmatch(name)])
    layout, settings = _layout(table), _settings(table)
    times = table.columns([TIME])[:, 0]
    if not settings:  # not the format of docs/importing.md, in which times are in s
        unit = unit_of_column(TIME, times, str(path))
        times = times * TIME_UNITS[unit]
        if unit != "s":
            line = f"{path.name}: times of column {TIME!r} are taken as {unit}; --columns "
            report(unit, (f"{line}time={TIME}:s if they are in s",))
    return _assembled(table, cells, times, layout, settings, sensors)


def _of_any_logger(
    path: Path,
    sensors: Mapping[str, Sensor],
    columns: Columns,
    report: Callable[[str, tuple[str, ...]], None],
) -> Recording:
    """Return the recording in a file with any names of the columns; report a guess."""
    names = header_line(path) or read_table(path)[0].names  # which reports what is wrong
    chosen = columns.completed(names, _numbers_of_taxels(sensors))
    layout = {module or DEFAULT_MODULE: own for module, own in chosen.layout(names).items()}
    used = {name for own in layout.values() for name in own.values()}
    text = {"label": chosen.label, "cause": chosen.cause}
    table, found = read_table(path, [n for n in names if n not in used | {chosen.time}])
    cells = {name: found[column] for name, column in text.items() if column in found}
    times, unit = _times(table, chosen)
    known = chosen if chosen.rate else replace(chosen, time_unit=unit)
    if known != columns:
        report(str(known), _guess_text(path, known, times, layout, names))
    recording = _assembled(table, cells, times, layout, _settings(table), sensors)
    return recording if chosen.signs is None else _with_signs(recording, chosen.factors)


def _with_signs(recording: Recording, factors: Array) -> Recording:
    """Return the recording with its readings times a factor for each axis."""
    modules = {
        name: replace(module, readings=with_integer_type(module.readings * factors))
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules)


def _times(table: Table, columns: Columns) -> tuple[Array, str]:
    if columns.rate is not None:
        return np.arange(len(table.values)) / columns.rate, "s"
    name = columns.time or TIME
    values = table.columns([name])[:, 0]
    unit = columns.time_unit or unit_of_column(name, values, str(table.path))
    return seconds_of(values, unit)


def _guess_text(
    path: Path, columns: Columns, times: Array, layout: Layout, names: tuple[str, ...]
) -> tuple[str, str]:
    """Return two lines: what was guessed, and the option that says the same."""
    steps = np.diff(times)
    rate = 1 / float(np.median(steps)) if len(steps) and np.median(steps) > 0 else 0.0
    modules = [f"{name} {len(own) // 3} taxels" for name, own in layout.items()]
    used = {columns.time, columns.label, columns.cause}
    used |= {name for own in layout.values() for name in own.values()}
    unused = ", ".join(name for name in names if name not in used) or "none"
    return (
        f"{path.name}: the columns are a guess: {rate:.4g} Hz, {', '.join(modules)}; "
        f"columns that are not used: {unused}",
        f"  the same as --columns '{columns}' (give this option to correct it)",
    )


def _assembled(
    table: Table,
    cells: Mapping[str, list[str]],
    times: Array,
    layout: Layout,
    settings: Settings,
    sensors: Mapping[str, Sensor],
) -> Recording:
    modules = {
        name: _module(table, times, name, columns, settings, sensors)
        for name, columns in layout.items()
    }
    labelled = {
        name: replace(module, labels=_labels(table, cells, name, module))
        for name, module in modules.items()
    }
    return Recording(table.path.stem, labelled, {"source": table.path.name})


def _layout(table: Table) -> Layout:
    """Return the column of each taxel and axis, by module."""
    layout: dict[str, dict[tuple[int, str], str]] = {}
    for name in table.names:
        taxel = _TAXEL.fullmatch(name)
        if taxel:
            columns = layout.setdefault(taxel["module"] or DEFAULT_MODULE, {})
            key = int(taxel["taxel"]), taxel["axis"]
            if key in columns:
                raise RecordingError(
                    f"{table.path}: columns {columns[key]!r} and {name!r} are the same taxel and "
                    "axis; one column for each expected"
                )
            columns[key] = name
        elif name != TIME and not _TEXT.fullmatch(name):
            raise RecordingError(
                f"{table.path}: unknown column {name!r}; {TIME!r}, 'MODULE.t01.x' (or 't01_x'), "
                "'label', 'cause', 'MODULE.label' and 'MODULE.cause' are known; of other files "
                "--columns names the columns"
            )
    if not layout:
        raise RecordingError(f"{table.path}: no taxel columns such as 'thumb.t01.x' or 't01_x'")
    return _counted_from_one(layout)


def _counted_from_one(layout: Layout) -> Layout:
    """Return the layout with taxels from 1, also if the file counts them from 0."""
    first = min(taxel for columns in layout.values() for taxel, _ in columns)
    if first != 0:
        return layout
    return {
        module: {(taxel_number(taxel), axis): name for (taxel, axis), name in columns.items()}
        for module, columns in layout.items()
    }


def _settings(table: Table) -> Settings:
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
    one = sensors.get(name) or sensors.get(ANY_MODULE) or _sensor(name, settings, columns)
    wanted = [(number, axis) for number in taxel_numbers(range(one.n_taxels)) for axis in "xyz"]
    if set(columns) != set(wanted):
        n_given = len({taxel for taxel, _ in columns})
        raise RecordingError(
            f"{name}: {n_given} taxels in {len(columns)} columns given; {one.n_taxels} taxels "
            f"x 3 axes from t01 on expected ({one.name})"
        )
    values = table.columns([columns[key] for key in wanted])
    return Tactile(
        one, times, with_integer_type(values).reshape(-1, one.n_taxels, 3), _unit(name, settings)
    )


def _sensor(name: str, settings: Settings, columns: Mapping[tuple[int, str], str]) -> Sensor:
    given = settings.get(("sensor", name)) or settings.get(("sensor", None))
    if given is None:
        n_taxels = len({taxel for taxel, _ in columns})
        raise RecordingError(
            f"the sensor of {name} ({n_taxels} taxels) is missing: --sensor NAME or --sensor "
            f"FILE.json expected, or a line '# sensor: {name}=NAME' above the header; built in are "
            f"{', '.join(built_in_sensors())}; `holdfast sensors --template "
            f"ROWSxCOLUMNS > FILE.json` makes a file of a flat grid"
        )
    try:
        return sensor(given)
    except ValueError as cause:
        raise RecordingError(str(cause)) from cause


def _unit(name: str, settings: Settings) -> Unit | None:
    given = settings.get(("unit", name)) or settings.get(("unit", None))
    match given:
        case None | "count" | "N":
            return given
    raise RecordingError(f"unit 'count' or 'N' expected for {name}, {given!r} given")


def _labels(
    table: Table, cells: Mapping[str, list[str]], name: str, module: Tactile
) -> tuple[Label, ...]:
    blank = [""] * module.n_samples
    states = cells.get(f"{name}.label", cells.get("label", blank))
    causes = cells.get(f"{name}.cause", cells.get("cause", blank))
    pairs = [
        _state(f"{table.path}, row {row}", state.strip(), cause.strip())
        for row, (state, cause) in enumerate(zip(states, causes, strict=True), table.first_line)
    ]
    return labels_from_samples(module.times, pairs, period=module.period, evidence="csv")


def _state(place: str, state: str, cause: str) -> tuple[ContactState, Cause | None] | None:
    if not state:
        return None
    known = [s.value.lower() for s in ContactState if s is not ContactState.UNKNOWN]
    if state.lower() not in known:
        raise RecordingError(f"{place}: label {state!r} given; {', '.join(known)} are known")
    if cause.lower() not in ("", *Cause):
        raise RecordingError(f"{place}: cause {cause!r} given; {', '.join(Cause)} are known")
    return ContactState(state.upper()), Cause(cause.lower()) if cause else None
