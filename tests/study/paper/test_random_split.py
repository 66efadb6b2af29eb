import msgspec
import numpy as np
import pytest

from holdfast.classifiers import Samples, recipe
from holdfast.classifiers.threshold import best_cut
from holdfast.features import DEPLOYED_FEATURES
from holdfast.study.paper.pooled_samples import pooled
from holdfast.study.paper.random_split import (
    ELSEWHERE,
    FRESH,
    HELD_OUT,
    OBJECTS,
    TRAINING,
    VALIDATED,
    Cell,
    FitBudget,
    judge,
)
from holdfast.study.plan import scan_corpus
from study.example_recordings import save_synthetic

EFFORT = FitBudget(trials=1, n_fit=100_000)
"""One trial is the reference setting."""
KINDS = (("logreg", DEPLOYED_FEATURES), ("svm", ("energy",)))


@pytest.fixture(scope="module")
def corpora(tmp_path_factory):
    folder = tmp_path_factory.mktemp("protocol")
    seeds = {"main": range(5), "fresh": range(10, 12), "others": range(20, 22)}
    return {name: scan_corpus(name, save_synthetic(folder / name, s)) for name, s in seeds.items()}


def judged(corpora, *, thorough=True, effort=EFFORT, seed=0):
    return judge(corpora, "index", 14, KINDS, effort, seed, thorough)


@pytest.fixture(scope="module")
def alone(corpora):
    return judged({"main": corpora["main"]})


def naive(corpora, on):
    """ConfusionCounts of LogReg of the deployed features, fitted and counted the long way."""
    main = pooled(corpora["main"], 150.0, "index", 14, seed=0)
    data = main.only(DEPLOYED_FEATURES)
    every = np.arange(len(main.parts))
    train = every[main.parts >= 5]
    folds = {
        TRAINING: [(train, train)],
        HELD_OUT: [(train, every[main.parts < 5])],
        VALIDATED: [
            (train[main.parts[train] % 5 != k], train[main.parts[train] % 5 == k]) for k in range(5)
        ],
        ELSEWHERE: [(every[data.groups != g], every[data.groups == g]) for g in range(5)],
        OBJECTS: [
            (every[data.groups % 3 != k], every[data.groups % 3 == k])  # by turns, as synthetic
            for k in range(3)
        ],
    }[on]
    counts = [[0, 0, 0, 0] for _ in range(5)]
    how = recipe("logreg")
    for fitted, tested in folds:
        rule = how.fit(Samples(*(part[fitted] for part in data)), how.reference, 0)
        called = rule.probability(data.features[tested]) >= rule.threshold
        for k, stable in zip(tested, called, strict=True):
            counts[data.groups[k]][2 * int(data.stable[k]) + int(stable)] += 1
    return counts


@pytest.mark.parametrize("on", [TRAINING, VALIDATED, HELD_OUT, ELSEWHERE, OBJECTS])
def test_counts_are_those_of_the_long_way(corpora, alone, on):
    assert alone[0].counts[on] == naive(corpora, on)


def test_what_it_was_measured_on(corpora, alone):
    together = [TRAINING, VALIDATED, HELD_OUT, ELSEWHERE, OBJECTS]
    assert [list(cell.counts) for cell in alone] == [together] * 2
    light = judged({"main": corpora["main"]}, thorough=False)
    assert list(light[0].counts) == [HELD_OUT, ELSEWHERE]
    assert light[0].counts[ELSEWHERE] == alone[0].counts[ELSEWHERE]
    everything = judged(corpora)
    assert list(everything[0].counts) == [TRAINING, VALIDATED, HELD_OUT, FRESH, OBJECTS]
    assert list(judged(corpora, thorough=False)[0].counts) == [HELD_OUT, FRESH, OBJECTS]


def test_fresh_recordings_are_all_of_them(corpora):
    counts = judged(corpora, thorough=False)[0].counts
    fresh = pooled(corpora["fresh"], 150.0, "index", 14, seed=0)
    assert np.sum(counts[FRESH], axis=1).tolist() == np.bincount(fresh.samples.groups).tolist()
    assert len(counts[OBJECTS]) == 2


def test_the_split_is_reproducible_and_follows_the_seed(corpora, alone):
    main = {"main": corpora["main"]}
    assert judged(main) == alone
    other = judged(main, seed=1)
    assert other[0].counts[HELD_OUT] != alone[0].counts[HELD_OUT]
    assert np.sum(other[0].counts[ELSEWHERE]) == np.sum(alone[0].counts[ELSEWHERE])


def test_80_percent_train(alone):
    counts = alone[0].counts
    total = np.sum(counts[ELSEWHERE])
    assert np.sum(counts[TRAINING]) == alone[0].n_fitted == pytest.approx(0.8 * total, rel=0.02)
    assert np.sum(counts[TRAINING]) + np.sum(counts[HELD_OUT]) == total


def test_a_fit_takes_no_more_than_it_may(corpora):
    cell = judged({"main": corpora["main"]}, thorough=False, effort=FitBudget(1, 500))[0]
    assert 400 < cell.n_fitted <= 500


def test_a_search_tries_more_than_the_reference(corpora, alone):
    reference = recipe("logreg").reference
    assert alone[0].parameters == reference
    cell = judged({"main": corpora["main"]}, thorough=False, effort=FitBudget(4, 500))[0]
    assert set(cell.parameters) == set(reference)
    assert cell.parameters != reference


def test_a_threshold_has_nothing_to_search_and_calls_little_energy_stable(corpora):
    kinds = [("threshold", ("energy",))]
    main = {"main": corpora["main"]}
    (cell,) = judge(main, "index", 14, kinds, EFFORT, 0, thorough=False)
    assert cell.parameters == {}
    pool = pooled(corpora["main"], 150.0, "index", 14, seed=0)
    train = pool.parts >= 5
    energy = pool.only(["energy"]).features[:, 0]
    cut = best_cut(energy[train], pool.samples.stable[train], "below").place
    right = (energy <= cut) == pool.samples.stable
    tn, _, _, tp = np.sum(cell.counts[HELD_OUT], axis=0)
    assert tn + tp == right[~train].sum()


def test_cells_go_over_the_wire(alone):
    data = msgspec.msgpack.encode(alone)
    assert msgspec.msgpack.decode(data, type=list[Cell]) == alone
