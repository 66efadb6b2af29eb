"""Arrays by their addresses, so that a call from Python need not hand over each of them.

A compiled function unwraps every array that it is given, at 50 ns each; for the twenty of a
detector that is a fifth of an update. It gets one table instead. Who makes a table keeps the
arrays, and neither resizes nor replaces them as long as the table is used.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from holdfast.compiled import compiled

_AXES = 3


def table_of(arrays: Sequence[npt.NDArray[Any]]) -> npt.NDArray[np.int64]:
    """(n_arrays, 4) address and shape of each array.

    Raises:
        ValueError: an array is not contiguous.
    """
    table = np.zeros((len(arrays), 1 + _AXES), dtype=np.int64)
    for row, array in zip(table, arrays, strict=True):
        if not array.flags.c_contiguous:
            raise ValueError("contiguous arrays expected")
        row[0] = array.ctypes.data
        row[1 : 1 + array.ndim] = array.shape
    return table


def _cast(_typing: Any, address: Any) -> Any:  # noqa: ANN401 (numba's own objects)
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ANN401
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return types.voidptr(address), generate


_pointer: Any = intrinsic(_cast)


@compiled
def floats1(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.float64]:
    """Array i of the table: numbers along one axis."""
    return carray(_pointer(table[i, 0]), (table[i, 1],), np.float64)


@compiled
def floats2(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.float64]:
    """Array i of the table: numbers along two axes."""
    return carray(_pointer(table[i, 0]), (table[i, 1], table[i, 2]), np.float64)


@compiled
def floats3(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.float64]:
    """Array i of the table: numbers along three axes."""
    shape = (table[i, 1], table[i, 2], table[i, 3])
    return carray(_pointer(table[i, 0]), shape, np.float64)


@compiled
def integers1(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.int64]:
    """Array i of the table: integers along one axis."""
    return carray(_pointer(table[i, 0]), (table[i, 1],), np.int64)


@compiled
def integers2(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.int64]:
    """Array i of the table: integers along two axes."""
    return carray(_pointer(table[i, 0]), (table[i, 1], table[i, 2]), np.int64)


@compiled
def integers3(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.int64]:
    """Array i of the table: integers along three axes."""
    shape = (table[i, 1], table[i, 2], table[i, 3])
    return carray(_pointer(table[i, 0]), shape, np.int64)


@compiled
def flags1(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.bool_]:
    """Array i of the table: truth values along one axis."""
    return carray(_pointer(table[i, 0]), (table[i, 1],), np.bool_)
