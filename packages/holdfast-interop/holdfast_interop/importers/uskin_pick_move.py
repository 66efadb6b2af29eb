"""Import of real uSkin recordings of picking and moving a box, with measured slip.

The data of "Proactive slip control by learned slip model and trajectory adaptation" (Nazari,
Mandil, Ghalamzan, CoRL 2022): each folder `data_sample_*` is a recording of five CSV files.
"""

import csv
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.files import read_input
from holdfast.io.importers import IN_CONTACT
from holdfast.io.importers.table import Table, errors_named, read_table, with_integer_type
from holdfast.recordings import STARTS_LOADED, Label, Recording, Tactile, Truth, labels_from_samples
from holdfast.sensors import sensor
from holdfast.sensors.types import Array

HINT = IN_CONTACT
FILES = {"finger1": "xela_sensor1.csv", "finger2": "xela_sensor2.csv"}
N_ARM_JOINTS = 7
MAX_METADATA_SIZE = 1 << 20
"""Maximum size of the file of metadata [bytes]."""
LOST_MARKER_VALUE = 10.0
"""Value of all components of the pose of a marker that the camera has lost."""

SOURCE = "imanlab/proactive-slip-control"


def can_read(path: Path) -> bool:
    """Return whether `path` is the folder of a recording, or a folder with some."""
    return bool(sample_folders(path))


def parts(path: Path) -> list[Path]:
    """Return the folder of a recording, or the folders of recordings in a folder.

    Raises:
        RecordingError: there is none.
    """
    folders = sample_folders(path)
    if not folders:
        raise RecordingError(
            f"{path} has no uskin-pick-move recording: folders data_sample_* with "
            f"{FILES['finger1']}, {FILES['finger2']}, robot_state.csv, marker.csv and "
            "slip_label.csv expected"
        )
    return folders


def sample_folders(path: Path) -> list[Path]:
    """Return the folder itself, or those in it, that hold a recording."""
    if (path / FILES["finger1"]).is_file():
        return [path]
    return sorted(file.parent for file in path.glob(f"*/{FILES['finger1']}"))


def read(folder: Path) -> Iterator[Recording]:
    """Yield the recording in a folder `data_sample_*`.

    Raises:
        RecordingError: a file is missing, or files contradict each other.
    """
    # All files have a row for each sample; only that of the robot has the times.
    robot, _ = read_table(folder / "robot_state.csv")
    times = robot.columns(["time"])[:, 0]
    with errors_named(folder):
        modules = {name: read_module(folder / file, times) for name, file in FILES.items()}
        labels = read_slip_labels(folder / "slip_label.csv", modules["finger1"])
        labelled = {name: replace(module, labels=labels) for name, module in modules.items()}
        marker, _ = read_table(folder / "marker.csv")
        names = [f"marker_position_{axis}" for axis in "xyz"]
        names += [f"marker_quaternion_{axis}" for axis in "wxyz"]
        pose = marker.columns(names).copy()
        _check_rows(marker, len(times))
        pose[(pose == LOST_MARKER_VALUE).all(axis=1)] = np.nan
        end_effector = robot.columns(
            [f"ee_T_{row}{column}" for row in range(4) for column in range(4)]
        )
        joints = range(1, N_ARM_JOINTS + 1)
        arrays = {
            "marker_pose": pose,  # in the frame of the camera on the wrist
            "robot_joints": robot.columns([f"position_joint{k}" for k in joints]),
            "robot_joint_velocities": robot.columns([f"velocity_joint{k}" for k in joints]),
            "robot_ee_pose": end_effector.reshape(-1, 4, 4),
            "robot_velocity": robot.columns(["v_x", "v_y"]),
        }
        truth = Truth(times, arrays)
        metadata = read_metadata(folder / "meta_data.csv")
        recording = Recording(folder.name, labelled, metadata, truth)
    yield recording


def read_module(path: Path, times: Array) -> Tactile:
    """Return the readings of a patch, which has a row for each of the times."""
    patch = sensor("uskin-4x4")
    table, _ = read_table(path)
    expected = [f"txl{taxel + 1}_{axis}" for taxel in range(patch.n_taxels) for axis in "xyz"]
    if len(table.names) != len(expected):
        raise RecordingError(
            f"{path}: {len(table.names)} columns given, {len(expected)} expected "
            f"({patch.n_taxels} taxels x 3 axes of {patch.name})"
        )
    readings = table.columns(expected)
    _check_rows(table, len(times))
    return Tactile(patch, times, with_integer_type(readings).reshape(-1, patch.n_taxels, 3))


def _check_rows(table: Table, n_rows: int) -> None:
    if len(table.values) != n_rows:
        raise RecordingError(
            f"{table.path}: {len(table.values)} rows given, {n_rows} expected as in robot_state.csv"
        )


def read_slip_labels(path: Path, module: Tactile) -> tuple[Label, ...]:
    """Return the labels of all fingers from the flags of slip and failure."""
    table, _ = read_table(path)
    flags = table.columns(["slip", "fail"])
    _check_rows(table, module.n_samples)
    if not np.isin(flags, (0, 1)).all():
        raise RecordingError(f"{path}: 0 or 1 expected in columns 'slip' and 'fail'")
    states: list[tuple[ContactState, Cause | None]] = []
    for slip, fail in flags.astype(bool).tolist():
        # A failed sample has no object any more, whatever its flag of slip says.
        if fail:
            states.append((ContactState.NO_CONTACT, Cause.LOST))
        else:
            states.append(
                (ContactState.UNSTABLE, Cause.SLIP) if slip else (ContactState.STABLE, None)
            )
    return labels_from_samples(
        module.times,
        states,
        period=module.period,
        evidence="slip measured by a marker on the object",
        author=SOURCE,
    )


def read_metadata(path: Path) -> dict[str, Any]:
    """Return what is known of all recordings, and of this one if it has such a file."""
    metadata: dict[str, Any] = {"object": "box", "source": SOURCE, STARTS_LOADED: True}
    if path.is_file():
        text = read_input(path, MAX_METADATA_SIZE).decode("utf-8-sig")
        row = next(csv.DictReader(text.splitlines()), {})
        for key, word in row.items():
            value: str | float | None = word
            for number in (float, int):  # the last that fits: a whole number stays one
                with suppress(ValueError):
                    value = number(word or "")
            if key:
                metadata[key] = value
    return metadata
