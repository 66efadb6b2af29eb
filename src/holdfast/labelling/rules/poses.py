"""Poses of the object and of the fingertips: from a recording's truth, CSV files and ROS bags."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.io.importers.table import read_table
from holdfast.metrics.masks import Mask, runs
from holdfast.recordings import Recording
from holdfast.sensors.types import Array

OBJECT = "object"
"""Name of the object among the bodies of a file."""
POSE_COLUMNS = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
"""Columns of a CSV file of poses: [s], [m], unit quaternion. Column `body` is optional."""
LOST_COORDINATE = 10.0
"""Coordinates that trackers report for a marker out of sight [m]."""
MAX_REPEAT_TIME = 0.1
"""A measured pose that repeats to the last digit for longer than this is out of sight [s]."""
EXPECTED = (
    "truth with object_pose and tip_pose, or marker_pose, or a CSV file or a bag with poses "
    "expected"
)


@dataclass(frozen=True, eq=False)
class PoseTrack:
    """Poses of a body over time.

    Attributes:
        times: (n,) strictly increasing [s].
        positions: (n, 3) [m]; NaN while the body is out of sight.
        quaternions: (n, 4) w x y z; NaN while the body is out of sight.

    Raises:
        RecordingError: shapes or times are invalid.
    """

    times: Array
    positions: Array
    quaternions: Array

    def __post_init__(self) -> None:
        n = len(self.times)
        if self.positions.shape != (n, 3) or self.quaternions.shape != (n, 4):
            raise RecordingError(
                f"poses of shapes {(n, 3)} and {(n, 4)} expected for {n} times; "
                f"{self.positions.shape} and {self.quaternions.shape} given"
            )
        if not (np.isfinite(self.times).all() and (np.diff(self.times) > 0).all()):
            raise RecordingError("times of poses must be finite and strictly increasing")

    @property
    def seen(self) -> Mask:
        """(n,) where the body is in sight."""
        pose = np.concatenate([self.positions, self.quaternions], axis=1)
        return np.asarray(np.isfinite(pose).all(axis=1))


@dataclass(frozen=True, eq=False)
class Poses:
    """Tracks of an object and of the fingertips that hold it, in one frame.

    Attributes:
        source: where they come from, for a person.
        object_track: of the object.
        tip_tracks: of fingertips, by finger. Empty if the fingers do not move in the frame of the
            poses, as with a camera on the wrist.
        same_clock: whether the times are known to be on the clock of the recording.
    """

    source: str
    object_track: PoseTrack
    tip_tracks: Mapping[str, PoseTrack] = field(default_factory=dict)
    same_clock: bool = True


def poses_of(recording: Recording, tracking: str | Path | Poses | None = None) -> Poses:
    """Return the given poses, or the poses in the truth of a recording.

    Args:
        recording: its truth is used if nothing is given.
        tracking: path of a CSV file, or poses.

    Raises:
        RecordingError: there are no poses, or the file cannot be read.
    """
    if isinstance(tracking, Poses):
        return tracking
    if tracking is not None:
        return poses_from_csv(tracking)
    return poses_from_truth(recording)


def poses_from_truth(recording: Recording) -> Poses:
    """Return poses from `truth`: `object_pose` and `tip_pose`, or `marker_pose` in the hand frame.

    Raises:
        RecordingError: the truth has neither.
    """
    truth = recording.truth
    if truth is not None and "object_pose" in truth.hand:
        tips = {
            f: arrays["tip_pose"] for f, arrays in truth.fingers.items() if "tip_pose" in arrays
        }
        if tips:
            tracks = {finger: _track(truth.times, pose) for finger, pose in tips.items()}
            return Poses("truth", _track(truth.times, truth.hand["object_pose"]), tracks)
    if truth is not None and "marker_pose" in truth.hand:
        return Poses("marker_pose", in_sight(_track(truth.times, truth.hand["marker_pose"])))
    contents = "no truth"
    if truth is not None:
        names = sorted({*truth.hand, *chain(*truth.fingers.values())})
        contents = f"{', '.join(names) or 'nothing'} in its truth"
    raise RecordingError(f"no poses in {recording.name!r}: it has {contents}; {EXPECTED}")


def poses_from_csv(path: str | Path) -> Poses:
    """Read poses from a CSV file with columns time,x,y,z,qw,qx,qy,qz and optionally body.

    The body `object` is the object. Other bodies are fingertips, with the finger names of the
    recording. Without a column `body` all rows are of the object, in the frame of the hand.

    Raises:
        RecordingError: the file cannot be read, or a column or the object is missing.
    """
    table, text = read_table(Path(path), text=("body",))
    values = table.columns(POSE_COLUMNS)
    bodies = np.array(text.get("body", [OBJECT] * len(values)))
    if OBJECT not in bodies:
        raise RecordingError(
            f"{path}: no body {OBJECT!r}; it has {', '.join(sorted(set(bodies.tolist())))}"
        )
    return _measured({str(body): values[bodies == body] for body in np.unique(bodies)}, Path(path))


def poses_from_bag(
    path: str | Path, object_name: str, tip_names: Mapping[str, str] | None = None
) -> Poses:
    """Read poses from a bag, or a file of any other format whose importer has poses.

    Args:
        path: of the bag.
        object_name: name of the object in the bag: its topic or frame.
        tip_names: the same of each fingertip, by finger.

    Raises:
        RecordingError: the bag cannot be read, or has no such pose.
    """
    from holdfast.io.importers import read_poses

    names = {OBJECT: object_name, **(tip_names or {})}
    return _measured(read_poses(Path(path), names), Path(path))


def in_sight(track: PoseTrack) -> PoseTrack:
    """Return the track with NaN for invalid poses.

    A pose is invalid at LOST_COORDINATE, without a unit quaternion, or if it repeats to the last
    digit for longer than MAX_REPEAT_TIME: measured poses have noise.
    """
    pose = np.concatenate([track.positions, track.quaternions], axis=1)
    length = np.linalg.norm(track.quaternions, axis=1)
    bad = (track.positions == LOST_COORDINATE).all(axis=1) | ~(np.abs(length - 1) < 0.1)
    repeats = np.concatenate([[False], (pose[1:] == pose[:-1]).all(axis=1)])
    for start, end in runs(repeats):  # the sample before a run is the first of the equal ones
        if track.times[end - 1] - track.times[start - 1] > MAX_REPEAT_TIME:
            bad[start - 1 : end] = True
    keep = ~bad[:, None]
    return PoseTrack(
        track.times,
        np.where(keep, track.positions, np.nan),
        np.where(keep, track.quaternions / np.where(keep, length[:, None], 1.0), np.nan),
    )


def tip_tracks_of(poses: Poses, fingers: Sequence[str]) -> dict[str, PoseTrack | None]:
    """Return the fingers that the poses apply to, with their tracks; None for the frame itself.

    Raises:
        RecordingError: there are poses of fingertips, but none of these fingers.
    """
    if not poses.tip_tracks:
        return dict.fromkeys(fingers)
    tips = poses.tip_tracks
    tracks: dict[str, PoseTrack | None] = {f: tips[f] for f in fingers if f in tips}
    if not tracks:
        raise RecordingError(
            f"{poses.source} has poses of {', '.join(tips)}; "
            f"the recording's fingers are {', '.join(fingers)}"
        )
    return tracks


def _track(times: Array, pose: npt.NDArray[np.generic]) -> PoseTrack:
    values = np.asarray(pose, dtype=np.float64)
    if values.shape[1:] != (7,):
        raise RecordingError(
            f"poses of shape (n, 7) expected, position and quaternion w x y z; {values.shape} given"
        )
    return PoseTrack(times, values[:, :3], values[:, 3:])


def _measured(rows: Mapping[str, Array], path: Path) -> Poses:
    """Return poses from rows of time and pose by body, on a clock of their own."""
    tracks = {}
    for body, body_rows in rows.items():
        timed = body_rows[np.isfinite(body_rows[:, 0])]
        _, first = np.unique(timed[:, 0], return_index=True)  # of equal times the first is kept
        tracks[body] = in_sight(_track(timed[first, 0], timed[first, 1:]))
        if not tracks[body].seen.any():
            raise RecordingError(
                f"{path}: no valid pose in {len(body_rows)} rows; positions [m] and unit "
                "quaternions qw, qx, qy, qz expected"
            )
    object_track = tracks.pop(OBJECT)
    return Poses(path.name, object_track, tracks, same_clock=False)
