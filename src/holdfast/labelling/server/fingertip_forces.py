"""Recordings that are too long for memory: their fingertip forces in place of the readings.

The page plots forces, and labels need times only. So of a long recording the sum of the readings
in the fingertip frame is kept, as the reading of a sensor with one taxel: 24 bytes of a sample
instead of 180. The tare is linear, so everything that follows gives the same force.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.io import load_recording
from holdfast.io.file_formats import SUFFIXES, format_module
from holdfast.io.header import Header, header_sensors
from holdfast.io.safe_reading import recording_errors
from holdfast.io.timed_arrays import TACTILE, TimedArray, TimedArrays, recording_from
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

MAX_READINGS = 50_000_000
"""Largest number of readings that are kept; 100 MB of counts, 15 minutes of four fingertips."""
CACHED_SAMPLES = 2048
"""Samples whose forces are summed at a time, so that they stay in the cache."""


def load_for_labelling(path: Path) -> tuple[Recording, bool]:
    """Load a recording without the labels of its label file, and whether it has all readings.

    Of a long Parquet recording, each module has one taxel, with the force. Its digest is that of
    the file.

    Raises:
        RecordingError: the file cannot be read, is damaged or not a recording.
    """
    if path.suffix != ".parquet" or not path.is_file():
        return load_recording(path, labels=False), True
    with recording_errors(path):
        header, groups = format_module(path.suffix).read_columns(path)
        counts = [
            (module.n_samples or 0) * 3 * len(module.sensor["positions"])
            for module in header.modules.values()
        ]
        if sum(counts) <= MAX_READINGS:
            return load_recording(path, labels=False), True
        # The header of a recording with one taxel in each module, without a truth.
        modules = {
            name: msgspec.structs.replace(
                header.modules[name], sensor=force_sensor(sensor).to_dict(), number="float64"
            )
            for name, sensor in header_sensors(header).items()
        }
        reduced = msgspec.structs.replace(header, modules=modules, truth=None)
        recording = recording_from(reduced, _forces(header, groups), path)
        return _with_digest(recording, header.digest), False


def without_force(recording: Recording, finger: str) -> Recording:
    """Return a long recording without the forces of a finger, which become NaN."""
    module = recording.modules[finger]
    unknown = replace(module, readings=np.broadcast_to(np.nan, module.readings.shape))
    modules = {**recording.modules, finger: unknown}
    return _with_digest(replace(recording, modules=modules), recording.digest)


def _with_digest(recording: Recording, digest: str) -> Recording:
    recording.__dict__["digest"] = digest  # where the cached property keeps it
    return recording


def read_header(path: Path) -> tuple[Header | None, bool]:
    """Return the header of a recording, and whether it was written at a regular end.

    Raises:
        RecordingError: the file cannot be read, is damaged or not a recording.
    """
    if path.suffix not in SUFFIXES:
        return None, False
    header, groups, complete = format_module(path.suffix).read_groups(path)
    getattr(groups, "close", lambda: None)()
    return header, complete


def force_sensor(sensor: Sensor) -> Sensor:
    """Return a sensor with one taxel in the fingertip frame, whose reading is the force."""
    return Sensor(
        f"force of {sensor.name}",
        np.zeros((1, 3)),
        np.eye(3)[None],
        sensor.normal,
        sensor.rate,
        sensor.unit,
    )


def _forces(header: Header, groups: Iterable[TimedArrays]) -> dict[str, TimedArray]:
    """Return times and forces (n, 1, 3) of every module, by topic."""
    sensors = {f"{TACTILE}{name}": sensor for name, sensor in header_sensors(header).items()}
    n_samples = {f"{TACTILE}{name}": m.n_samples or 0 for name, m in header.modules.items()}
    filled = {topic: (np.empty(n), np.empty((n, 1, 3))) for topic, n in n_samples.items()}
    ends = dict.fromkeys(filled, 0)
    for group in groups:
        for topic in group.keys() & sensors.keys():
            times, columns = group[topic]
            part = slice(ends[topic], ends[topic] + len(times))
            ends[topic] = part.stop
            if part.stop > n_samples[topic]:
                break
            filled[topic][0][part] = times
            _sum_taxels(columns, sensors[topic].rotations, filled[topic][1][part, 0])
    if ends != n_samples:
        raise RecordingError(f"{header.name}: {ends} samples, its header names {n_samples}")
    # Modules of one driver have the same times: they share one array.
    first, _ = next(iter(filled.values()))
    return {
        topic: (first if np.array_equal(times, first) else times, values)
        for topic, (times, values) in filled.items()
    }


def _sum_taxels(columns: npt.NDArray[Any], rotations: Array, force: Array) -> None:
    """Fill (n, 3) F_tip = sum_i R_i f_i; NaN where a reading is not finite.

    Args:
        columns: (3 n_taxels, n) an axis of a taxel in each row.
        rotations: (n_taxels, 3, 3) R_i.
        force: (n, 3) is filled.
    """
    rows = rotations.transpose(1, 0, 2).reshape(3, -1)  # (3, 3 n_taxels) of all R_i
    for start in range(0, len(force), CACHED_SAMPLES):
        part = slice(start, start + CACHED_SAMPLES)
        with np.errstate(invalid="ignore"):  # infinite readings
            sums = rows @ columns[:, part].astype(np.float64)
        known = np.isfinite(sums).all(axis=0)
        if not known.all():
            sums[:, ~known] = np.nan
        force[part] = sums.T
