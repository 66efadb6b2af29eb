"""Import of the generic CSV of docs/formats.md, a format that is easy to write."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.io.importers.table import Table, csv_files, header_line, read_table, with_integer_type
from holdfast.recordings import Label, Recording, Tactile, labels_from_samples
from holdfast.sensors import Sensor, built_in_sensors, sensor
from holdfast.sensors.types import Unit

TIME = "time"
DEFAULT_MODULE = "finger1"
"""Name of the module if the columns do not name one."""

Settings = Mapping[tuple[str, str | None], str]
"""Value by key (sensor or unit) and module; None for all modules."""

_TAXEL = re.compile(r"(?:(?P<module>.+)\.)?t(?P<taxel>\d+)[._](?P<axis>[xyz])")
_TEXT = re.compile(r"(?:(?P<module>.+)\.)?(?P<column>label|cause)")
_COMMENT = re.compile(r"(?P<key>sensor|unit)\s*:\s*(?:(?P<module>[^=]+?)\s*=)?\s*(?P<value>\S+)")


def can_read(path: Path) -> bool:
    """Return whether `path` is such a CSV file, or a folder with one."""
    return any(_is_header(header_line(file)) for file in csv_files(path))


def read(path: Path, sensors: Mapping[str, Sensor] | None = None) -> Iterator[Recording]:
    """Read the recording in a CSV file, or those in the CSV files of a folder.

    Args:
        path: path of the file or folder.
        sensors: sensor by module; they precede those that the file names.

    Raises:
        RecordingError: there is no CSV file, or one has another form.
    """
    files = [file for file in csv_files(path) if path.is_file() or _is_header(header_line(file))]
    if not files:
        raise RecordingError(
            f"no CSV file in {path} with a column {TIME!r} and taxel columns; both are expected"
        )
    return (_recording(file, sensors or {}) for file in files)


def _is_header(names: tuple[str, ...]) -> bool:
    return TIME in names and any(_TAXEL.fullmatch(name) for name in names)


def _recording(path: Path, sensors: Mapping[str, Sensor]) -> Recording:
    names = header_line(path)
    table, cells = read_table(path, [name for name in names if _TEXT.fullmatch(name)])
    layout = _layout(table)
    settings = _settings(table)
    try:
        modules = {
            name: _module(table, name, columns, settings, sensors)
            for name, columns in layout.items()
        }
        labelled = {
            name: replace(module, labels=_labels(table, cells, name, module))
            for name, module in modules.items()
        }
        return Recording(path.stem, labelled, {"source": path.name})
    except RecordingError as cause:
        text = str(cause)
        raise RecordingError(text if str(path) in text else f"{path}: {text}") from cause


def _layout(table: Table) -> dict[str, dict[tuple[int, str], str]]:
    """Return the column of each taxel and axis, by module."""
    layout: dict[str, dict[tuple[int, str], str]] = {}
    for name in table.names:
        taxel = _TAXEL.fullmatch(name)
        if taxel:
            columns = layout.setdefault(taxel["module"] or DEFAULT_MODULE, {})
            columns[int(taxel["taxel"]), taxel["axis"]] = name
        elif name != TIME and not _TEXT.fullmatch(name):
            raise RecordingError(
                f"{table.path}: unknown column {name!r}; {TIME!r}, 'MODULE.t01.x' (or 't01_x'), "
                "'label', 'cause', 'MODULE.label' and 'MODULE.cause' are known"
            )
    if not layout:
        raise RecordingError(f"{table.path}: no taxel columns such as 'thumb.t01.x' or 't01_x'")
    return layout


def _settings(table: Table) -> Settings:
    """Return the values of comments like `# sensor: thumb=uskin-curved`, by key and module."""
    found = (_COMMENT.fullmatch(line) for line in table.comments)
    return {(match["key"], match["module"]): match["value"] for match in found if match}


def _module(
    table: Table,
    name: str,
    columns: Mapping[tuple[int, str], str],
    settings: Settings,
    sensors: Mapping[str, Sensor],
) -> Tactile:
    one = sensors.get(name) or _sensor(name, settings)
    wanted = [(taxel + 1, axis) for taxel in range(one.n_taxels) for axis in "xyz"]
    if set(columns) != set(wanted):
        n_given = len({taxel for taxel, _ in columns})
        raise RecordingError(
            f"{name}: {n_given} taxels in {len(columns)} columns given; {one.n_taxels} taxels "
            f"x 3 axes from t01 on expected ({one.name})"
        )
    values = table.columns([columns[key] for key in wanted])
    times = table.columns([TIME])[:, 0]
    return Tactile(
        one, times, with_integer_type(values).reshape(-1, one.n_taxels, 3), _unit(name, settings)
    )


def _sensor(name: str, settings: Settings) -> Sensor:
    given = settings.get(("sensor", name)) or settings.get(("sensor", None))
    if given is None:
        raise RecordingError(
            f"the sensor of {name} is missing: a line '# sensor: {name}=NAME' expected above the "
            f"header; built in are {', '.join(built_in_sensors())}"
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
