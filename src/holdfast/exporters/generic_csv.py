"""Export of recordings as the generic CSV of docs/importing.md, which `holdfast import` reads."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from holdfast.csv_cells import csv_text
from holdfast.errors import OutputError, RecordingError
from holdfast.exporters.output import whole_files
from holdfast.files import file_stem, whole_file
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor, built_in_sensors, sensor, taxel_numbers
from holdfast.sensors.types import Array

CSV_SUFFIX, SENSOR_SUFFIX = ".csv", ".sensor.json"
ROWS_AT_ONCE = 4096
"""Number of rows that are text in memory at a time."""

_PLAIN_NAME = re.compile(r"""[^\s=+\-@'",;#][^=",;#\r\n\t]*(?<!\s)""")
"""Names of modules that a column and a comment of the CSV hold without loss."""


class CsvExport(NamedTuple):
    """Files that an export wrote.

    Attributes:
        files: names of the tables.
        sensors: option `--sensor` that their import needs, for each sensor that is not built in.
        left_out: what the recordings have and the tables have not.
    """

    files: list[str]
    sensors: list[str]
    left_out: list[str]

    def note_left_out(self, recording: Recording) -> None:
        """Add what a recording has and its tables have not."""
        empty = [name for name, module in recording.modules.items() if not module.n_samples]
        parts = {
            "metadata": recording.metadata,
            "truth": recording.truth,
            "markers": recording.markers,
            "media": recording.media,
            "modules without samples": empty,
        }
        for name, part in parts.items():
            if part and name not in self.left_out:
                self.left_out.append(name)


def export(
    recordings: Sequence[Recording],
    out: Path,
    *,
    force: bool = False,
    progress: Callable[[Iterable[Recording]], Iterable[Recording]] = iter,
) -> CsvExport:
    """Write a table for each recording, and for each clock of its modules.

    The modules of a table have the same times; modules with other times get a table of their
    own. Sensors that are not built in are files beside the tables.

    Args:
        recordings: such as a `Dataset`; they are loaded one at a time.
        out: a folder; or a `.csv` file, for a recording whose modules have the same times.
        force: replace existing files.
        progress: wraps the recordings.

    Raises:
        RecordingError: the name of a module does not fit into a header, or its sensor differs
            from that of another recording with the same name.
        OutputError: a file exists already, cannot be written, or is not enough.
    """
    result = CsvExport([], [], [])
    sensors: dict[str, Sensor] = {}
    if out.suffix == CSV_SUFFIX and not out.is_dir():
        # One table: of a single recording, without a file of a sensor beside it.
        tables = _tables(recordings[0]) if len(recordings) == 1 else {}
        modules = next(iter(tables.values()), {})
        if len(tables) != 1 or any(not _is_built_in(m.sensor) for m in modules.values()):
            raise OutputError(
                f"{out} is one table; a folder expected for several recordings, for modules with "
                "different times, and for sensors that are not built in"
            )
        with whole_file(out, force=force) as part:
            _write_table(part, modules)
        result.files.append(out.name)
        result.note_left_out(recordings[0])
        return result
    with whole_files(out, force=force) as folder:
        for recording in progress(recordings):
            for name, modules in _tables(recording).items():
                for finger, module in modules.items():
                    # The option `--sensor NAME=FILE` of the import is for all tables.
                    before = sensors.setdefault(finger, module.sensor)
                    if before != module.sensor:
                        raise RecordingError(
                            f"{finger} has the sensors {before.name} and {module.sensor.name} in "
                            "different recordings; export them apart"
                        )
                    file = f"{file_stem(finger)}{SENSOR_SUFFIX}"
                    if not _is_built_in(module.sensor) and not (folder / file).exists():
                        text = msgspec.json.encode(module.sensor.to_dict())
                        (folder / file).write_bytes(msgspec.json.format(text))
                        result.sensors.append(f"{finger}={out / file}")
                _write_table(folder / f"{name}{CSV_SUFFIX}", modules)
                result.files.append(f"{name}{CSV_SUFFIX}")
            result.note_left_out(recording)
    return result


def _tables(recording: Recording) -> dict[str, dict[str, Tactile]]:
    """Return the modules of each table, by the stem of its file."""
    groups: list[dict[str, Tactile]] = []
    # Modules of one clock share rows. Most hands have one, and the file then its recording's name.
    for name, module in recording.modules.items():
        if not _PLAIN_NAME.fullmatch(name):
            raise RecordingError(
                f"{recording.name}: module {name!r} cannot be the name of columns of a CSV file; "
                "rename it, or choose another format"
            )
        if not module.n_samples:
            continue
        for group in groups:
            if np.array_equal(next(iter(group.values())).times, module.times):
                group[name] = module
                break
        else:
            groups.append({name: module})
    if len(groups) == 1:
        return {file_stem(recording.name): groups[0]}
    return {file_stem(f"{recording.name}_{next(iter(group))}"): group for group in groups}


def _is_built_in(item: Sensor) -> bool:
    """Return whether the importer finds this sensor by its name, apart from the unit."""
    if item.name not in built_in_sensors():
        return False
    # A built-in name with other positions is another sensor: it needs a file of its own.
    built_in = sensor(item.name)
    calibrated = replace(built_in, unit=item.unit, range=None)  # as `Tactile` makes it
    return item in (built_in, calibrated)


def _write_table(path: Path, modules: Mapping[str, Tactile]) -> None:
    """Write modules with the same times: their comments, the header, and a row for each sample."""
    times: Array = next(iter(modules.values())).times
    labels = []  # of each labelled module, the cells `label,cause` of each sample
    for module in modules.values():
        cells = [","] * module.n_samples
        for label in module.labels:
            first, last = np.searchsorted(times, (label.start, label.end)).tolist()
            text = f"{label.state.value.lower()},{label.cause or ''}"
            cells[first:last] = [text] * (last - first)
        labels += [cells] if module.labels else []
    with path.open("w", encoding="utf-8", newline="") as file:
        for name, module in modules.items():
            file.write(f"# sensor: {name}={module.sensor.name}\n# unit: {name}={module.unit}\n")
        columns = ["time"]
        for name, module in modules.items():
            # Names of one length: sorted as text, columns keep the order of the taxels.
            width = max(2, len(str(module.sensor.n_taxels)))
            for number in taxel_numbers(range(module.sensor.n_taxels)):
                columns += [f"{name}.t{number:0{width}d}.{axis}" for axis in "xyz"]
        for name, module in modules.items():
            columns += [f"{name}.label", f"{name}.cause"] if module.labels else []
        file.write(csv_text([columns]))
        for start in range(0, len(times), ROWS_AT_ONCE):
            cut = slice(start, start + ROWS_AT_ONCE)
            parts: list[Iterable[str]] = [map(repr, times[cut].tolist())]
            for module in modules.values():
                readings = module.readings[cut].reshape(len(times[cut]), -1).tolist()
                # `repr` is the shortest text that is read back as the same number.
                parts.append(",".join(map(repr, row)) for row in readings)
            parts += [cells[cut] for cells in labels]
            file.write("".join(",".join(row) + "\n" for row in zip(*parts, strict=True)))
