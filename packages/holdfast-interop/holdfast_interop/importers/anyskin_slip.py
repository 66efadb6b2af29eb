"""Import of the AnySkin slip data set of Pollen Robotics: a CSV file for each object.

A file has the columns `mag1_x` to `mag5_z` [uT] and `slip`, and a `log_time`: a date and time, or
a number of seconds (or ms, us, ns) since 1970. The data mark slip. They do not mark where nothing
touches the skin, so every sample without slip is labelled stable.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.io.importers import IF_IN_CONTACT
from holdfast.io.importers.table import CsvFormat, Table, errors_named, header_line, read_table
from holdfast.recordings import Label, Recording, Tactile, labels_from_samples
from holdfast.sensors import sensor

HINT = f"{IF_IN_CONTACT}; check the labels of contact with holdfast label"
SOURCE = "pollen-robotics/anyskin_slip_detection"
MAGNETOMETER_COLUMNS = tuple(f"mag{node}_{axis}" for node in range(1, 6) for axis in "xyz")
SLIP_COLUMN = "slip"
TIME_NAMES = ("log_time", "timestamp", "time")
"""Names of the column of times; the first that a file has is used."""
MIXED = "no_slip"
"""File in which the objects change."""
EVIDENCE = "slip annotated by hand; contact is not annotated"

NANOSECONDS_PER_SECOND = 1_000_000_000
MAX_NANOSECONDS = 2**63

_FLAGS = {"0": False, "1": True, "0.0": False, "1.0": True, "false": False, "true": True}
_UNITS = ((1e17, 1), (1e14, 1_000), (1e11, 1_000_000))
"""Smallest number that a time since 1970 has in ns, us and ms, and that unit [ns]."""


_FORMAT = CsvFormat(
    lambda names: set(MAGNETOMETER_COLUMNS) <= set(names),
    "no anyskin-slip file in {}; CSV files with columns mag1_x.. and slip expected",
)
can_read, parts = _FORMAT.can_read, _FORMAT.parts


def read(path: Path) -> Iterator[Recording]:
    """Yield the recording in a CSV file.

    Raises:
        RecordingError: it has another form.
    """
    names = header_line(path)
    table, cells = read_table(path, [name for name in names if name not in MAGNETOMETER_COLUMNS])
    readings = table.columns(MAGNETOMETER_COLUMNS).reshape(-1, 5, 3)
    skin = sensor("anyskin")
    metadata: dict[str, Any] = {"source": SOURCE}
    if path.stem != MIXED:
        metadata["object"] = path.stem
    time_name = next((name for name in TIME_NAMES if name in names), None)
    if time_name is None:
        times = np.arange(len(readings)) / skin.rate
        metadata["clock"] = f"none; {skin.rate:g} Hz assumed"
    else:
        stamps = [nanoseconds_of(cell.strip()) for cell in cells[time_name]]
        if None in stamps:
            row = stamps.index(None)
            raise RecordingError(
                f"{path}, row {table.first_line + row}, column {time_name!r}: "
                f"{cells[time_name][row][:40]!r} given; a date and time, or a number of seconds "
                "expected"
            )
        whole = np.array(stamps, dtype=np.int64)
        # Of differences of whole numbers a float keeps every digit.
        times = np.asarray((whole - whole[0]) * 1e-9)
        metadata["clock"] = time_name
    with errors_named(path):
        module = Tactile(skin, times, readings)
        labels = {"finger1": flag_labels(table, cells.get(SLIP_COLUMN), module)}
        recording = Recording(path.stem, {"finger1": module}, metadata).with_labels(labels)
    yield recording


def nanoseconds_of(cell: str) -> int | None:
    """Return a time [ns], a whole number so that no digit is lost; None if it is no time."""
    try:
        number = float(cell)
    except ValueError:
        try:
            date = np.datetime64(cell.removesuffix("Z").removesuffix("+00:00"), "ns")
        except ValueError:
            return None
        return None if np.isnat(date) else int(date.astype(np.int64))
    if not abs(number) < MAX_NANOSECONDS:
        return None
    # Numbers since 1970 of different units are a factor of 1000 apart.
    unit = next((unit for smallest, unit in _UNITS if number >= smallest), NANOSECONDS_PER_SECOND)
    # A float has 53 bits: nanoseconds since 1970 need 61.
    found = int(cell) if cell.isdigit() else number
    return round(found * unit) if abs(found * unit) < MAX_NANOSECONDS else None


def flag_labels(table: Table, cells: Sequence[str] | None, module: Tactile) -> tuple[Label, ...]:
    """Return the labels from the cells of slip; none without that column."""
    if cells is None:
        return ()
    states: list[tuple[ContactState, Cause | None] | None] = []
    for row, text in enumerate(cells, table.first_line):
        cell = text.strip().lower()
        if cell and cell not in _FLAGS:
            raise RecordingError(
                f"{table.path}, row {row}, column {SLIP_COLUMN!r}: {cell[:40]!r} given, 0 or 1 "
                "expected"
            )
        # The data do not say where nothing touches: what is no slip counts as held.
        held = (
            (ContactState.UNSTABLE, Cause.SLIP) if _FLAGS.get(cell) else (ContactState.STABLE, None)
        )
        states.append(held if cell else None)
    return labels_from_samples(
        module.times, states, period=module.period, evidence=EVIDENCE, author=SOURCE
    )
