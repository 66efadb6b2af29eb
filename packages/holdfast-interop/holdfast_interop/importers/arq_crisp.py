"""Import of the ARQ-CRISP slip data sets of 2021 (3 x 6 taxels) and 2023 (4 x 6), in HDF5.

A group `{planner}/{object}/PoseN/ExpM` is a recording. The labels of the authors are: 0 nothing
held, or held with the arm at rest; 1 slip with the arm at rest; 2 release; 3 grasp; 4 held with
the arm in motion; 5 slip with the arm in motion; 6 anything else.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.io.importers import IF_IN_CONTACT
from holdfast.io.importers.array_tables import StoredArrays, listed
from holdfast.io.importers.arrays import HDF5_MAGIC, arrays_of_hdf5
from holdfast.io.importers.table import errors_named, natural_order, with_integer_type
from holdfast.io.safe_reading import one_line
from holdfast.recordings import Recording, Tactile, labels_from_samples
from holdfast.sensors import Sensor, sensor

EXTRA = "hdf5"
HINT = IF_IN_CONTACT
HDF5_SUFFIXES = (".h5", ".hdf5")
SOURCE = "ARQ-CRISP"
RAW_DATA, TIMES_NAME, LABELS_NAME = (
    "tactile_data_raw",
    "tactile_timestamps",
    "tactile_slips_label",
)
MILLISECOND = 1e-3
PATCH_PITCH = (7.24e-3, 7.17e-3)
"""Distances between the taxels of the 4 x 6 patch [m]; those of the 3 x 6 patch are unknown, and
the same are assumed."""

_NOTHING, _SLIP_AT_REST, _RELEASE, _GRASP, _HELD_IN_MOTION, _SLIP_IN_MOTION, _OTHER = range(7)
_State = tuple[ContactState, Cause | None]
_STATES: dict[int, _State] = {
    _SLIP_AT_REST: (ContactState.UNSTABLE, Cause.SLIP),
    _SLIP_IN_MOTION: (ContactState.UNSTABLE, Cause.SLIP),
    _RELEASE: (ContactState.UNSTABLE, Cause.RELEASED),
    _GRASP: (ContactState.UNSTABLE, Cause.CLOSING),
    _HELD_IN_MOTION: (ContactState.STABLE, None),
}
_HELD_AFTER = (_GRASP, _HELD_IN_MOTION, _SLIP_AT_REST, _SLIP_IN_MOTION)
_HELD_BEFORE = (_RELEASE, _HELD_IN_MOTION, _SLIP_AT_REST, _SLIP_IN_MOTION)


def can_read(path: Path) -> bool:
    """Return whether `path` is an HDF5 file, or a folder with one."""
    return any(file.suffix in HDF5_SUFFIXES or is_hdf5(file) for file in hdf5_files(path))


def parts(path: Path) -> list[Path]:
    """Return the file, or the HDF5 files of a folder.

    Raises:
        RecordingError: there is none.
    """
    files = hdf5_files(path)
    if not files:
        raise RecordingError(f"no HDF5 file in {path}; {' or '.join(HDF5_SUFFIXES)} expected")
    return files


def hdf5_files(path: Path) -> list[Path]:
    """Return the file, or the HDF5 files of a folder in natural order."""
    if path.is_file():
        return [path]
    return sorted((p for p in path.glob("*") if p.suffix in HDF5_SUFFIXES), key=natural_order)


def is_hdf5(path: Path) -> bool:
    """Return whether a file begins as HDF5 does, whatever its name."""
    with path.open("rb") as file:
        return file.read(len(HDF5_MAGIC)) == HDF5_MAGIC


def read(path: Path) -> Iterator[Recording]:
    """Yield the recordings in an HDF5 file.

    Raises:
        RecordingError: it has another form.
    """
    if not is_hdf5(path):
        raise RecordingError(f"{path} is not an HDF5 file")
    try:
        arrays = arrays_of_hdf5(path)
        places = {name: name.rpartition("/") for name in arrays}
        groups = {group for group, _, last in places.values() if group and last == RAW_DATA}
        if not groups:
            raise RecordingError(
                f"{path}: no group with {RAW_DATA} in it, but {listed(arrays)}; of another data "
                "set give --array PATH=SENSOR"
            )
        for name in sorted(groups, key=lambda name: natural_order(Path(name.replace("/", "_")))):
            inside = {last: arrays[of] for of, (group, _, last) in places.items() if group == name}
            yield recording_of_group(f"{path}: {name}", name.split("/"), inside)
    except RecordingError:
        raise
    except Exception as cause:  # h5py raises errors of any type for a damaged file
        raise RecordingError(
            f"{path} is damaged or not a data set of ARQ-CRISP: {one_line(cause)}"
        ) from cause


def recording_of_group(place: str, parts: list[str], group: StoredArrays) -> Recording:
    """Return the recording of a group; errors name its place."""
    if TIMES_NAME not in group:
        raise RecordingError(f"{place} has no {TIMES_NAME}; it has {', '.join(group)}")
    wanted = {name: group[name] for name in (RAW_DATA, TIMES_NAME, LABELS_NAME) if name in group}
    arrays = {name: np.asarray(array.read()) for name, array in wanted.items()}
    for name, values in arrays.items():
        if values.dtype.kind not in "biuf":
            raise RecordingError(f"{place}: numbers expected in {name}, {values.dtype} given")
    raw = arrays[RAW_DATA].astype(np.float64)
    times = arrays[TIMES_NAME].ravel() * MILLISECOND
    if raw.ndim != 3 or raw.shape[1:] != (3, len(times)):
        raise RecordingError(
            f"{place}: {RAW_DATA} of shape (n_taxels, 3, {len(times)}) expected, {raw.shape} given"
        )
    # Stored as taxels x axes x samples.
    readings = with_integer_type(raw.transpose(2, 0, 1))
    with errors_named(place):
        module = Tactile(patch_of(readings.shape[1]), times, readings)
        if LABELS_NAME in arrays:
            codes = arrays[LABELS_NAME].ravel()
            if len(codes) != module.n_samples:
                raise RecordingError(f"{len(codes)} labels given for {module.n_samples} samples")
            if not np.isin(codes, range(_OTHER + 1)).all():
                raise RecordingError(f"labels 0 to {_OTHER} expected, {codes.max():g} given")
            labels = labels_from_samples(
                module.times,
                states_of_codes([int(code) for code in codes]),
                period=module.period,
                evidence="annotated by hand",
                author=SOURCE,
            )
            module = replace(module, labels=labels)
        # From the end: a file of one planner has no group for it.
        facts = zip(("repeat", "pose", "object", "planner"), reversed(parts), strict=False)
        return Recording("_".join(parts), {"finger1": module}, {"source": SOURCE, **dict(facts)})


def patch_of(n_taxels: int) -> Sensor:
    """Return the patch with a number of taxels."""
    if n_taxels == 24:
        return sensor("uskin-4x6")
    if n_taxels != 18:
        raise RecordingError(
            f"{n_taxels} taxels given; 18 (3 x 6, 2021) or 24 (4 x 6, 2023) expected"
        )
    positions = [
        [(k % 6 - 2.5) * PATCH_PITCH[0], (1 - k // 6) * PATCH_PITCH[1], 0.0] for k in range(18)
    ]
    rotations = np.tile(np.eye(3), (18, 1, 1))
    normal = np.array([0.0, 0.0, 1.0])
    return Sensor("uskin-3x6", np.array(positions), rotations, normal, 180.0, range=(0.0, 65535.0))


def states_of_codes(codes: list[int]) -> list[_State | None]:
    """Return the state of each sample; that of label 0 depends on the labels around it.

    Label 0 means both "nothing held" and "held, arm at rest". It is stable between labels of a
    held object, and no contact before a grasp or after a release. Otherwise it is unknown.
    """
    previous_events = _previous_events(codes)
    next_events = _previous_events(codes[::-1])[::-1]
    states: list[_State | None] = []
    for code, before, after in zip(codes, previous_events, next_events, strict=True):
        held = before in _HELD_AFTER and after in _HELD_BEFORE
        # Without an event on either side, nothing says which of the two a 0 is.
        known = (before, after) != (None, None)
        free = known and before in (None, _RELEASE) and after in (None, _GRASP)
        if code != _NOTHING:
            states.append(_STATES.get(code))
        elif held:
            states.append((ContactState.STABLE, None))
        else:
            states.append((ContactState.NO_CONTACT, None) if free else None)
    return states


def _previous_events(codes: list[int]) -> list[int | None]:
    """Return the last label before each sample that is neither 0 nor 6."""
    events: list[int | None] = []
    last: int | None = None
    for code in codes:
        events.append(last)
        if code not in (_NOTHING, _OTHER):
            last = code
    return events
