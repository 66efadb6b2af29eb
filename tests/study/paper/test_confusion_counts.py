import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.classifiers import LinearClassifier, Samples
from holdfast.study.paper.random_split import CONFUSION_RATES, confusion_counts, rate_rows

RULE = LinearClassifier((0.0,), (1.0,), (1.0,), intercept=0.0, threshold=0.5)
"""Stable where the feature is at least 0."""


def naive(features, stable, groups, n):
    """[TN, FP, FN, TP] of each recording, sample by sample."""
    found = [[0, 0, 0, 0] for _ in range(n)]
    for value, truth, group in zip(features[:, 0], stable, groups, strict=True):
        called = value >= 0
        found[group][
            ["TN", "FP", "FN", "TP"].index(
                ("T" if called == truth else "F") + ("P" if called else "N")
            )
        ] += 1
    return found


@given(
    st.lists(
        st.tuples(st.sampled_from([-1.0, 0.0, 2.0]), st.booleans(), st.integers(0, 3)), max_size=60
    )
)
@settings(max_examples=50, deadline=None)
def test_confusions_are_those_of_a_loop(rows):
    features = np.array([[row[0]] for row in rows]).reshape(-1, 1)
    stable = np.array([row[1] for row in rows], dtype=bool)
    groups = np.array([row[2] for row in rows], dtype=np.int64)
    found = confusion_counts(RULE, Samples(features, stable, groups), 5)
    assert found.tolist() == naive(features, stable, groups, 5)


def test_figures_by_hand():
    counts = [[8, 2, 1, 9], [0, 0, 0, 0], [6, 4, 3, 7]]
    found = dict(rate_rows(counts, CONFUSION_RATES, seed=0))
    assert {name: row.ours for name, row in found.items()} == pytest.approx(
        {
            "TNR": 100 * 14 / 20,
            "FPR": 100 * 6 / 20,
            "FNR": 100 * 4 / 20,
            "TPR": 100 * 16 / 20,
            "FDR": 100 * 6 / 22,
            "accuracy": 100 * 30 / 40,
        }
    )
    assert {row.n for row in found.values()} == {2}
    # two recordings: a resample holds both, or one of them twice
    assert found["accuracy"].interval == pytest.approx((65.0, 85.0))


def test_nothing_called_stable_has_no_fdr():
    ((_, row),) = rate_rows([[5, 0, 5, 0]] * 3, ["FDR"], seed=0)
    assert row.ours is None
    assert row.interval is None


def test_no_recordings():
    ((_, row),) = rate_rows([[0, 0, 0, 0]], ["accuracy"], seed=0)
    assert (row.ours, row.n, row.interval) == (None, 0, None)
