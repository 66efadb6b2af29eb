"""A webcam before the twin: what it films is where the truth says."""

import numpy as np
import pytest

from holdfast.io.foreign import end_children, read_stickers
from holdfast.recordings import Recording, Truth
from holdfast.synthetic import synthetic_recording
from holdfast.twin.slip_events import GRASP_LINE, SIDEWAYS
from holdfast.twin.webcam import TIP_SIZE, VISIBLE, Webcam, clock_shift, film_stickers

cv2 = pytest.importorskip("cv2")

CAMERA = Webcam(fps=30.0, width=640, height=360, focal_length=500.0)
N = 120


def grasp():
    """A can that is moved by 6 mm to the side, while the fingers stay."""
    times = np.arange(N) / 150
    pose = np.tile([0.11, -0.01, 0.02, 1.0, 0, 0, 0], (N, 1))
    pose[:, :3] += 0.006 * (times / times[-1])[:, None] * SIDEWAYS
    turn = [0.58, 0.47, 0.35, 0.57]
    positions = pose[0, :3] + 0.05 * GRASP_LINE + np.outer((0.03, 0.0, -0.03), (0, 0, 1))
    tips = {
        finger: {"tip_pose": np.tile([*position, *turn], (N, 1))}
        for finger, position in zip(VISIBLE, positions, strict=True)
    }
    phase = np.full(N, "locked")
    made = synthetic_recording("can-1", seed=0)
    truth = Truth(times, {"object_pose": pose, "phase": phase}, tips)
    return Recording("can-1", made.modules, {"object": "can"}, truth)


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    path = tmp_path_factory.mktemp("film") / "can-1.mp4"
    film_stickers(grasp(), path, CAMERA)
    yield read_stickers(path)
    end_children()


def test_all_stickers_are_read(film):
    times, _, poses = film
    assert sorted(poses) == [0, 2, 3, 4]  # the thumb is behind the object
    assert times == pytest.approx(np.arange(len(times)) / 30)
    assert all(np.isfinite(pose).all() for pose in poses.values())
    side = np.linalg.svd(poses[3][:, :, :2], compute_uv=False)[:, 0].mean()
    expected = 1e3 * TIP_SIZE * CAMERA.focal_length / (1e3 * (CAMERA.distance - 0.065))
    assert side == pytest.approx(expected, rel=0.2)


def test_motion_is_that_of_the_truth_on_a_clock_of_its_own(film):
    times, _, poses = film
    shift = clock_shift(grasp())
    share = np.clip((times + shift + 0.010) / ((N - 1) / 150), 0, 1)
    moved = poses[0][:, 0, 2] - poses[0][:1, 0, 2]
    pixels = 0.006 * (share - share[0]) * CAMERA.focal_length / (CAMERA.distance - 0.033)
    assert np.abs(np.abs(moved) - pixels * np.cos(CAMERA.turn[0])).max() < 0.5
    assert np.ptp(poses[3][:, :, 2], axis=0).max() < 0.1
