"""Arrow columns from NumPy arrays and back, without pandas.

`pyarrow.array` and `to_numpy` import pandas wherever it is installed: 50 MB, and more time than
most recordings take to read.
"""

from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pyarrow as pa


def arrow_type(number: str | None) -> pa.DataType:
    """Return the type of a column by the name of its number type, `str` for text."""
    return pa.string() if number == "str" else pa.from_numpy_dtype(np.dtype(number))


def arrow_column(values: npt.NDArray[Any]) -> pa.Array:
    """Return a column with the values (n,), which are numbers, booleans or texts."""
    if values.dtype.kind == "U":
        return pa.array(values.tolist(), type=pa.string())
    # Arrow holds booleans as bits, the lowest first.
    stored = np.packbits(values, bitorder="little") if values.dtype.kind == "b" else values
    buffers = [None, pa.py_buffer(np.ascontiguousarray(stored))]
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), buffers)


def component_rows(columns: pa.RecordBatch, order: Literal["C", "F"] = "C") -> npt.NDArray[Any]:
    """Return (n_columns, n) values of columns of one type, in this order in memory.

    Texts are objects.

    Raises:
        ValueError: a value is missing.
    """
    if any(column.null_count for column in columns.columns):
        raise ValueError("a value of a column is missing")
    kind = columns.schema.field(0).type if columns.num_columns else pa.string()
    if pa.types.is_integer(kind) or pa.types.is_floating(kind):
        numbers: npt.NDArray[Any] = columns.to_tensor(row_major=order == "F").to_numpy().T
        return numbers
    memory_type = bool if pa.types.is_boolean(kind) else object
    rows = np.empty((columns.num_columns, columns.num_rows), memory_type, order=order)
    for row, column in zip(rows, columns.columns, strict=True):
        row[:] = column.to_pylist()
    return rows
