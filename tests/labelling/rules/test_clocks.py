import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from holdfast.labelling.rules.clocks import ALIKE, FARTHEST, offset_of

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
    found = offset_of(np.roll(felt, -shift), felt, EVERY, PERIOD)
    assert found.seconds == pytest.approx(shift * PERIOD, abs=PERIOD)
    assert found.believed


def test_one_huge_knock_does_not_outvote_the_rest():
    felt = bursts()
    seen = np.roll(felt, -20)
    felt[950] = 1e6
    assert offset_of(seen, felt, EVERY, PERIOD).seconds == pytest.approx(0.2, abs=PERIOD)


def test_what_is_out_of_sight_does_not_count():
    felt = bursts()
    seen = np.roll(felt, -20)
    known = EVERY.copy()
    known[400:600] = False
    seen[400:600] = 1e6
    assert offset_of(seen, felt, known, PERIOD).seconds == pytest.approx(0.2, abs=PERIOD)


def test_what_is_not_alike_gives_no_offset():
    rng = np.random.default_rng(0)
    found = offset_of(rng.uniform(size=1000), rng.uniform(size=1000), EVERY, PERIOD)
    assert found.seconds == 0
    assert found.alike < ALIKE
    assert not found.believed


def test_nothing_that_moves_gives_no_offset():
    assert offset_of(np.zeros(1000), bursts(), EVERY, PERIOD).seconds == 0


def test_no_more_than_the_farthest_is_tried():
    felt = bursts()
    assert abs(offset_of(np.roll(felt, 80), felt, EVERY, PERIOD).seconds) <= FARTHEST
