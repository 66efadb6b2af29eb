import numpy as np
import pytest

from holdfast_lab.randomized.drawing import measured_ranges, random_rotation, ranges
from holdfast_lab.randomized.palm import (
    BOUT_FADE,
    CARRIERS,
    GRAVITY,
    GRID_RATE,
    carrying_legs,
    draw_carrier,
    draw_segment,
    palm_motion,
    person_acceleration,
)

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


RANGES = measured_ranges()
LEVEL = np.eye(3)


def test_a_third_of_the_hands_each_is_carried_by_an_arm_a_person_or_nothing():
    drawn = [draw_carrier(np.random.default_rng(seed), RANGES) for seed in range(3000)]
    for name in (*CARRIERS, None):
        assert drawn.count(name) / len(drawn) == pytest.approx(1 / 3, abs=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_an_arm_goes_to_and_fro_on_a_level_line_as_fast_as_the_boxes(seed):
    generator = np.random.default_rng(seed)
    orientation = random_rotation(generator)
    legs = carrying_legs(generator, RANGES["carry"], orientation, 20.0)
    moved = palm_motion(generator, legs, orientation, 0.0, 20.0)
    acceleration = (-moved.gravity - orientation.T @ [0.0, 0.0, GRAVITY]) @ orientation.T
    np.testing.assert_allclose(acceleration[:, 2], 0.0, atol=1e-9)
    speeds = np.linalg.norm(np.cumsum(acceleration, axis=0), axis=1) / GRID_RATE
    positions = np.cumsum(np.cumsum(acceleration, axis=0), axis=0) / GRID_RATE**2
    assert 0.25 < speeds.max() < 0.62
    assert 0.15 < np.linalg.norm(acceleration, axis=1).max() < 1.2
    assert np.linalg.norm(positions, axis=1).max() < 0.75
    assert 0.5 < np.mean(speeds > 0.02) < 0.9
    starts = np.array([leg.start for leg in legs])
    ends = starts + [leg.duration for leg in legs]
    assert (starts[1:] > ends[:-1]).all()


def band_power(acceleration, low, high):
    power = (np.abs(np.fft.rfft(acceleration, axis=0)) ** 2).sum(axis=1)
    rates = np.fft.rfftfreq(len(acceleration), 1 / GRID_RATE)
    return power[(rates >= low) & (rates <= high)].sum() / power.sum()


def test_a_standing_person_trembles_from_8_to_12_hz_as_strongly_as_is_drawn():
    ranges = {**RANGES["person"], "tremor": [0.1, 0.1], "rise": [1e-9, 1e-9]}
    moved = person_acceleration(np.random.default_rng(0), ranges, LEVEL, 30.0)
    assert band_power(moved, 7.9, 12.1) > 0.99
    settled = moved[int(BOUT_FADE * GRID_RATE) :]
    assert settled.std() == pytest.approx(0.1, rel=0.15)


@pytest.mark.parametrize("seed", range(4))
def test_a_person_walks_in_bouts_up_and_down_with_each_step(seed):
    ranges = {**RANGES["person"], "tremor": [1e-9, 1e-9], "rise": [0.02, 0.02]}
    generator = np.random.default_rng(seed)
    orientation = random_rotation(generator)
    moved = person_acceleration(generator, ranges, orientation, 40.0) @ orientation.T
    rise = moved[:, 2]
    assert band_power(moved[:, 2:], 1.3, 2.2) > 0.9
    low, high = (0.02 * (2 * np.pi * rate) ** 2 for rate in ranges["step_rate"])
    assert 0.95 * low < np.abs(rise).max() < 1.05 * high
    still = np.abs(rise) < 0.01 * low
    assert 0.1 < still.mean() < 0.9
    assert np.abs(moved[:, :2]).max() < 0.75 * np.abs(rise).max()
