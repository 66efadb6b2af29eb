import math

import numpy as np
import pytest

from holdfast.metrics import Decisions, FingerDecisions, summarise
from holdfast_lab.study.comparison.rows import (
    correct_and_all,
    difference_row,
    quantile_row,
    quotient_row,
    ratio_row,
    sample_rows,
)


def metrics_of(*recordings):
    """Of recordings given as (labels, states) of one finger."""
    every = []
    for k, (labels, states) in enumerate(recordings):
        p = np.where(np.array(states) == 3, 0.9, 0.1)
        finger = FingerDecisions(np.arange(len(labels)) * 0.01, labels, states, p)
        every.append(Decisions(f"r{k}", {"thumb": finger, "index": finger}, finger))
    return summarise(every)


LABELS = [3, 3, 2, 2]
RIGHT, HALF = (LABELS, LABELS), (LABELS, [3, 2, 3, 2])


def test_the_difference_is_that_of_the_accuracies():
    first, second = metrics_of(RIGHT, HALF, RIGHT), metrics_of(HALF, HALF, RIGHT)
    row = difference_row({"figure": "d"}, first, second, seed=0)
    assert row.ours == pytest.approx(first.pooled.accuracy - second.pooled.accuracy)
    assert row.ours == pytest.approx(100 / 6)
    assert row.n == 3
    assert correct_and_all(first) == {"r0": (8, 8), "r1": (4, 8), "r2": (8, 8)}


def test_its_interval_draws_the_same_recordings_for_both():
    """As by a loop over resamples; of equal methods it has no width."""
    first, second = metrics_of(RIGHT, HALF, RIGHT, HALF), metrics_of(HALF, HALF, RIGHT, RIGHT)
    draws = np.random.default_rng(5).multinomial(4, [0.25] * 4, size=1000)
    one, other = np.array([8, 4, 8, 4]), np.array([4, 4, 8, 8])
    values = sorted(100 * (row @ one - row @ other) / 32 for row in draws)
    row = difference_row({}, first, second, seed=5)
    assert row.interval == pytest.approx(tuple(np.quantile(values, [0.025, 0.975])))
    assert difference_row({}, first, first, seed=0).interval == (0.0, 0.0)


def test_ratios_leave_out_recordings_with_nothing():
    row = ratio_row({"figure": "x"}, [1, 0, 3], [2, 0, 4], seed=0)
    assert (row.ours, row.n) == (pytest.approx(400 / 6), 2)
    assert row.interval == pytest.approx((50.0, 75.0))
    nothing = ratio_row({}, [0], [0], seed=0)
    assert (nothing.ours, nothing.n, nothing.interval) == (None, 0, None)


def test_quantiles_may_be_infinite():
    row = quantile_row({}, [[0.1, 0.3], [], [math.inf]], 0.5, seed=0)
    assert (row.ours, row.n) == (0.3, 2)
    assert row.interval == (pytest.approx(0.2), None)
    assert quantile_row({}, [[math.inf]], 0.95, seed=0).ours == math.inf
    assert quantile_row({}, [[]], 0.5, seed=0).ours is None


def test_sample_rows_with_the_values_of_the_paper():
    rows = sample_rows({"on": "x"}, metrics_of(RIGHT, HALF), paper={"accuracy [%]": 95.0})
    assert [row.keys["figure"] for row in rows][:2] == ["accuracy [%]", "FDR [%]"]
    assert (rows[0].ours, rows[0].paper, rows[0].n) == (75.0, 95.0, 2)
    assert rows[0].interval == pytest.approx((50.0, 100.0))
    assert rows[1].paper is None


def test_a_quotient_of_error_shares_is_paired():
    """Ours: 10 of 200 wrong, 5 %. The baseline: 30 of 200, 15 %. In each recording three times."""
    base, ours = np.array([[24, 100], [6, 100]]), np.array([[8, 100], [2, 100]])
    row = quotient_row({"figure": "ratio"}, base, ours, seed=0)
    assert row.ours == pytest.approx(3.0)
    assert row.interval == (pytest.approx(3.0), pytest.approx(3.0))
    assert row.n == 2
