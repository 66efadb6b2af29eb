from typing import NamedTuple

import numba
import numpy as np
import pytest

from holdfast.detector import address_table
from holdfast.detector.address_table import fields_of, kept_by, reader_of, reader_source, table_of
from holdfast.detector.fast_step import StepArrays
from holdfast.features.arrays import Flags1, Floats2, Floats3, Integers1, Integers2


class Inner(NamedTuple):
    places: Integers2
    ready: bool
    period: float


class Outer(NamedTuple):
    forces: Floats3
    inner: Inner
    n: int
    flags: Flags1


def outer():
    inner = Inner(np.arange(6).reshape(2, 3), True, 0.25)
    return Outer(np.arange(24.0).reshape(2, 3, 4), inner, 7, np.array([True, False, True]))


read_outer = reader_of(Outer)


@numba.njit  # not kept: its cache would not follow the module that it tests
def double(table):
    values = read_outer(table)
    forces, flags, places = values.forces, values.flags, values.inner.places
    forces *= 2.0
    flags[:] = False
    places[:] = forces.shape[2]
    return values.inner.ready, values.inner.period, values.n, values.forces.shape, len(values.flags)


@pytest.mark.slow
def test_a_kernel_works_on_the_arrays_themselves():
    values = outer()
    table, arrays = table_of(values)
    assert double(table) == (True, 0.25, 7, (2, 3, 4), 3)
    assert np.array_equal(values.forces, 2 * np.arange(24.0).reshape(2, 3, 4))
    assert not values.flags.any()
    assert (values.inner.places == 4).all()
    assert len(table) == len(arrays) == 6


def test_every_field_of_a_detector_has_one_row():
    def n_rows(definition):
        return sum(1 if f.kind else n_rows(f.type) for f in fields_of(definition))

    text = reader_source(StepArrays)
    rows = [f"(table, {place})" for place in range(n_rows(StepArrays))]
    assert all(text.count(row) == 1 for row in rows)
    assert text.count("(table, ") == len(rows)


def test_refuses_arrays_with_holes():
    values = outer()
    with pytest.raises(ValueError) as raised:
        table_of(values._replace(forces=np.zeros((2, 3, 8))[:, :, ::2]))
    assert str(raised.value) == (
        "Outer.forces: a contiguous array of 3 axes of float64 expected, 3 axes of float64 given"
    )


@pytest.mark.parametrize(
    ("array", "given"),
    [
        (np.zeros((2, 3), dtype=np.int32), "2 axes of int32"),
        (np.zeros(3, dtype=np.int64), "1 axes of int64"),
    ],
)
def test_refuses_an_array_of_another_kind(array, given):
    values = outer()
    with pytest.raises(ValueError) as raised:
        table_of(values._replace(inner=values.inner._replace(places=array)))
    assert str(raised.value) == (
        f"Inner.places: a contiguous array of 2 axes of int64 expected, {given} given"
    )


class Wrong(NamedTuple):
    name: str


def test_a_definition_holds_arrays_and_numbers_only():
    with pytest.raises(TypeError) as raised:
        reader_of(Wrong)
    assert str(raised.value) == "Wrong.name: an array or a number expected, <class 'str'>"


class Before(NamedTuple):
    first: Integers1
    second: Floats2


class After(NamedTuple):
    second: Floats2
    first: Integers1


def test_a_changed_definition_gives_another_name_to_numbas_cache():
    def named(definition):
        return kept_by(definition)(lambda table: table).__qualname__

    After.__name__ = "Before"
    assert named(Before) == named(Before)
    assert named(Before) != named(After)


def test_numba_keeps_functions_by_their_qualified_names():
    @kept_by(Before)
    def kernel(x):
        return x

    compiled = numba.njit(cache=True)(kernel)
    assert kernel.__qualname__.rpartition("_")[2] in compiled._cache._impl.filename_base


def test_generated_functions_stand_beside_their_module():
    kind = fields_of(Before)[1].kind
    view = address_table._names_of(Before)["float64_2"]
    assert kind.n_axes == 2
    assert view.py_func.__code__.co_filename == address_table.__file__
