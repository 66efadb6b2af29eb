import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

from holdfast.labelling.rules.motion import (
    MAX_CLOCK_OFFSET,
    MAX_POSE_GAP,
    MIN_CORRELATION,
    clock_offset,
    motion_of,
    relative_track,
)
from holdfast.labelling.rules.poses import PoseTrack

GRID = np.arange(0, 3, 0.01)
INSIDE = slice(20, -20)


def track(positions, turns, times=GRID):
    return PoseTrack(times, positions, np.roll(turns.as_quat(), 1, axis=1))


def turning(rate, axis, times=GRID):
    return Rotation.from_rotvec(np.outer(times * rate, axis))


def nowhere(times=GRID):
    return np.zeros((len(times), 3))


@given(rate=st.floats(0.1, 3), seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_a_steady_spin_and_the_speed_at_the_contact(rate, seed):
    axis = Rotation.random(rng=seed).apply([0, 0, 1])
    point = np.tile([0.02, 0.01, -0.03], (len(GRID), 1))
    motion = motion_of(track(nowhere(), turning(rate, axis)), GRID, point)
    assert motion.spin[INSIDE] == pytest.approx(rate, rel=0.02)
    lever = np.linalg.norm(np.cross(axis, point[0]))
    assert motion.speed[INSIDE] == pytest.approx(rate * lever, rel=0.02, abs=1e-6)


def test_rolling_has_no_speed_at_the_contact():
    radius = 0.03
    thing = track(np.outer(GRID, [0.02, 0, 0]), turning(0.02 / radius, [0, 1, 0]))
    point = np.outer(GRID, [0.02, 0, 0]) - [0, 0, radius]
    motion = motion_of(thing, GRID, point)
    assert motion.speed[INSIDE] == pytest.approx(0, abs=1e-4)
    assert motion.spin[INSIDE] == pytest.approx(0.02 / radius, rel=0.01)


@given(seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_relative_motion_does_not_depend_on_the_world_frame(seed):
    rng = np.random.default_rng(seed)
    positions, carried = rng.normal(size=(2, 300, 3)).cumsum(axis=1) * 1e-3
    turns, tip_turns = (Rotation.from_rotvec(v * 3) for v in (carried, positions))
    world, shift = Rotation.random(rng=seed), rng.normal(size=3)
    here = relative_track(track(positions, turns), track(carried, tip_turns))
    there = relative_track(
        track(world.apply(positions) + shift, world * turns),
        track(world.apply(carried) + shift, world * tip_turns),
    )
    assert here.positions == pytest.approx(there.positions, abs=1e-12)
    same = np.abs((here.quaternions * there.quaternions).sum(axis=1))
    assert same == pytest.approx(1)


def test_a_tip_at_other_times_is_taken_between_its_poses():
    late = GRID[:-1] + 0.004
    thing = track(np.outer(GRID, [0.1, 0, 0]), turning(1, [0, 0, 1]))
    tip = track(np.outer(late, [0.1, 0, 0]), turning(1, [0, 0, 1], late), late)
    found = relative_track(thing, tip)
    assert found.positions[5:-5] == pytest.approx(0, abs=1e-9)


def test_quaternions_of_either_sign_are_one_rotation():
    tip = track(nowhere(), turning(1, [0, 0, 1]))
    tip.quaternions[100:200] *= -1
    thing = track(np.tile([0.1, 0, 0], (len(GRID), 1)), turning(1, [0, 0, 1]))
    speeds = motion_of(relative_track(thing, tip), GRID + 0.001).speed[INSIDE]
    assert np.nanmax(speeds) == pytest.approx(0.1, rel=0.02)


def test_motion_is_unknown_where_poses_are_missing():
    positions = nowhere()
    positions[100:105] = positions[200:250] = np.nan
    motion = motion_of(track_with_nan(positions), GRID)
    assert motion.known[95:110].all()
    assert not motion.known[201:249].any()
    assert np.isnan(motion.speed[201:249]).all()
    assert pytest.approx(0.1) == MAX_POSE_GAP


def track_with_nan(positions):
    quaternions = np.tile([1.0, 0, 0, 0], (len(positions), 1))
    return PoseTrack(GRID, positions, quaternions)


@given(jitter=st.floats(1e-5, 1e-2))
@settings(max_examples=10)
def test_the_noise_of_the_speed_is_what_a_body_at_rest_shows(jitter):
    times = np.arange(0, 30, 0.01)
    positions = np.random.default_rng(0).normal(0, jitter, (len(times), 3))
    still = track(positions, turning(0, [0, 0, 1], times), times)
    motion = motion_of(still, times)
    shown = np.sqrt((motion.speed[INSIDE] ** 2).mean())
    assert motion.speed_noise == pytest.approx(shown, rel=0.1)


def test_distance_and_angle_from_a_pose():
    thing = track(np.outer(GRID, [0.01, 0, 0]), turning(0.2, [0, 0, 1]))
    far, turned = motion_of(thing, GRID).away_from(np.zeros(3), np.eye(3), None)
    assert far == pytest.approx(0.01 * GRID, abs=1e-9)
    assert turned == pytest.approx(0.2 * GRID, abs=1e-9)
    at, _ = motion_of(track(nowhere(), turning(0.2, [0, 0, 1])), GRID).away_from(
        np.zeros(3), np.eye(3), np.array([0.05, 0, 0])
    )
    assert at == pytest.approx(2 * 0.05 * np.sin(0.1 * GRID), abs=1e-9)


PERIOD = 0.01
EVERY = np.ones(1000, dtype=bool)


def bursts(seed=0):
    """Motion in bursts, over a little noise."""
    rng = np.random.default_rng(seed)
    motion = rng.uniform(0, 0.01, 1000)
    for start in (100, 310, 470, 700, 820):
        motion[start : start + 40] += rng.uniform(0.5, 2)
    return motion


@given(shift=st.integers(-50, 50))
@settings(max_examples=20)
def test_the_shift_is_found(shift):
    felt = bursts()
    found = clock_offset(np.roll(felt, -shift), felt, EVERY, PERIOD)
    assert found.seconds == pytest.approx(shift * PERIOD, abs=PERIOD)
    assert found.reliable


def test_samples_out_of_sight_are_ignored():
    felt = bursts()
    seen = np.roll(felt, -20)
    known = EVERY.copy()
    known[400:600] = False
    seen[400:600] = 1e6
    assert clock_offset(seen, felt, known, PERIOD).seconds == pytest.approx(0.2, abs=PERIOD)


def test_uncorrelated_signals_give_no_offset():
    rng = np.random.default_rng(0)
    found = clock_offset(rng.uniform(size=1000), rng.uniform(size=1000), EVERY, PERIOD)
    assert found.seconds == 0
    assert found.correlation < MIN_CORRELATION
    assert not found.reliable


def test_no_motion_gives_no_offset():
    assert clock_offset(np.zeros(1000), bursts(), EVERY, PERIOD).seconds == 0


def test_offsets_are_limited():
    felt = bursts()
    assert abs(clock_offset(np.roll(felt, 80), felt, EVERY, PERIOD).seconds) <= MAX_CLOCK_OFFSET
