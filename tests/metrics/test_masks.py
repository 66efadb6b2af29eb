import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from holdfast.metrics.masks import (
    covered,
    drop_short_runs,
    fill_short_gaps,
    hysteresis,
    join_runs,
    n_samples_of,
    runs,
    runs_with,
    widen_runs,
)

masks = st.lists(st.booleans(), max_size=40).map(lambda values: np.array(values, dtype=bool))


def mask(text):
    return np.array([c == "#" for c in text])


def text(values):
    return "".join("#" if value else "." for value in values)


def test_runs_have_a_first_sample_and_a_first_after():
    assert runs(mask("##..#.###")).tolist() == [[0, 2], [4, 5], [6, 9]]
    assert runs(mask("...")).shape == runs(mask("")).shape == (0, 2)


@given(masks)
def test_runs_cover_exactly_the_true_samples(given_mask):
    drawn = np.zeros_like(given_mask)
    for start, end in runs(given_mask):
        assert start < end
        drawn[start:end] = True
    assert (drawn == given_mask).all()


@pytest.mark.parametrize(
    ("gap", "expected"),
    [(0.2, "#.#..#.."), (0.21, "###..#.."), (0.31, "######..")],
)
def test_runs_are_joined_that_are_less_than_a_gap_apart(gap, expected):
    times = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])
    assert text(join_runs(mask("#.#..#.."), times, gap)) == expected


def test_gaps_are_measured_by_position_and_not_by_sample_number():
    assert text(join_runs(mask("#.#.#"), np.array([0.0, 1.0, 2.0, 2.1, 2.2]), 1.0)) == "#.###"
    assert text(widen_runs(mask("..#.."), np.array([0.0, 1.0, 2.0, 2.1, 2.2]), 0.5)) == "..###"


def test_runs_are_wider_at_both_ends():
    assert text(widen_runs(mask("#....#..."), np.arange(9), 2)) == "########."
    assert text(widen_runs(mask("#....#..."), np.arange(9), 1)) == "##..###.."
    assert text(widen_runs(mask("#....#...."), np.arange(10), 2)) == "###" + "#####" + ".."


@given(masks, st.integers(0, 5))
def test_joining_and_widening_lose_no_sample(given_mask, n):
    indices = np.arange(len(given_mask))
    near = [given_mask[max(k - n, 0) : k + n + 1].any() for k in indices]
    assert (widen_runs(given_mask, indices, n) == near).all()
    assert (join_runs(given_mask, indices, n) >= given_mask).all()


def test_short_gaps_are_filled_between_runs_only():
    assert text(fill_short_gaps(mask("..#..#...#.."), 3)) == "..####...#.."


def test_short_runs_are_dropped():
    assert text(drop_short_runs(mask("#.##.###"), 2)) == "..##.###"


@given(st.lists(st.booleans(), min_size=1), st.integers(1, 5))
def test_filling_only_adds_and_dropping_only_removes(values, n):
    given_mask = np.array(values)
    filled = fill_short_gaps(given_mask, n)
    assert (filled >= given_mask).all()
    assert (drop_short_runs(given_mask, n) <= given_mask).all()
    assert (fill_short_gaps(filled, n) == filled).all()


def test_runs_are_kept_that_contain_a_selected_sample():
    assert text(runs_with(mask("##.##.##"), mask("...#...."))) == "...##..."
    assert text(runs_with(mask("##.##"), mask("..#.."))) == "....."


def test_hysteresis_keeps_runs_that_exceed_the_upper_level():
    values = np.array([0.6, 0.7, 0.0, 0.6, 1.1, 0.6, np.nan, 0.6])
    assert text(hysteresis(values, 0.5, 1.0)) == "...###.."


def test_covered_is_between_times_that_are_near_each_other():
    times = np.array([0.0, 0.1, 0.5, 0.6])
    grid = np.array([-0.2, 0.0, 0.05, 0.3, 0.5, 0.55, 0.62, 0.9])
    assert text(covered(grid, times, 0.1)) == ".##" + "." + ".##" + "."
    assert not covered(grid, np.array([]), 0.1).any()


def test_a_duration_has_at_least_one_sample():
    assert (n_samples_of(0.2, 0.01), n_samples_of(0.001, 0.01)) == (20, 1)
