import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest

from holdfast.io.arrow_arrays import arrow_column, arrow_type, component_rows

NO_PANDAS = """
import sys
from holdfast.io import load_recording, save_recording
from holdfast.synthetic import synthetic_recording
save_recording(synthetic_recording("a", 0, ("thumb",)), sys.argv[1])
load_recording(sys.argv[1])
assert "pandas" not in sys.modules
"""


@pytest.mark.parametrize("number", ["uint8", "int16", "uint16", "int64", "float32", "float64"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_numbers_come_back_in_the_order_of_memory_that_is_asked_for(number, order):
    values = np.arange(12).reshape(3, 4).astype(number)
    batch = pa.RecordBatch.from_arrays([arrow_column(row) for row in values], names=[""] * 3)
    rows = component_rows(batch, order)
    np.testing.assert_array_equal(rows, values)
    assert rows.dtype == number
    assert rows.flags[f"{order}_CONTIGUOUS"]


@pytest.mark.parametrize(
    "values",
    [
        np.array([np.nan, np.inf, -0.0]),
        np.arange(20) % 3 == 0,
        np.array(["a", "", "ä"]),
        np.arange(10.0)[::2],
        np.empty(0),
        np.empty(0, dtype=bool),
    ],
)
def test_a_column_is_the_one_that_pyarrow_makes(values):
    column = arrow_column(values)
    expected = pa.array(values)
    assert (
        column.type
        == expected.type
        == arrow_type("str" if values.dtype.kind == "U" else values.dtype.name)
    )
    assert str(column) == str(expected)
    assert column.null_count == 0
    rows = component_rows(pa.RecordBatch.from_arrays([column], names=[""]))
    np.testing.assert_array_equal(rows[0], values)


def test_a_missing_value_is_an_error():
    batch = pa.RecordBatch.from_arrays([pa.array([1, None])], names=["a"])
    with pytest.raises(ValueError, match="missing"):
        component_rows(batch)


def test_no_columns_have_no_rows():
    assert component_rows(pa.RecordBatch.from_arrays([], names=[])).shape == (0, 0)


def test_recordings_are_written_and_read_without_pandas(tmp_path):
    words = [sys.executable, "-c", NO_PANDAS, str(tmp_path / "a.parquet")]
    subprocess.run(words, check=True, timeout=120)
