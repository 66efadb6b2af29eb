import hypothesis.strategies as st
import numpy as np
from hypothesis import given

from holdfast.labelling.masks import (
    closed,
    grown,
    known_between,
    lasting,
    n_samples,
    smoothed,
    steady,
    with_hysteresis,
)


def mask(text):
    return np.array([c == "#" for c in text])


def text(values):
    return "".join("#" if value else "." for value in values)


def test_rests_are_filled_between_runs_only():
    assert text(closed(mask("..#..#...#.."), 3)) == "..####...#.."


def test_short_runs_go():
    assert text(lasting(mask("#.##.###"), 2)) == "..##.###"


def test_steady_fills_before_it_drops():
    assert text(steady(mask("#.#.#....#..."), 3)) == "#####........"


def test_runs_grow_to_both_sides():
    assert text(grown(mask("#....#...."), 2)) == "###" + "#####" + ".."


def test_hysteresis_keeps_what_reaches_the_upper_level():
    values = np.array([0.6, 0.7, 0.0, 0.6, 1.1, 0.6, np.nan, 0.6])
    assert text(with_hysteresis(values, 0.5, 1.0)) == "...###.."


@given(st.lists(st.booleans(), min_size=1), st.integers(1, 5))
def test_closing_only_adds_and_dropping_only_takes(values, n):
    given_mask = np.array(values)
    assert (closed(given_mask, n) >= given_mask).all()
    assert (lasting(given_mask, n) <= given_mask).all()
    assert (closed(closed(given_mask, n), n) == closed(given_mask, n)).all()


def test_a_constant_stays_when_smoothed():
    assert np.allclose(smoothed(np.full((9, 2), 3.0), 5), 3.0)


def test_known_is_what_lies_between_times_that_are_near():
    times = np.array([0.0, 0.1, 0.5, 0.6])
    grid = np.array([-0.2, 0.0, 0.05, 0.3, 0.5, 0.55, 0.62, 0.9])
    assert text(known_between(grid, times, 0.1)) == ".##" + "." + ".##" + "."
    assert not known_between(grid, np.array([]), 0.1).any()


def test_a_duration_is_one_sample_at_least():
    assert (n_samples(0.2, 0.01), n_samples(0.001, 0.01)) == (20, 1)
