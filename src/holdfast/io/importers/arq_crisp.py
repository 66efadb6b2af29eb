"""The ARQ-CRISP slip data sets of 2021 (3 x 6 taxels) and 2023 (4 x 6), in HDF5.

A group `{planner}/{object}/PoseN/ExpM` is a recording. The authors' labels are: 0 nothing
held, or held with the arm still; 1 slip with the arm still; 2 release; 3 grasp; 4 held with
the arm in motion; 5 slip with the arm in motion; 6 anything else.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.errors import MissingExtra, RecordingError
from holdfast.io.importers.table import counts_or, natural
from holdfast.recordings import Label, Recording, Tactile, labels_from_samples
from holdfast.sensors import Sensor, sensor
from holdfast.sensors.types import Array

SUFFIXES = (".h5", ".hdf5")
MAGIC = b"\x89HDF\r\n\x1a\n"
SOURCE = "ARQ-CRISP"
DATA, TIMES, LABELS = "tactile_data_raw", "tactile_timestamps", "tactile_slips_label"
MILLISECOND = 1e-3
PITCH = (7.24e-3, 7.17e-3)
"""Of the 4 x 6 patch [m]; taken for the 3 x 6 one too, of which no drawing is at hand."""

_NOTHING, _SLIP_STILL, _RELEASE, _GRASP, _HELD_MOVING, _SLIP_MOVING, _OTHER = range(7)
_State = tuple[ContactState, Cause | None]
_STATES: dict[int, _State] = {
    _SLIP_STILL: (ContactState.UNSTABLE, Cause.SLIP),
    _SLIP_MOVING: (ContactState.UNSTABLE, Cause.SLIP),
    _RELEASE: (ContactState.UNSTABLE, Cause.RELEASED),
    _GRASP: (ContactState.UNSTABLE, Cause.CLOSING),
    _HELD_MOVING: (ContactState.STABLE, None),
}
_HELD_AFTER = (_GRASP, _HELD_MOVING, _SLIP_STILL, _SLIP_MOVING)
_HELD_BEFORE = (_RELEASE, _HELD_MOVING, _SLIP_STILL, _SLIP_MOVING)


def sniff(path: Path) -> bool:
    """Whether it is an HDF5 file, or a folder that holds one."""
    return any(_is_hdf5(file) for file in _files(path))


def read(path: Path) -> Iterator[Recording]:
    """The recordings in an HDF5 file, or in the HDF5 files of a folder.

    Raises:
        RecordingError: there is no such file, or one is not as expected.
        MissingExtra: h5py is not installed.
    """
    h5py = _h5py()
    files = _files(path)
    if not files:
        raise RecordingError(f"no HDF5 file in {path}; {' or '.join(SUFFIXES)} expected")
    return (recording for file in files for recording in _recordings(file, h5py))


def _h5py() -> ModuleType:
    try:
        import h5py
    except ImportError as cause:
        raise MissingExtra("h5py", "hdf5") from cause
    module: ModuleType = h5py
    return module


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    return sorted((p for p in path.glob("*") if p.suffix in SUFFIXES), key=natural)


def _is_hdf5(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def _recordings(path: Path, h5py: ModuleType) -> Iterator[Recording]:
    if not _is_hdf5(path):
        raise RecordingError(
            f"{path} is no HDF5 file (a Git LFS pointer? fetch the data with `git lfs pull`)"
        )
    try:
        with h5py.File(path, "r") as file:
            names: list[str] = []
            file.visititems(lambda name, item: names.append(name) if DATA in _keys(item) else None)
            if not names:
                raise RecordingError(f"{path}: no group with {DATA} in it")
            for name in sorted(names, key=lambda name: natural(Path(name.replace("/", "_")))):
                yield _recording(f"{path}: {name}", name.split("/"), file[name])
    except (OSError, KeyError, ValueError) as cause:
        raise RecordingError(f"{path} is damaged or no data set of ARQ-CRISP: {cause}") from cause


def _keys(item: object) -> Sequence[str]:
    return tuple(item) if isinstance(item, Mapping) else ()


def _recording(place: str, parts: list[str], group: Mapping[str, Any]) -> Recording:
    if TIMES not in group:
        raise RecordingError(f"{place} has no {TIMES}; it has {', '.join(group)}")
    raw = np.asarray(group[DATA], dtype=np.float64)
    times = np.asarray(group[TIMES], dtype=np.float64).ravel() * MILLISECOND
    if raw.ndim != 3 or raw.shape[1:] != (3, len(times)):
        raise RecordingError(
            f"{place}: {DATA} of shape (n_taxels, 3, {len(times)}) expected, {raw.shape} given"
        )
    readings = counts_or(raw.transpose(2, 0, 1))
    try:
        bare = Tactile(_sensor(readings.shape[1]), times, readings)
        labels = _labels(np.asarray(group[LABELS]).ravel(), bare) if LABELS in group else ()
        module = Tactile(bare.sensor, times, readings, labels=labels)
        return Recording("_".join(parts), {"finger1": module}, _metadata(parts))
    except RecordingError as cause:
        raise RecordingError(f"{place}: {cause}") from cause


def _metadata(parts: list[str]) -> dict[str, str]:
    names = ("planner", "object", "pose", "repeat")
    return {"source": SOURCE, **dict(zip(reversed(names), reversed(parts), strict=False))}


def _sensor(n_taxels: int) -> Sensor:
    if n_taxels == 24:
        return sensor("uskin-4x6")
    if n_taxels != 18:
        raise RecordingError(
            f"{n_taxels} taxels given; 18 (3 x 6, 2021) or 24 (4 x 6, 2023) expected"
        )
    positions = [[(k % 6 - 2.5) * PITCH[0], (1 - k // 6) * PITCH[1], 0.0] for k in range(18)]
    turns = np.tile(np.eye(3), (18, 1, 1))
    up = np.array([0.0, 0.0, 1.0])
    return Sensor("uskin-3x6", np.array(positions), turns, up, 180.0, limits=(0.0, 65535.0))


def _labels(codes: Array, module: Tactile) -> tuple[Label, ...]:
    if len(codes) != module.n_samples:
        raise RecordingError(f"{len(codes)} labels given for {module.n_samples} samples")
    if not np.isin(codes, range(_OTHER + 1)).all():
        raise RecordingError(f"labels 0 to {_OTHER} expected, {codes.max()} given")
    return labels_from_samples(
        module.times,
        _states([int(code) for code in codes]),
        period=module.period,
        evidence="annotated by hand",
        author=SOURCE,
    )


def _states(codes: list[int]) -> list[_State | None]:
    """A state a sample; label 0 by what comes before and after it.

    Label 0 says both "nothing held" and "held, arm still". Between signs of an object held it
    is stable; before a grasp, and after a release, it is no contact; else nobody knows.
    """
    after = list(reversed(_last_events(list(reversed(codes)))))
    return [
        _rest(before, behind) if code == _NOTHING else _STATES.get(code)
        for code, before, behind in zip(codes, _last_events(codes), after, strict=True)
    ]


def _last_events(codes: list[int]) -> list[int | None]:
    """The newest code before each sample that is neither 0 nor 6."""
    events: list[int | None] = []
    last: int | None = None
    for code in codes:
        events.append(last)
        if code not in (_NOTHING, _OTHER):
            last = code
    return events


def _rest(before: int | None, after: int | None) -> _State | None:
    if before in _HELD_AFTER and after in _HELD_BEFORE:
        return ContactState.STABLE, None
    if before in (None, _RELEASE) and after in (None, _GRASP) and (before, after) != (None, None):
        return ContactState.NO_CONTACT, None
    return None
