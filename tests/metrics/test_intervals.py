import numpy as np
import pytest
from sklearn.metrics import roc_auc_score

from holdfast.metrics import bootstrap_interval, ratio_of_sums
from holdfast.metrics.statistics import auc_of, draw_recordings, quantile_of

RNG = np.random.default_rng(5)
DRAWS = RNG.multinomial(6, np.full(6, 1 / 6), size=20).astype(float)


def drawn(values, draw):
    """The values of the recordings drawn, each as often as it was."""
    return np.concatenate([np.tile(v, int(k)) for v, k in zip(values, draw, strict=True)])


def test_a_resample_draws_as_many_recordings_as_there_are():
    draws = draw_recordings(7, 100, 0)
    assert draws.shape == (100, 7)
    assert (draws.sum(axis=1) == 7).all()


def test_a_ratio_is_that_of_the_recordings_drawn():
    parts, wholes = RNG.integers(0, 50, 6), RNG.integers(50, 99, 6)
    values = ratio_of_sums(parts, wholes)(DRAWS)
    expected = [drawn(parts[:, None], d).sum() / drawn(wholes[:, None], d).sum() for d in DRAWS]
    assert values == pytest.approx(expected)


@pytest.mark.slow
@pytest.mark.parametrize("n", [30, 3000])
def test_an_auc_is_that_of_the_samples_of_the_recordings_drawn(n):
    positives = [RNG.normal(r / 3, 1, n).round(3) for r in range(6)]
    negatives = [RNG.normal(0, 1, 2 * n).round(3) for _ in range(6)]
    values = auc_of(positives, negatives)(DRAWS)
    expected = []
    for draw in DRAWS:
        one, zero = drawn(positives, draw), drawn(negatives, draw)
        expected.append(
            roc_auc_score(np.repeat([1, 0], [len(one), len(zero)]), np.append(one, zero))
        )
    assert values == pytest.approx(expected, abs=1e-12 if n == 30 else 1e-4)


def test_a_resample_of_one_class_defines_no_auc():
    values = auc_of([np.ones(3), np.empty(0)], [np.empty(0), np.zeros(3)])(np.eye(2) * 2)
    assert np.isnan(values).all()
    nothing = auc_of([np.empty(0)] * 2, [np.empty(0)] * 2)
    assert bootstrap_interval(nothing, 2) is None


def test_a_quantile_is_that_of_the_values_of_the_recordings_drawn():
    values = [RNG.normal(size=n) for n in (3, 1, 4, 0, 5, 9)]
    draws = DRAWS[(DRAWS @ [3, 1, 4, 0, 5, 9]) > 0]
    expected = [np.quantile(drawn(values, draw), 0.95) for draw in draws]
    assert quantile_of(values, 0.95)(draws) == pytest.approx(expected)


def test_an_end_may_be_infinite():
    delays = quantile_of([np.array([0.1]), np.array([np.inf])], 0.5)
    assert bootstrap_interval(delays, 2) == (0.1, None)


def test_fewer_than_two_recordings_have_no_interval():
    assert bootstrap_interval(ratio_of_sums([1], [2]), 1) is None


def test_the_seed_decides_and_the_level_widens():
    values = RNG.normal(size=40)
    mean = ratio_of_sums(values, np.ones(40))
    narrow, wide = (bootstrap_interval(mean, 40, level=level) for level in (0.5, 0.99))
    assert wide[0] < narrow[0] < values.mean() < narrow[1] < wide[1]
    assert bootstrap_interval(mean, 40) == bootstrap_interval(mean, 40, seed=0)
    assert bootstrap_interval(mean, 40) != bootstrap_interval(mean, 40, seed=1)


def test_the_interval_of_a_mean_is_that_of_the_normal_law():
    values = np.random.default_rng(0).normal(size=400)
    low, high = bootstrap_interval(ratio_of_sums(values, np.ones(400)), 400, n=4000)
    half = 1.96 * values.std() / 20
    assert (low, high) == pytest.approx((values.mean() - half, values.mean() + half), abs=0.01)
