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

from holdfast.compiled import compiled
from holdfast.errors import RecordingError
from holdfast.io import load_recording
from holdfast.io.header import Header, header_sensors
from holdfast.io.recording_files import SUFFIXES, format_module
from holdfast.io.safe_reading import recording_errors
from holdfast.io.timed_arrays import TACTILE, TimedArray, TimedArrays, recording_from
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

MAX_READINGS = 50_000_000
"""Largest number of readings that are kept; 100 MB of counts, 15 minutes of four fingertips."""
CACHED_SAMPLES = 512
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
        if not _is_long(header):
            return load_recording(path, labels=False), True
        forces = _forces(header, groups)
        recording = recording_from(_header_of_forces(header), forces, path)
        return _with_digest(recording, header.digest), False


def without_forces(recording: Recording) -> Recording:
    """Return a long recording without the forces, once they are computed: all are NaN."""
    modules = {
        name: replace(module, readings=np.broadcast_to(np.nan, module.readings.shape))
        for name, module in recording.modules.items()
    }
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


def _is_long(header: Header) -> bool:
    modules = header.modules.values()
    n = sum((module.n_samples or 0) * 3 * len(module.sensor["positions"]) for module in modules)
    return n > MAX_READINGS


def _header_of_forces(header: Header) -> Header:
    """Return the header of the recording with one taxel in each module, without truth."""
    modules = {
        name: msgspec.structs.replace(
            header.modules[name], sensor=_force_sensor(sensor).to_dict(), number="float64"
        )
        for name, sensor in header_sensors(header).items()
    }
    return msgspec.structs.replace(header, modules=modules, truth=None)


def _force_sensor(sensor: Sensor) -> Sensor:
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
            filled[topic][1][part, 0] = _force(columns, sensors[topic].rotations)
    if ends != n_samples:
        raise RecordingError(f"{header.name}: {ends} samples, its header names {n_samples}")
    return filled


def _force(columns: npt.NDArray[Any], rotations: Array) -> Array:
    """Return (n, 3) forces; NaN where a reading is not finite."""
    force = np.zeros((3, columns.shape[1]))
    _add_taxels(columns, rotations, force)
    if not np.isfinite(force).all():
        force[:, ~np.isfinite(force).all(axis=0)] = np.nan
    return force.T


@compiled
def _add_taxels(columns: npt.NDArray[Any], rotations: Array, force: Array) -> None:
    """Add sum_i R_i f_i to (3, n) forces; a row of `columns` is an axis of a taxel."""
    n = force.shape[1]
    for start in range(0, n, CACHED_SAMPLES):
        stop = min(n, start + CACHED_SAMPLES)
        for i in range(len(rotations)):
            for axis in range(3):
                column = columns[3 * i + axis]
                x, y, z = rotations[i, 0, axis], rotations[i, 1, axis], rotations[i, 2, axis]
                for k in range(start, stop):
                    reading = np.float64(column[k])
                    force[0, k] += x * reading
                    force[1, k] += y * reading
                    force[2, k] += z * reading
