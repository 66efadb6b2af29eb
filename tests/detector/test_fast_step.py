import numba
import numpy as np
import pytest

from holdfast.detector.fast_step import floats3, integers2, table_of


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
