import numpy as np
import pytest

from holdfast.detector import sample_arrays
from holdfast.detector.sample_arrays import (
    KNOWN_TYPES,
    copy_samples,
    has_known_layout,
    readable_types,
)
from holdfast.sensors.types import Integers

OFFSETS: Integers = np.array([0, 4, 9])


class Subclass(np.ndarray):
    pass


def hand(kind=np.uint16):
    generator = np.random.default_rng(0)
    return tuple(generator.integers(0, 60000, size=(n, 3)).astype(kind) for n in (4, 5))


def copied(arrays):
    readings = np.full((9, 3), -1.0)
    done = copy_samples(id(arrays), OFFSETS, KNOWN_TYPES, readings)
    assert done or (readings == -1).all()
    return readings if done else None


@pytest.mark.parametrize("kind", [np.uint16, np.float64])
@pytest.mark.parametrize("writeable", [True, False])
def test_copies_counts_and_newtons(kind, writeable):
    arrays = hand(kind)
    for array in arrays:
        array.flags.writeable = writeable
    assert np.array_equal(copied(arrays), np.concatenate(arrays))


def test_arrays_of_a_hand_may_have_different_types():
    arrays = (hand()[0], hand(float)[1])
    assert np.array_equal(copied(arrays), np.concatenate(arrays))


UNREADABLE = {
    "another type": lambda a: a.astype(np.int16),
    "another byte order": lambda a: a.astype(">u2"),
    "too few taxels": lambda a: a[:-1],
    "too few axes": lambda a: a[:, :2].copy(),
    "another number of axes": lambda a: a.ravel(),
    "three axes": lambda a: a[None],
    "every other row": lambda a: np.repeat(a, 2, axis=0)[::2],
    "columns first": np.asfortranarray,
    "not aligned": lambda a: np.frombuffer(b"0" + a.tobytes(), np.uint16, offset=1).reshape(5, 3),
    "a subclass": lambda a: a.view(Subclass),
    "a list": lambda a: a.tolist(),
    "nothing": lambda _: None,
}


@pytest.mark.parametrize("how", UNREADABLE)
def test_copies_nothing_that_it_cannot_read(how):
    first, second = hand()
    assert copied((first, UNREADABLE[how](second))) is None


@pytest.mark.parametrize("other", [None, [*hand()], hand()[0], "text"])
def test_reads_tuples_only(other):
    assert copied(other) is None


def test_this_interpreter_is_readable():
    assert has_known_layout()
    assert KNOWN_TYPES.all()


@pytest.mark.parametrize("name", ["TYPE", "FIRST_ITEM", "DATA", "N_AXES", "STRIDES", "DTYPE"])
def test_another_layout_is_found_at_start_up(monkeypatch, name):
    monkeypatch.setattr(sample_arrays, name, getattr(sample_arrays, name) - 1)
    assert not has_known_layout()
    assert not readable_types().any()


def test_another_interpreter_is_not_read(monkeypatch):
    monkeypatch.setattr(sample_arrays.sys.implementation, "name", "other")
    assert not has_known_layout()


def test_nothing_is_copied_where_no_type_is_known():
    readings = np.full((9, 3), -1.0)
    assert not copy_samples(id(hand()), OFFSETS, np.zeros_like(KNOWN_TYPES), readings)
    assert (readings == -1).all()
