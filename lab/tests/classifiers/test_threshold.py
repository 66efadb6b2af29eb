from itertools import pairwise

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from holdfast.errors import TrainingError
from holdfast.training.classifiers import Samples
from holdfast_lab.classifiers.threshold import Threshold, best_cut

pytestmark = pytest.mark.slow


def samples(features, stable):
    features = np.asarray(features, dtype=float)
    features = features[:, None] if features.ndim == 1 else features
    return Samples(features, np.asarray(stable, dtype=bool), np.arange(len(features)) % 3)


def fit(given_samples, side="either"):
    recipe = Threshold(side)
    return recipe.fit(given_samples, recipe.reference, 0)


def decisions(fitted, features):
    return fitted.probability(features) >= fitted.threshold


def balanced_accuracy(called, stable):
    return (called[stable].mean() + (~called[~stable]).mean()) / 2


def brute_force(values, stable, side):
    """The best balanced accuracy of all cuts between two different values."""
    ordered = sorted(set(values.tolist()))
    found = []
    for threshold in [(a + b) / 2 for a, b in pairwise(ordered)]:
        if side != "below":
            found.append(balanced_accuracy(values > threshold, stable))
        if side != "above":
            found.append(balanced_accuracy(values < threshold, stable))
    return max(found, default=0.5)


labelled = st.lists(st.tuples(st.integers(-20, 20), st.booleans()), min_size=2, max_size=40).filter(
    lambda rows: len({stable for _, stable in rows}) == 2
)


@settings(max_examples=60)
@given(labelled, st.sampled_from(["below", "above", "either"]))
def test_against_brute_force(rows, side):
    values = np.array([value for value, _ in rows]) * 0.37
    stable = np.array([stable for _, stable in rows])
    cut = best_cut(values, stable, side)
    n_pairs = int(stable.sum()) * int((~stable).sum())
    best = brute_force(values, stable, side)
    assert 0.5 + cut.gain / (2 * n_pairs) == pytest.approx(best)
    if len(set(values.tolist())) > 1:
        called = values > cut.value if cut.sign > 0 else values < cut.value
        assert balanced_accuracy(called, stable) == pytest.approx(best)
        assert side == "either" or cut.sign == {"below": -1, "above": 1}[side]
        fitted = fit(samples(values, stable), side)
        assert np.array_equal(decisions(fitted, values[:, None]), called)


def test_the_best_feature_is_taken_and_the_first_of_equals():
    rng = np.random.default_rng(0)
    stable = np.arange(60) % 2 == 0
    good = stable + rng.normal(size=60) * 0.1
    fitted = fit(samples(np.column_stack([rng.normal(size=60), good, 2 * good, good]), stable))
    assert [c != 0 for c in fitted.rule.weights[0]] == [False, True, False, False]


def test_probabilities_are_calibrated():
    rng = np.random.default_rng(2)
    values = rng.normal(size=20000)
    stable = rng.random(20000) < 1 / (1 + np.exp(2 * values - 1))
    found = fit(samples(values, stable)).probability(values[:, None])
    for low in np.arange(0, 1, 0.2):
        inside = (found >= low) & (found < low + 0.2)
        assert stable[inside].mean() == pytest.approx(found[inside].mean(), abs=0.03)


def test_one_class_is_refused():
    with pytest.raises(TrainingError, match="both classes are needed to train"):
        fit(samples(np.arange(4.0), np.ones(4)))
