import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.metrics.statistics import finite_or_none, mann_whitney_u, percent, quantile

from . import naive

scores = st.lists(st.sampled_from([-np.inf, 0.0, 0.25, 0.5, 1.0, np.inf]), max_size=12)


@given(scores, scores)
def test_mann_whitney_u_equals_two_loops(positive, negative):
    won = mann_whitney_u(np.array(positive), np.array(negative))
    assert won == naive.mann_whitney_u(positive, negative)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=50), st.floats(0, 1))
def test_quantile_is_that_of_numpy(values, q):
    ours = quantile(np.sort(np.array(values)), q)
    assert ours == pytest.approx(np.quantile(values, q), rel=1e-6, abs=1e-2)


@pytest.mark.parametrize(
    ("n_misses", "q", "expected"), [(0, 0.95, 1.0), (1, 0.95, 1.0), (2, 0.95, np.inf)]
)
def test_a_quantile_is_infinite_only_where_it_falls_on_a_miss(n_misses, q, expected):
    values = np.concatenate([np.ones(21 - n_misses), np.full(n_misses, np.inf)])
    assert quantile(values, q) == expected


def test_empty_input_has_no_quantile_and_no_percentage():
    assert quantile(np.empty(0), 0.5) is None
    assert percent(0, 0) is None
    assert percent(1, 4) == 25.0


def test_json_holds_no_infinity():
    assert [finite_or_none(x) for x in (1.0, np.inf, np.nan, None)] == [1.0, None, None, None]
