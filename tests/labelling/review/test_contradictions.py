from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE
from holdfast.labelling.review.contradictions import (
    Edge,
    UsualShift,
    confident_thresholds,
    contradictions,
    edges_of,
    unusual_shift,
    usual_shifts,
)
from holdfast.labelling.review.spans import Span

LABELS = np.array([NO_CONTACT, NO_CONTACT, UNSTABLE, UNSTABLE, STABLE, STABLE, STABLE])
PROBABILITIES = np.array(
    [
        [0.9, 0.1, 0.0],
        [0.7, 0.2, 0.1],
        [0.1, 0.6, 0.3],
        [0.0, 0.2, 0.8],
        [0.0, 0.1, 0.9],
        [0.0, 0.3, 0.7],
        [0.1, 0.5, 0.4],
    ]
)
"""Thresholds by hand: (0.9 + 0.7) / 2, (0.6 + 0.2) / 2, (0.9 + 0.7 + 0.4) / 3."""


def naive(labels, probabilities, thresholds):
    """The same by a loop: the highest of those that reach their thresholds."""
    found = []
    for label, row in zip(labels, probabilities, strict=True):
        over = [j for j in range(3) if row[j] >= thresholds[j]]
        best = max(over, key=lambda j: row[j]) + 1 if over else 0
        found.append(best if label and best != label else 0)
    return found


def test_thresholds_by_hand():
    found = confident_thresholds(LABELS, PROBABILITIES)
    np.testing.assert_allclose(found, [0.8, 0.4, 2 / 3])


def test_contradictions_by_hand():
    """Samples 3 and 6 reach the threshold of the other state."""
    thresholds = confident_thresholds(LABELS, PROBABILITIES)
    found = contradictions(LABELS, PROBABILITIES, thresholds)
    assert found.tolist() == [0, 0, 0, STABLE, 0, 0, UNSTABLE]


def test_a_state_without_samples_is_never_expected():
    labels = np.full(3, STABLE)
    probabilities = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    thresholds = confident_thresholds(labels, probabilities)
    assert np.isinf(thresholds[:2]).all()
    assert contradictions(labels, probabilities, thresholds).tolist() == [0, 0, 0]


def test_samples_without_label_or_probability_are_ignored():
    labels = np.append(LABELS, [0, STABLE])
    nothing = np.array([[0.0, 1.0, 0.0], [np.nan, np.nan, np.nan]])
    probabilities = np.concatenate([PROBABILITIES, nothing])
    thresholds = confident_thresholds(labels, probabilities)
    np.testing.assert_allclose(thresholds, confident_thresholds(LABELS, PROBABILITIES))
    assert contradictions(labels, probabilities, thresholds)[-2:].tolist() == [0, 0]


SHARES = st.tuples(*3 * [st.integers(0, 20)]).map(lambda row: np.array(row) / max(sum(row), 1))


@given(st.lists(st.tuples(st.integers(0, 3), SHARES), min_size=1))
def test_contradictions_equal_those_of_a_loop(rows):
    labels = np.array([label for label, _ in rows])
    probabilities = np.array([row for _, row in rows])
    thresholds = confident_thresholds(labels, probabilities)
    found = contradictions(labels, probabilities, thresholds)
    assert found.tolist() == naive(labels, probabilities, thresholds)


TIMES = np.arange(200) / 100.0


def seen(*changes, sure=0.9):
    """Probabilities that change from stable to unstable, and back, at those times [s]."""
    stable = np.searchsorted(np.array(changes) - 1e-9, TIMES, side="right") % 2 == 0
    probabilities = np.zeros((len(TIMES), 3))
    probabilities[:, 2] = np.where(stable, sure, 1 - sure)
    probabilities[:, 1] = 1 - probabilities[:, 2]
    return probabilities


def drawn(*cuts, states=("stable", "unstable")):
    return [Span(start, end, states[k % 2]) for k, (start, end) in enumerate(pairwise(cuts))]


@given(st.integers(50, 150))
def test_an_edge_is_found_where_the_probabilities_change(place):
    (edge,) = edges_of(drawn(0.0, 1.0, 2.0), TIMES, seen(place / 100))
    assert edge.likeliest == pytest.approx(place / 100)
    assert (edge.time, edge.low, edge.high, edge.change) == (1.0, 0.5, 1.5, (3, 2))


def test_edges_shift_by_half_a_second_at_most():
    (edge,) = edges_of(drawn(0.0, 1.0, 2.0), TIMES, seen(1.8))
    assert edge.likeliest == 1.5


def test_edges_stay_within_the_neighbouring_labels():
    first, second = edges_of(drawn(0.0, 1.0, 1.2, 2.0), TIMES, seen(1.4))
    assert (first.low, first.high) == (0.5, 1.2)
    assert (second.low, second.high) == (1.0, 1.7)


def test_a_gap_between_labels_is_no_edge():
    spans = [Span(0.0, 1.0, "stable"), Span(1.01, 2.0, "unstable")]
    assert list(edges_of(spans, TIMES, seen(1.0))) == []


def test_unknown_probabilities_do_not_count():
    probabilities = seen(1.2)
    probabilities[110:130] = np.nan
    (edge,) = edges_of(drawn(0.0, 1.0, 2.0), TIMES, probabilities)
    assert edge.likeliest == pytest.approx(1.1)


def test_one_sample_alone_does_not_decide():
    probabilities = seen(1.0)
    probabilities[130] = [0.0, 0.0, 1.0]
    (edge,) = edges_of(drawn(0.0, 1.0, 2.0), TIMES, probabilities)
    assert edge.likeliest == 1.0


def edge_at(likeliest, change=(3, 2)):
    return Edge(1.0, likeliest, 0.5, 1.5, change)


def test_the_usual_shift_is_subtracted():
    found = usual_shifts([edge_at(1.1), edge_at(1.12), edge_at(1.14), edge_at(0.9, (2, 3))])
    assert found[3, 2].median == pytest.approx(0.12)
    assert found[3, 2].deviation == pytest.approx(1.4826 * 0.02)
    assert found[2, 3] == pytest.approx((-0.1, 0.0))
    assert unusual_shift(edge_at(1.32), found[3, 2]) == pytest.approx(0.2)


def test_shifts_within_the_usual_deviation_are_ignored():
    usual = UsualShift(0.0, 0.1)
    assert unusual_shift(edge_at(1.19), usual) == 0.0
    assert unusual_shift(edge_at(1.21), usual) == pytest.approx(0.21)
    assert unusual_shift(edge_at(0.79), usual) == pytest.approx(-0.21)


def test_a_shift_stays_within_the_considered_times():
    assert unusual_shift(edge_at(1.45), UsualShift(-0.2, 0.0)) == pytest.approx(0.5)
