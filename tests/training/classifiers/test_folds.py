import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.training.classifiers.fitting import logistic
from holdfast.training.classifiers.folds import deal_folds, group_folds, shuffled, time_folds


@given(n=st.integers(0, 40), n_folds=st.integers(1, 12), seed=st.integers(0, 2**32 - 1))
def test_folds_are_every_nth_unit_of_the_order(n, n_folds, seed):
    order = np.random.default_rng(seed).permutation(n)
    fold_of = deal_folds(n, n_folds, order)
    for fold in range(n_folds):
        assert set(np.flatnonzero(fold_of == fold)) == set(order[fold::n_folds])


@given(
    groups=st.lists(st.integers(0, 9), max_size=40),
    n_folds=st.integers(1, 6),
    seed=st.none() | st.integers(0, 2**32 - 1),
)
def test_folds_of_groups_are_those_of_a_loop(groups, n_folds, seed):
    names = np.unique(np.array(groups, dtype=np.int64))
    order = names if seed is None else np.random.default_rng(seed).permutation(names)
    masks = group_folds(np.array(groups, dtype=np.int64), n_folds, seed)
    assert len(masks) == min(n_folds, len(names))
    for fold, mask in enumerate(masks):
        assert mask.tolist() == [group in order[fold::n_folds] for group in groups]


@given(n=st.integers(0, 50), seed=st.integers(0, 2**32 - 1))
def test_names_are_shuffled_as_their_indices(n, seed):
    names = np.arange(100, 100 + n)
    expected = np.random.default_rng(seed).permutation(names)
    assert np.array_equal(names[shuffled(n, seed)], expected)


def test_time_is_cut_by_the_time_of_each_recording():
    times = np.array([0.0, 1.9, 2.1, 10.0, 100.0, 104.9, 105.1, 110.0])
    recordings = np.repeat([0, 1], 4)
    assert time_folds(recordings, times, 5).tolist() == [0, 0, 1, 4, 0, 2, 2, 4]
    assert time_folds(np.zeros(2, dtype=int), np.zeros(2), 5).tolist() == [0, 0]


def test_the_logistic_function_has_scipys_bits():
    from scipy.special import expit

    values = [*np.linspace(-700, 700, 20_001), *np.random.default_rng(0).normal(size=20_000)]
    assert [logistic(float(value)) for value in values] == [float(expit(v)) for v in values]
    assert logistic(-1e6) == pytest.approx(0.0, abs=1e-300)
