import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.labelling.rules.poses import (
    PoseTrack,
    in_sight,
    poses_from_csv,
    poses_from_truth,
    poses_of,
    tip_tracks_of,
)
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import sensor

HEADER = "time,x,y,z,qw,qx,qy,qz"
ROW = "{t},{x},0,0.5,1,0,0,0"


def written(tmp_path, lines, header=HEADER):
    path = tmp_path / "poses.csv"
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


def recording(truth=None):
    patch = sensor("uskin-4x4")
    return Recording(
        "r", {"thumb": Tactile(patch, np.arange(5.0), np.zeros((5, 16, 3)))}, truth=truth
    )


def test_a_file_of_one_body_is_the_object_in_the_hands_frame(tmp_path):
    poses = poses_from_csv(written(tmp_path, [ROW.format(t=k / 10, x=k) for k in range(5)]))
    assert poses.object_track.positions[:, 0].tolist() == [0, 1, 2, 3, 4]
    assert poses.object_track.quaternions[0].tolist() == [1, 0, 0, 0]
    assert (poses.tip_tracks, poses.same_clock, poses.source) == ({}, False, "poses.csv")
    assert tip_tracks_of(poses, ["thumb", "index"]) == {"thumb": None, "index": None}


def test_a_file_of_many_bodies(tmp_path):
    lines = [
        f"{ROW.format(t=k / 10, x=k)},{body}" for k in range(3) for body in ("object", "thumb")
    ]
    poses = poses_from_csv(written(tmp_path, lines, HEADER + ",body"))
    assert poses.object_track.positions.shape == (3, 3)
    assert list(tip_tracks_of(poses, ["index", "thumb"])) == ["thumb"]


def test_a_quaternion_is_brought_to_unit_length(tmp_path):
    lines = ["0,0,0,0,1.02,0,0,0", "1,0,0,0,0,0,0,0", "2,1,0,0,nan,0,0,0", "3,2,0,0,1,0,0,0"]
    track = poses_from_csv(written(tmp_path, lines)).object_track
    assert track.seen.tolist() == [True, False, False, True]
    assert track.quaternions[0].tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize(
    ("header", "row", "text"),
    [
        (f"{HEADER},body", "0,0,0,0.5,1,0,0,0,thumb", "'object'; it has thumb"),
        ("time,x,y,z", "0,0,0,0", "'qw'"),
        (HEADER, "0,10,10,10,1,0,0,0", "no valid pose"),
    ],
)
def test_files_without_a_pose_of_the_object(tmp_path, header, row, text):
    with pytest.raises(RecordingError, match=text):
        poses_from_csv(written(tmp_path, [row], header))


def test_fingers_of_another_hand(tmp_path):
    lines = [f"{ROW.format(t=k, x=k)},{body}" for k in range(3) for body in ("object", "thumb")]
    poses = poses_from_csv(written(tmp_path, lines, HEADER + ",body"))
    with pytest.raises(RecordingError, match=r"thumb; .* a, b"):
        tip_tracks_of(poses, ["a", "b"])


def test_truth_with_poses_of_both():
    pose = np.tile([0, 0, 0, 1.0, 0, 0, 0], (5, 1))
    truth = Truth(np.arange(5.0), {"object_pose": pose}, {"thumb": {"tip_pose": pose}})
    poses = poses_of(recording(truth))
    assert (list(poses.tip_tracks), poses.same_clock, poses.source) == (["thumb"], True, "truth")


@pytest.mark.parametrize(
    ("hand", "text"),
    [
        ({"phase": np.full(5, "free")}, "'r': .*phase"),
        ({"marker_pose": np.zeros((5, 6))}, r"\(n, 7\)"),
    ],
)
def test_truth_with_something_else(hand, text):
    with pytest.raises(RecordingError, match=text):
        poses_from_truth(recording(Truth(np.arange(5.0), hand)))


@pytest.mark.parametrize(
    ("times", "shape", "text"),
    [([0.0, 0.0], (2, 3), "times"), ([0.0, 1.0], (2, 2), "shapes")],
)
def test_arrays_of_a_track_must_fit(times, shape, text):
    with pytest.raises(RecordingError, match=text):
        PoseTrack(np.array(times), np.zeros(shape), np.zeros((2, 4)))


def test_frozen_and_sentinel_poses_are_out_of_sight_a_slow_tracker_is_not():
    times = np.arange(60) / 100
    position = np.repeat(np.arange(12), 5)[:, None] * [1.0, 0, 0]  # at 20 Hz, repeated at 100 Hz
    position[20:40] = position[20]
    position[50:] = 10.0
    turns = np.tile([1.0, 0, 0, 0], (60, 1))
    seen = in_sight(PoseTrack(times, position, turns)).seen
    assert seen.tolist() == [True] * 20 + [False] * 20 + [True] * 10 + [False] * 10
