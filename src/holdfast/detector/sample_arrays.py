"""Readings of Python's arrays, copied by a compiled step from the memory of the arrays.

To unpack an array, NumPy and numba need 50 to 250 ns, more than the copy itself. So a compiled
step receives the address of a tuple of arrays, and reads the fields of these objects where
CPython and NumPy's C interface have them. It accepts exactly what it can read: a tuple, arrays
of NumPy's own class, two axes of the right length, uint16 or float64, contiguous. For anything
else it returns False before it has copied anything, and the detector copies by NumPy instead.
`has_known_layout` compares the places of the fields with a known array when this is imported;
where they differ, nothing is readable. docs/decisions/0014-one-table-of-addresses.md has figures.
"""

import ctypes
import sys

import numpy as np
import numpy.typing as npt
from numba.np.numpy_support import carray

from holdfast.compiled import compiled_step, compiled_view
from holdfast.detector.address_table import pointer
from holdfast.sensors.types import Array, Integers

WORD = 8
"""Length of a field [bytes]."""
# Fields of an object, in words. Interpreters differ in the length of their headers.
OBJECT_HEADER = object.__basicsize__ // WORD
TYPE = OBJECT_HEADER - 1
FIRST_ITEM = tuple.__basicsize__ // WORD
DATA, N_AXES, SHAPE, STRIDES, DTYPE = (
    OBJECT_HEADER + place for place in (0, 1, 2, 3, 5)
)  # of an array
OBJECT_WORDS = OBJECT_HEADER + 6

TUPLE, ARRAY, COUNTS, FLOATS = range(4)


def has_known_layout() -> bool:
    """Return whether this interpreter has the fields of its objects where they are expected."""
    if sys.implementation.name != "cpython" or np.ndarray.__basicsize__ < WORD * OBJECT_WORDS:
        return False
    array = np.zeros((2, 3), dtype=np.uint16)
    arrays = (array,)
    fields = _memory_of(id(array), OBJECT_WORDS)
    expected = {TYPE: id(np.ndarray), DATA: array.ctypes.data, DTYPE: id(array.dtype)}
    return (
        _memory_of(id(arrays), FIRST_ITEM + 1)[FIRST_ITEM] == id(array)
        and all(fields[place] == value for place, value in expected.items())
        and fields[N_AXES] & 0xFFFFFFFF == array.ndim
        and fields[STRIDES] == fields[SHAPE] + WORD * array.ndim  # one block of memory
        and _memory_of(fields[SHAPE], 4) == [*array.shape, *array.strides]
    )


def _memory_of(address: int, n_words: int) -> list[int]:
    return list((ctypes.c_int64 * n_words).from_address(address))


def readable_types() -> Integers:
    """Return the addresses of the types that can be read; zeros, which no type has, for none."""
    readable = (tuple, np.ndarray, np.dtype(np.uint16), np.dtype(np.float64))
    known = has_known_layout()
    return np.array([id(kind) if known else 0 for kind in readable])


KNOWN_TYPES = readable_types()
"""Addresses of the types that can be read; they live as long as the interpreter."""


@compiled_view
def _words(address: int, n: int) -> npt.NDArray[np.int64]:
    return carray(pointer(address), (n,), np.int64)


@compiled_view
def _counts(address: int, n: int) -> npt.NDArray[np.uint16]:
    return carray(pointer(address), (n,), np.uint16)


@compiled_view
def _floats(address: int, n: int) -> npt.NDArray[np.float64]:
    return carray(pointer(address), (n,), np.float64)


@compiled_step
def copy_samples(samples: int, offsets: Integers, known: Integers, readings: Array) -> bool:
    """Copy the readings of all fingers, if all of them are in a form that can be read.

    Args:
        samples: address of a tuple with one array for each finger.
        offsets: (n_fingers + 1,) first taxel of each finger.
        known: `KNOWN_TYPES`.
        readings: (n_taxels, 3) of all fingers; is filled.

    Returns:
        Whether they were copied.
    """
    n_fingers = len(offsets) - 1
    if _words(samples, OBJECT_WORDS)[TYPE] != known[TUPLE]:
        return False
    arrays = _words(samples + WORD * FIRST_ITEM, n_fingers)
    for f in range(n_fingers):
        if not _is_readable(arrays[f], offsets[f + 1] - offsets[f], known):
            return False
    for f in range(n_fingers):
        first, n = 3 * offsets[f], 3 * (offsets[f + 1] - offsets[f])
        _copy(
            _words(arrays[f], OBJECT_WORDS), known, _floats(readings.ctypes.data + WORD * first, n)
        )
    return True


@compiled_step
def _is_readable(address: int, n_taxels: int, known: Integers) -> bool:
    """Return whether an object is an array of (n_taxels, 3) in a form that can be read."""
    fields = _words(address, OBJECT_WORDS)
    if fields[TYPE] != known[ARRAY]:
        return False
    size = 2 if fields[DTYPE] == known[COUNTS] else WORD
    if size == WORD and fields[DTYPE] != known[FLOATS]:
        return False
    if fields[N_AXES] & 0xFFFFFFFF != 2 or fields[DATA] % size != 0:
        return False
    shape, strides = _words(fields[SHAPE], 2), _words(fields[STRIDES], 2)
    fits = shape[0] == n_taxels and shape[1] == 3
    return bool(fits and strides[0] == 3 * size and strides[1] == size)


@compiled_step
def _copy(fields: Integers, known: Integers, readings: Array) -> None:
    """Copy the values of an array, in the order of its memory."""
    n = np.uint64(len(readings))
    if fields[DTYPE] == known[COUNTS]:
        counts = _counts(fields[DATA], len(readings))
        for place in range(n):
            readings[place] = counts[place]
    else:
        values = _floats(fields[DATA], len(readings))
        for place in range(n):
            readings[place] = values[place]
