import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE
from holdfast.labelling.confident import confident_thresholds, contradictions

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
    """Sample 3 is as sure to be stable as stable ones are; sample 6 as unstable as those."""
    thresholds = confident_thresholds(LABELS, PROBABILITIES)
    found = contradictions(LABELS, PROBABILITIES, thresholds)
    assert found.tolist() == [0, 0, 0, STABLE, 0, 0, UNSTABLE]


def test_without_a_class_nothing_is_taken_for_it():
    labels = np.full(3, STABLE)
    probabilities = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    thresholds = confident_thresholds(labels, probabilities)
    assert np.isinf(thresholds[:2]).all()
    assert contradictions(labels, probabilities, thresholds).tolist() == [0, 0, 0]


def test_samples_without_label_or_probability_count_for_nothing():
    labels = np.append(LABELS, [0, STABLE])
    nothing = np.array([[0.0, 1.0, 0.0], [np.nan, np.nan, np.nan]])
    probabilities = np.concatenate([PROBABILITIES, nothing])
    thresholds = confident_thresholds(labels, probabilities)
    np.testing.assert_allclose(thresholds, confident_thresholds(LABELS, PROBABILITIES))
    assert contradictions(labels, probabilities, thresholds)[-2:].tolist() == [0, 0]


SHARES = st.tuples(*3 * [st.integers(0, 20)]).map(lambda row: np.array(row) / max(sum(row), 1))


@given(st.lists(st.tuples(st.integers(0, 3), SHARES), min_size=1))
def test_as_by_a_loop(rows):
    labels = np.array([label for label, _ in rows])
    probabilities = np.array([row for _, row in rows])
    thresholds = confident_thresholds(labels, probabilities)
    found = contradictions(labels, probabilities, thresholds)
    assert found.tolist() == naive(labels, probabilities, thresholds)
