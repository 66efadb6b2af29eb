"""The generic CSV of docs/formats.md: for who has a logger and ten minutes."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.io.importers.table import Table, counts_or, csv_files, header_line, read_table
from holdfast.recordings import Label, Recording, Tactile, labels_from_samples
from holdfast.sensors import Sensor, built_in_sensors, sensor
from holdfast.sensors.types import Unit

TIME = "time"
ONE_MODULE = "finger1"
"""Name of the module where columns name none."""

_TAXEL = re.compile(r"(?:(?P<module>.+)\.)?t(?P<taxel>\d+)[._](?P<axis>[xyz])")
_TEXT = re.compile(r"(?:(?P<module>.+)\.)?(?P<what>label|cause)")
_COMMENT = re.compile(r"(?P<key>sensor|unit)\s*:\s*(?:(?P<module>[^=]+?)\s*=)?\s*(?P<value>\S+)")


def sniff(path: Path) -> bool:
    """Whether it is such a CSV file, or a folder that holds one."""
    return any(_is_header(header_line(file)) for file in csv_files(path))


def read(path: Path, sensors: Mapping[str, Sensor] | None = None) -> Iterator[Recording]:
    """The recording in a CSV file, or those in the CSV files of a folder.

    Args:
        path: of the file or folder.
        sensors: by module; they win over those that the file names.

    Raises:
        RecordingError: there is no CSV file, or one is not as expected.
    """
    files = [file for file in csv_files(path) if path.is_file() or _is_header(header_line(file))]
    if not files:
        raise RecordingError(
            f"no CSV file in {path} with a column {TIME!r} and taxel columns as expected"
        )
    return (_recording(file, sensors or {}) for file in files)


def _is_header(names: tuple[str, ...]) -> bool:
    return TIME in names and any(_TAXEL.fullmatch(name) for name in names)


def _recording(path: Path, sensors: Mapping[str, Sensor]) -> Recording:
    names = header_line(path)
    table, cells = read_table(path, [name for name in names if _TEXT.fullmatch(name)])
    layout = _layout(table)
    said = _comments(table)
    try:
        modules = {
            name: _module(table, name, columns, said, sensors) for name, columns in layout.items()
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
    """The column of each taxel and axis, by module."""
    layout: dict[str, dict[tuple[int, str], str]] = {}
    for name in table.names:
        taxel = _TAXEL.fullmatch(name)
        if taxel:
            columns = layout.setdefault(taxel["module"] or ONE_MODULE, {})
            columns[int(taxel["taxel"]), taxel["axis"]] = name
        elif name != TIME and not _TEXT.fullmatch(name):
            raise RecordingError(
                f"{table.path}: unknown column {name!r}; {TIME!r}, 'MODULE.t01.x' (or 't01_x'), "
                "'label', 'cause', 'MODULE.label' and 'MODULE.cause' are known"
            )
    if not layout:
        raise RecordingError(f"{table.path}: no taxel columns such as 'thumb.t01.x' or 't01_x'")
    return layout


def _comments(table: Table) -> dict[tuple[str, str | None], str]:
    """What lines such as `# sensor: thumb=uskin-curved` say, by key and module."""
    found = (_COMMENT.fullmatch(line) for line in table.comments)
    return {(match["key"], match["module"]): match["value"] for match in found if match}


def _module(
    table: Table,
    name: str,
    columns: Mapping[tuple[int, str], str],
    said: Mapping[tuple[str, str | None], str],
    sensors: Mapping[str, Sensor],
) -> Tactile:
    kind = sensors.get(name) or _sensor(name, said)
    wanted = [(taxel + 1, axis) for taxel in range(kind.n_taxels) for axis in "xyz"]
    if set(columns) != set(wanted):
        n_given = len({taxel for taxel, _ in columns})
        raise RecordingError(
            f"{name}: {n_given} taxels in {len(columns)} columns given; {kind.n_taxels} taxels "
            f"x 3 axes from t01 on expected ({kind.name})"
        )
    values = table.columns([columns[key] for key in wanted])
    times = table.columns([TIME])[:, 0]
    return Tactile(kind, times, counts_or(values).reshape(-1, kind.n_taxels, 3), _unit(name, said))


def _sensor(name: str, said: Mapping[tuple[str, str | None], str]) -> Sensor:
    given = said.get(("sensor", name)) or said.get(("sensor", None))
    if given is None:
        raise RecordingError(
            f"which sensor is {name}? A line '# sensor: {name}=NAME' above the header expected; "
            f"built in are {', '.join(built_in_sensors())}"
        )
    try:
        return sensor(given)
    except ValueError as cause:
        raise RecordingError(str(cause)) from cause


def _unit(name: str, said: Mapping[tuple[str, str | None], str]) -> Unit | None:
    given = said.get(("unit", name)) or said.get(("unit", None))
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
