from dataclasses import replace

import numpy as np
import pytest

from holdfast_lab.study.evaluation.glitch_counts import count_glitches, sliding_speed
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
