import numpy as np
import pytest

from holdfast_lab.randomized.drawing import ranges
from holdfast_lab.randomized.palm import GRAVITY, GRID_RATE, PALM_KINDS, draw_segment, palm_motion

ARM = ranges()["arm"]


def motion(*kinds, seed=0, vibration=0.0):
    generator = np.random.default_rng(seed)
    segments, start = [], 0.5
    for kind in kinds:
        segments.append(draw_segment(generator, ARM, kind, start))
        start = segments[-1].start + segments[-1].duration + 0.5
    return segments, palm_motion(generator, segments, np.eye(3), vibration, start + 0.5)


def test_a_still_palm_feels_gravity_alone():
    _, still = motion()
    np.testing.assert_allclose(still.gravity, [[0.0, 0.0, -GRAVITY]] * len(still.gravity))
    assert not still.spin.any()


@pytest.mark.parametrize("kind", ["carry", "brake"])
@pytest.mark.parametrize("seed", range(5))
def test_a_palm_that_has_arrived_is_at_rest(kind, seed):
    """The acceleration adds up to no speed; a carry goes its distance."""
    (segment,), moved = motion(kind, seed=seed)
    acceleration = -np.add(moved.gravity, [0.0, 0.0, GRAVITY]) @ segment.direction
    speed = np.cumsum(acceleration) / GRID_RATE
    assert abs(speed[-1]) < 0.02 * np.abs(speed).max() + 1e-3
    if kind == "carry":
        assert speed.sum() / GRID_RATE == pytest.approx(segment.size, rel=0.02)
    else:
        assert speed.max() == pytest.approx(segment.size, rel=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_a_turned_palm_feels_gravity_from_elsewhere(seed):
    (segment,), turned = motion("turn", seed=seed)
    np.testing.assert_allclose(np.linalg.norm(turned.gravity, axis=1), GRAVITY, rtol=1e-6)
    assert np.linalg.norm(turned.spin.sum(axis=0)) / GRID_RATE == pytest.approx(
        segment.size, rel=0.01
    )
    before, after = turned.gravity[0], turned.gravity[-1]
    along = segment.direction
    assert before @ along == pytest.approx(after @ along, abs=0.05)
    assert np.linalg.norm(before - after) > 0.1


def test_an_arm_vibrates_by_its_rms():
    _, shaken = motion(vibration=0.2)
    rest = shaken.gravity - shaken.gravity.mean(axis=0)
    assert np.sqrt((rest**2).mean()) == pytest.approx(0.2, rel=0.35)


def test_an_arm_that_moves_vibrates_more():
    generator = np.random.default_rng(0)
    segment = draw_segment(generator, ARM, "carry", 1.0)
    resting = segment._replace(size=0.0)
    shaken = [
        palm_motion(np.random.default_rng(1), [resting], np.eye(3), 0.1, 4.0, factor)
        for factor in (1.0, 5.0)
    ]
    calm, moving = (np.add(motion.gravity, [0.0, 0.0, GRAVITY]) for motion in shaken)
    times = np.arange(len(calm)) / GRID_RATE
    end = segment.start + segment.duration
    inside = (times > segment.start + 0.1) & (times < end - 0.1)
    outside = (times < segment.start) | (times > end)
    np.testing.assert_allclose(moving[inside], 5.0 * calm[inside], atol=1e-9)
    np.testing.assert_array_equal(moving[outside], calm[outside])


def test_rows_stay_within_the_table():
    _, moved = motion(*PALM_KINDS)
    assert moved.at(-5.0) == 0
    assert moved.at(1e9) == len(moved.gravity) - 1
