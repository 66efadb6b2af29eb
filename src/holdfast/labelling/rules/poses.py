"""Poses of the object and of the fingertips: from a recording's truth, CSV files and ROS bags."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.io.importers.table import read_table
from holdfast.metrics.masks import Mask, runs
from holdfast.recordings import Recording, Truth
from holdfast.sensors.types import Array

OBJECT = "object"
"""Name of the object among the bodies of a file."""
COLUMNS = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
"""Of a CSV file of poses: [s], [m], and a unit quaternion; a column `body` may name whose."""
SENTINEL = 10.0
"""A marker at (10, 10, 10) m is out of sight: trackers put it there."""
FROZEN = 0.1
"""A measured pose that repeats to the last digit for longer than this is out of sight [s]."""
EXPECTED = (
    "truth with object_pose and tip_pose, or marker_pose, or a CSV file or a bag with poses "
    "expected"
)


@dataclass(frozen=True, eq=False)
class Track:
    """Where a body is over time.

    Attributes:
        times: (n,) strictly increasing [s].
        positions: (n, 3) [m]; NaN where it is out of sight.
        quaternions: (n, 4) w x y z; NaN where it is out of sight.

    Raises:
        RecordingError: shapes or times contradict each other.
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
            raise RecordingError("times of poses are finite and strictly increasing")

    @property
    def seen(self) -> Mask:
        """(n,) where the body is in sight."""
        pose = np.concatenate([self.positions, self.quaternions], axis=1)
        return np.asarray(np.isfinite(pose).all(axis=1))


@dataclass(frozen=True, eq=False)
class Poses:
    """Tracks of an object and of what holds it, in one frame.

    Attributes:
        source: where they come from, for a person.
        thing: the object.
        tips: fingertips by name; a finger that is not named moves with the frame itself, as
            where a camera on the wrist sees the object.
        same_clock: whether their times are on the clock of the recording for certain.
    """

    source: str
    thing: Track
    tips: Mapping[str, Track] = field(default_factory=dict)
    same_clock: bool = True


def poses_of(recording: Recording, tracking: str | Path | Poses | None = None) -> Poses:
    """The poses for a recording: those given, or what its truth holds.

    Args:
        recording: whose truth is taken where nothing is given.
        tracking: path of a CSV file, or poses.

    Raises:
        RecordingError: there are none, or the file cannot be read.
    """
    if isinstance(tracking, Poses):
        return tracking
    if tracking is not None:
        return poses_from_csv(tracking)
    return poses_from_truth(recording)


def poses_from_truth(recording: Recording) -> Poses:
    """Poses out of `truth`: `object_pose` and `tip_pose`, or `marker_pose` in the hand's frame.

    Raises:
        RecordingError: it has neither.
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
    raise RecordingError(f"no poses in {recording.name!r}: it has {_has(truth)}; {EXPECTED}")


def poses_from_csv(path: str | Path) -> Poses:
    """Poses out of a CSV file with the columns time,x,y,z,qw,qx,qy,qz and maybe body.

    The body `object` is the object, the others are fingertips, called as the recording calls
    its fingers. Without a column `body`, all rows are the object's, in the frame of the hand.

    Raises:
        RecordingError: it cannot be read, a column is missing, or no row is the object's.
    """
    table, text = read_table(Path(path), text=("body",))
    values = table.columns(COLUMNS)
    bodies = np.array(text.get("body", [OBJECT] * len(values)))
    if OBJECT not in bodies:
        raise RecordingError(
            f"{path}: no body {OBJECT!r}; it has {', '.join(sorted(set(bodies.tolist())))}"
        )
    tracks = {str(body): _of_rows(values[bodies == body], path) for body in np.unique(bodies)}
    thing = tracks.pop(OBJECT)
    return Poses(Path(path).name, thing, tracks, same_clock=False)


def poses_from_bag(path: str | Path, thing: str, tips: Mapping[str, str] | None = None) -> Poses:
    """Poses out of a bag of ROS 1 or 2: topics of PoseStamped, or frames of TFMessage.

    A name with a slash at its beginning is a topic of `geometry_msgs/PoseStamped`; any other is
    a child frame in `tf2_msgs/TFMessage`. All must have one parent frame.

    Args:
        path: of the bag.
        thing: topic or frame of the object.
        tips: topic or frame of each fingertip.

    Raises:
        RecordingError: it cannot be read, a topic or frame is not there, or parents differ.
        MissingExtra: rosbags is not installed.
    """
    from holdfast.io.bags import read_poses

    wanted = {OBJECT: thing, **(tips or {})}
    poses = read_poses(Path(path), wanted)
    tracks = {body: _of_rows(rows, path) for body, rows in poses.items()}
    thing_track = tracks.pop(OBJECT)
    return Poses(Path(path).name, thing_track, tracks, same_clock=False)


def in_sight(track: Track) -> Track:
    """The track without poses that are none: at the sentinel, frozen, or not of unit length.

    Measured poses tremble: what repeats to the last digit for longer than FROZEN is what a
    tracker says of a body that it has lost.
    """
    pose = np.concatenate([track.positions, track.quaternions], axis=1)
    length = np.linalg.norm(track.quaternions, axis=1)
    bad = (track.positions == SENTINEL).all(axis=1) | ~(np.abs(length - 1) < 0.1)
    repeats = np.concatenate([[False], (pose[1:] == pose[:-1]).all(axis=1)])
    for start, end in runs(repeats):
        if track.times[end - 1] - track.times[start - 1] > FROZEN:
            bad[start - 1 : end] = True
    keep = ~bad[:, None]
    return Track(
        track.times,
        np.where(keep, track.positions, np.nan),
        np.where(keep, track.quaternions / np.where(keep, length[:, None], 1.0), np.nan),
    )


def _track(times: Array, pose: npt.NDArray[np.generic]) -> Track:
    values = np.asarray(pose, dtype=np.float64)
    if values.shape[1:] != (7,):
        raise RecordingError(
            f"poses of shape (n, 7) expected, position and quaternion w x y z; {values.shape} given"
        )
    return Track(times, values[:, :3], values[:, 3:])


def _of_rows(rows: Array, path: str | Path) -> Track:
    """A measured track from rows of time and pose; of equal times the first is kept."""
    timed = rows[np.isfinite(rows[:, 0])]
    _, first = np.unique(timed[:, 0], return_index=True)
    track = in_sight(_track(timed[first, 0], timed[first, 1:]))
    if not track.seen.any():
        raise RecordingError(
            f"{path}: no pose of {len(rows)} rows is one; positions [m] and unit quaternions "
            "qw, qx, qy, qz expected"
        )
    return track


def _has(truth: Truth | None) -> str:
    if truth is None:
        return "no truth"
    names: Iterator[str] = chain(truth.hand, *truth.fingers.values())
    return f"{', '.join(sorted(set(names))) or 'nothing'} in its truth"


def names_of(poses: Poses, fingers: Sequence[str]) -> dict[str, Track | None]:
    """The fingers that the poses speak of, with the track of each; None for the frame itself.

    Raises:
        RecordingError: they have fingertips, but none that the recording has.
    """
    if not poses.tips:
        return dict.fromkeys(fingers)
    known: dict[str, Track | None] = {f: poses.tips[f] for f in fingers if f in poses.tips}
    if not known:
        raise RecordingError(
            f"{poses.source} has poses of {', '.join(poses.tips)}; "
            f"the recording's fingers are {', '.join(fingers)}"
        )
    return known
