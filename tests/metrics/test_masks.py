import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from holdfast.metrics.masks import joined, runs, runs_with, widened

masks = st.lists(st.booleans(), max_size=40).map(lambda values: np.array(values, dtype=bool))


def mask(text):
    return np.array([c == "#" for c in text])


def text(values):
    return "".join("#" if value else "." for value in values)


def test_runs_have_a_first_sample_and_a_first_after():
    assert runs(mask("##..#.###")).tolist() == [[0, 2], [4, 5], [6, 9]]
    assert runs(mask("...")).shape == runs(mask("")).shape == (0, 2)


@given(masks)
def test_runs_are_all_that_is_true(given_mask):
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
    assert text(joined(mask("#.#..#.."), times, gap)) == expected


def test_the_places_of_samples_count_not_their_number():
    assert text(joined(mask("#.#.#"), np.array([0.0, 1.0, 2.0, 2.1, 2.2]), 1.0)) == "#.###"
    assert text(widened(mask("..#.."), np.array([0.0, 1.0, 2.0, 2.1, 2.2]), 0.5)) == "..###"


def test_runs_are_wider_at_both_ends():
    assert text(widened(mask("#....#..."), np.arange(9), 2)) == "########."
    assert text(widened(mask("#....#..."), np.arange(9), 1)) == "##..###.."


@given(masks, st.integers(0, 5))
def test_nothing_is_lost_by_joining_and_widening(given_mask, n):
    places = np.arange(len(given_mask))
    near = [given_mask[max(k - n, 0) : k + n + 1].any() for k in places]
    assert (widened(given_mask, places, n) == near).all()
    assert (joined(given_mask, places, n) >= given_mask).all()


def test_runs_are_kept_in_which_something_happens():
    assert text(runs_with(mask("##.##.##"), mask("...#...."))) == "...##..."
    assert text(runs_with(mask("##.##"), mask("..#.."))) == "....."
