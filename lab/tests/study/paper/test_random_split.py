import numpy as np
import pytest

from holdfast.detection import DEPLOYED_FEATURES
from holdfast.training.classifiers.fitting import Samples
from holdfast_lab.study.paper.pooled_samples import pool_samples
from holdfast_lab.study.paper.random_split import (
    CONFUSION_RATES,
    FIT_RECIPES,
    FRESH,
    HELD_OUT,
    OTHER_RECORDINGS,
    TRAINING,
    UNSEEN_OBJECTS,
    VALIDATED,
    FitBudget,
    evaluate_variants,
    rate_rows,
)
from study.example_recordings import corpora_of

pytestmark = pytest.mark.slow

BUDGET = FitBudget(trials=1, n_fit=100_000)
"""One trial is the reference setting."""
VARIANTS = (("logreg", DEPLOYED_FEATURES), ("svm", ("energy",)))


@pytest.fixture(scope="module")
def corpora(tmp_path_factory):
    seeds = {"main": range(5), "fresh": range(10, 12), "others": range(20, 22)}
    return corpora_of(tmp_path_factory.mktemp("protocol"), seeds)


def evaluated(corpora, *, thorough=True, budget=BUDGET, seed=0):
    return evaluate_variants(corpora, "index", 14, VARIANTS, budget, seed, thorough)


@pytest.fixture(scope="module")
def alone(corpora):
    return evaluated({"main": corpora["main"]})


def naive(corpora, on):
    """ConfusionCounts of LogReg of the deployed features, fitted and counted sample by sample."""
    main = pool_samples(corpora["main"], 150.0, "index", 14, seed=0)
    data = main.select(DEPLOYED_FEATURES)
    every = np.arange(len(main.parts))
    train = every[main.parts >= 5]
    folds = {
        TRAINING: [(train, train)],
        HELD_OUT: [(train, every[main.parts < 5])],
        VALIDATED: [
            (train[main.parts[train] % 5 != k], train[main.parts[train] % 5 == k]) for k in range(5)
        ],
        OTHER_RECORDINGS: [(every[data.groups != g], every[data.groups == g]) for g in range(5)],
        UNSEEN_OBJECTS: [
            (every[data.groups % 3 != k], every[data.groups % 3 == k])  # by turns, as synthetic
            for k in range(3)
        ],
    }[on]
    counts = [[0, 0, 0, 0] for _ in range(5)]
    how = FIT_RECIPES["logreg"]
    for fitted, tested in folds:
        rule = how.fit(Samples(*(part[fitted] for part in data)), how.reference, 0)
        called = rule.probability(data.features[tested]) >= rule.threshold
        for k, stable in zip(tested, called, strict=True):
            counts[data.groups[k]][2 * int(data.positive[k]) + int(stable)] += 1
    return counts


@pytest.mark.parametrize("on", [TRAINING, VALIDATED, HELD_OUT, OTHER_RECORDINGS, UNSEEN_OBJECTS])
def test_counts_are_those_of_a_naive_fit(corpora, alone, on):
    assert alone[0].counts[on] == naive(corpora, on)


def test_kinds_of_test_data(corpora, alone):
    together = [TRAINING, VALIDATED, HELD_OUT, OTHER_RECORDINGS, UNSEEN_OBJECTS]
    assert [list(cell.counts) for cell in alone] == [together] * 2
    light = evaluated({"main": corpora["main"]}, thorough=False)
    assert list(light[0].counts) == [HELD_OUT, OTHER_RECORDINGS]
    assert light[0].counts[OTHER_RECORDINGS] == alone[0].counts[OTHER_RECORDINGS]
    everything = evaluated(corpora)
    assert list(everything[0].counts) == [TRAINING, VALIDATED, HELD_OUT, FRESH, UNSEEN_OBJECTS]
    assert list(evaluated(corpora, thorough=False)[0].counts) == [HELD_OUT, FRESH, UNSEEN_OBJECTS]


def test_the_split_is_reproducible_and_depends_on_the_seed(corpora, alone):
    main = {"main": corpora["main"]}
    assert evaluated(main) == alone
    other = evaluated(main, seed=1)
    assert other[0].counts[HELD_OUT] != alone[0].counts[HELD_OUT]
    assert np.sum(other[0].counts[OTHER_RECORDINGS]) == np.sum(alone[0].counts[OTHER_RECORDINGS])


def test_a_fit_has_a_maximum_number_of_samples(corpora):
    cell = evaluated({"main": corpora["main"]}, thorough=False, budget=FitBudget(1, 500))[0]
    assert 400 < cell.n_fitted <= 500


def test_rates_by_hand():
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
    ((_, row),) = rate_rows([[5, 0, 5, 0]] * 3, ["FDR"], seed=0)  # nothing was called stable
    assert (row.ours, row.interval) == (None, None)
