from dataclasses import replace

import numpy as np
import pytest

from holdfast_lab.study.evaluation.slips import count_glitches, find_slips, sliding_speed
from study.example_recordings import GLITCH, truth_of

TIMES = np.arange(1725) / 150
TRUTH = truth_of(TIMES, ("thumb", "index"))


def sliding(*spans, speed=0.01):
    """Return the truth with sliding on the index alone, at other times [s] and speeds [m/s]."""
    given = np.zeros(len(TIMES))
    for start, end in spans:
        given[(start - 1e-9 <= TIMES) & (end - 1e-9 > TIMES)] = speed
    fingers = {name: dict(arrays) for name, arrays in TRUTH.fingers.items()}
    fingers["thumb"]["slip_speed"] = np.zeros(len(TIMES))
    fingers["index"]["slip_speed"] = given
    return replace(TRUTH, fingers=fingers)


def test_a_slip_begins_after_half_a_second_of_rest():
    (slip,) = find_slips(TRUTH)
    assert slip.onset == pytest.approx(5.6)
    assert slip.end == pytest.approx(5.9)
    assert not slip.of_glitch
    assert find_slips(None) == []


def test_the_distance_is_the_speed_times_the_time():
    (slip,) = find_slips(TRUTH)
    at = {5.0: 0.0, 5.6: 0.0, 5.7: 1e-3, 5.9: 3e-3, 7.0: 3e-3}
    for time, distance in at.items():
        assert slip.distance_until(time) == pytest.approx(distance)


def test_rests_under_a_tenth_of_a_second_are_closed():
    (slip,) = find_slips(sliding((5.6, 5.7), (5.78, 5.9)))
    assert (slip.onset, slip.end) == (pytest.approx(5.6), pytest.approx(5.9, abs=0.01))
    assert slip.distances[-1] == pytest.approx(2.2e-3, rel=0.05)
    (first,) = find_slips(sliding((5.6, 5.7), (5.8, 5.9)))
    assert first.end == pytest.approx(5.7)


@pytest.mark.parametrize(
    ("end", "speed", "found"),
    [(5.62, 0.002, 1), (5.613, 0.002, 0), (5.613, 0.01, 1), (5.606, 0.01, 0)],
)
def test_a_slip_lasts_20_ms_or_slides_a_tenth_of_a_millimetre(end, speed, found):
    """One, two and three samples of 6.7 ms."""
    assert len(find_slips(sliding((5.6, end), speed=speed))) == found


def test_sliding_that_is_no_slip_is_no_end_of_a_rest():
    truth = sliding((5.2, 5.206), (5.6, 5.9))
    assert len(find_slips(truth)) == 1
    truth = sliding((5.2, 5.3), (5.6, 5.9))
    assert [slip.onset for slip in find_slips(truth)] == [pytest.approx(5.2)]


def test_a_slip_in_a_glitch_or_right_after_it_is_caused_by_it():
    cases = {GLITCH: True, GLITCH + 0.09: True, GLITCH + 0.12: False, GLITCH - 0.05: False}
    for onset, of_glitch in cases.items():
        (slip,) = find_slips(sliding((onset, onset + 0.2)))
        assert slip.of_glitch == of_glitch


def test_nothing_slides_that_is_not_held_or_not_touched():
    assert not sliding_speed(sliding((0.5, 1.0), (9.6, 9.9))).any()
    fingers = {name: dict(arrays) for name, arrays in TRUTH.fingers.items()}
    fingers["thumb"]["contact_force"] = np.zeros((len(TIMES), 3))
    assert not sliding_speed(replace(TRUTH, fingers=fingers)).any()
    assert sliding_speed(TRUTH).max() == 0.01


def test_glitches_are_counted_with_the_distance_that_the_object_slides():
    calm = count_glitches(sliding())
    assert (calm.n, calm.distances) == (1, [0.0])
    assert calm.held_seconds == pytest.approx(7.2, abs=0.01)
    moved = count_glitches(sliding((5.6, 5.9), (GLITCH + 0.05, GLITCH + 0.25)))
    assert moved.distances == [pytest.approx(2e-3, rel=0.01)]
    assert count_glitches(sliding((GLITCH + 0.2, GLITCH + 0.3))).distances == [0.0]
    assert count_glitches(None).n == 0
