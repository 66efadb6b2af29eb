import numba
import numpy as np
import pytest

from holdfast.detector.fast_step import estimate_code, floats3, integers2, split_code, table_of


@numba.njit  # not kept: its cache would not follow the module that it tests
def double(table):
    numbers, integers = floats3(table, 0), integers2(table, 1)
    numbers *= 2.0
    integers[:] = numbers.shape[2]


def test_a_kernel_works_on_the_arrays_themselves():
    numbers, integers = np.arange(24.0).reshape(2, 3, 4), np.zeros((2, 2), dtype=np.int64)
    double(table_of([numbers, integers]))
    assert np.array_equal(numbers, 2 * np.arange(24.0).reshape(2, 3, 4))
    assert (integers == 4).all()


def test_refuses_arrays_with_holes():
    with pytest.raises(ValueError) as raised:
        table_of([np.zeros((4, 4))[:, ::2]])
    assert str(raised.value) == "contiguous arrays expected"


@pytest.mark.parametrize("decision", [(0, 1, 0, 0), (2, 0, 8191, 6), (3, 4, 255, 0)])
def test_a_code_is_split_as_it_was_made(decision):
    assert split_code(estimate_code(*decision)) == decision
