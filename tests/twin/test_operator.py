import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from holdfast.twin.operator import TREMOR_BAND, draw_disturbances, draw_tremor
from holdfast.twin.profile import profile, profiles
from holdfast.twin.steps import (
    HOLD_STIFFNESS,
    JERK,
    MOVE,
    PUSH,
    PUSH_GAP,
    PUSH_LIMIT,
    SHAKE,
    aim,
    disturb_wrench,
    hold_wrench,
    tremor_at,
)

STILL = draw_tremor(np.random.default_rng(0))
STYLES = (PUSH, JERK, SHAKE)
WEIGHT = 2.0


def body(position=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0), velocity=(0.0,) * 6):
    rotation = Rotation.from_rotvec(turn).as_matrix().ravel()
    return np.array([*position, *rotation, *velocity], dtype=float)


def parameters(direction=(0.0, 0.0, -1.0), arm=(0.0, 0.0, 0.0), depth=0.006, stiffness=700.0):
    return np.array([*direction, *arm, depth, stiffness, 4.0])


def push(given, drawn=None, style=PUSH, rms=0.0, elapsed=0.4, duration=0.8):
    drawn = parameters() if drawn is None else drawn
    out = disturb_wrench(given, np.zeros(12), drawn, style, duration, STILL, rms, elapsed)
    return np.array(out)


def course(style, depth=0.006, duration=1.0, n=4001):
    times = np.linspace(0, duration, n)
    return times, np.array([aim(style, depth, 4.0, time, duration) for time in times])


class TestTremor:
    def test_has_an_rms_of_one(self):
        times = np.arange(0, 60, 1 / 150)
        for axis in range(3):
            positions = [tremor_at(STILL, time, axis)[0] for time in times]
            assert np.std(positions) == pytest.approx(1.0, rel=0.02)
            assert np.mean(positions) == pytest.approx(0.0, abs=0.02)

    def test_keeps_to_its_band(self):
        times = np.arange(0, 60, 1 / 150)
        positions = np.array([tremor_at(STILL, time, 0)[0] for time in times])
        power = np.abs(np.fft.rfft(positions * np.hanning(len(positions)))) ** 2
        rates = np.fft.rfftfreq(len(positions), 1 / 150)
        band = (rates > TREMOR_BAND[0] - 0.1) & (rates < TREMOR_BAND[1] + 0.1)
        assert power[band].sum() / power.sum() > 0.999


class TestHold:
    def test_carries_the_weight(self):
        here = body((0.1, 0.2, 0.3), (0.1, 0.0, 0.4))
        wrench = hold_wrench(here, here[:12], 1.0, WEIGHT, STILL, 0.0, 0.5)
        np.testing.assert_allclose(wrench, [0, 0, WEIGHT, 0, 0, 0], atol=1e-12)

    def test_is_a_damped_spring(self):
        anchor = body()[:12]
        wrench = hold_wrench(body((0.001, 0, 0)), anchor, 1.0, 0.0, STILL, 0.0, 0.0)
        assert wrench[0] == pytest.approx(-HOLD_STIFFNESS * 0.001)
        moving = body(velocity=(0.1, 0, 0, 0, 0, 0))
        assert hold_wrench(moving, anchor, 1.0, 0.0, STILL, 0.0, 0.0)[0] < 0


class TestPush:
    @pytest.mark.slow
    @settings(max_examples=200)
    @given(
        position=st.tuples(*[st.floats(-0.05, 0.05)] * 3),
        velocity=st.tuples(*[st.floats(-2, 2)] * 6),
        style=st.sampled_from(STYLES),
        elapsed=st.floats(0, 0.8),
        rms=st.floats(0, 1e-3),
        seed=st.integers(0, 2**16),
    )
    def test_never_pulls_and_never_passes_its_limit(
        self, position, velocity, style, elapsed, rms, seed
    ):
        random = np.random.default_rng(seed)
        direction = random.normal(size=3)
        direction /= np.linalg.norm(direction)
        arm = np.cross(direction, random.normal(0, 0.006, 3))
        drawn = parameters(direction, arm)
        out = push(body(position, velocity=velocity), drawn, style, rms, elapsed)
        along = out[:3] @ direction
        assert 0.0 <= along <= PUSH_LIMIT + 1e-9
        np.testing.assert_allclose(out[:3], along * direction, atol=1e-9)
        np.testing.assert_allclose(out[3:], np.cross(arm, out[:3]), atol=1e-9)

    @pytest.mark.parametrize("style", STYLES)
    def test_begins_and_ends_off_the_object(self, style):
        for elapsed in (0.0, 0.8):
            assert not push(body(), style=style, elapsed=elapsed).any()

    @pytest.mark.parametrize("style", STYLES)
    def test_goes_there_and_back(self, style):
        times, motion = course(style)
        positions, speeds = motion.T
        assert positions[0] == pytest.approx(0.0, abs=1e-12)
        assert positions[-1] == pytest.approx(0.0, abs=1e-12)
        assert positions.min() >= -1e-12
        assert 0.8 * (0.006 + PUSH_GAP) < positions.max() <= 0.006 + PUSH_GAP + 1e-12
        slope = np.gradient(positions, times)
        np.testing.assert_allclose(speeds[1:-1], slope[1:-1], atol=1e-4)

    def test_a_shake_leaves_the_object_and_comes_back(self):
        forces = [
            push(body(), style=SHAKE, elapsed=t, duration=1.0)[2] for t in np.arange(0, 1, 0.002)
        ]
        touching = np.array(forces) < 0
        assert (np.diff(touching.astype(int)) == 1).sum() >= 3


def move(given, elapsed=1.0, rms=0.0, depth=0.008, stiffness=500.0, duration=2.0):
    wanted = parameters(depth=depth, stiffness=stiffness)
    out = disturb_wrench(given, body()[:12], wanted, MOVE, duration, STILL, rms, elapsed)
    return np.array(out)


class TestMove:
    def test_pulls_to_both_sides_along_its_direction_only(self):
        forces = np.array([move(body(), t) for t in np.linspace(0, 2, 401)])
        np.testing.assert_allclose(forces[:, [0, 1, 3, 4, 5]], 0.0, atol=1e-12)
        assert forces[:, 2].min() < -3.0
        assert forces[:, 2].max() > 3.0
        first = np.flatnonzero(np.abs(forces[:, 2]) > 1.0)[0]
        assert forces[first, 2] < 0  # down first

    def test_is_a_spring_of_its_stiffness_that_damps(self):
        there, here = move(body((0.001, 0, 0))), move(body())
        assert there[0] - here[0] == pytest.approx(-500.0 * 0.001)
        assert move(body(velocity=(0.1, 0, 0, 0, 0, 0)))[0] < 0


class TestPlan:
    @pytest.mark.parametrize("name", profiles())
    @pytest.mark.parametrize("seed", range(4))
    def test_pushes_fill_the_hold(self, name, seed):
        chosen = profile(name)
        disturbances = draw_disturbances(np.random.default_rng(seed), chosen)
        starts = np.array([p.start for p in disturbances])
        ends = starts + [p.duration for p in disturbances]
        assert len(disturbances) >= 3
        assert starts[0] >= 1.0  # the operator's hand is off by then
        rests = starts[1:] - ends[:-1]
        assert (rests >= chosen.rest[0]).all()
        assert (rests <= chosen.rest[1]).all()
        assert ends[-1] <= chosen.hold - 1.0
        longest = max(chosen.push_duration[1], chosen.move_duration[1])
        assert chosen.hold - ends[-1] < 1.0 + chosen.rest[1] + longest
        assert [p.direction for p in disturbances[:4]] == ["down", "up", "left", "right"][
            : len(disturbances)
        ]
