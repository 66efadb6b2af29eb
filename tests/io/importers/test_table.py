import csv
from pathlib import Path

import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io.importers.table import Table, natural_order, read_table, with_integer_type


def test_numbers_text_comments_and_holes(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("\ufeff# by hand\r\na,ü,b\r\n1,x,\r\nnan,,2.5e3\r\n".encode())
    table, cells = read_table(path, ["ü"])
    assert (table.names, table.comments, table.first_line) == (("a", "ü", "b"), ("by hand",), 3)
    np.testing.assert_array_equal(table.columns(["b", "a"]), [[np.nan, 1], [2500, np.nan]])
    assert cells == {"ü": ["x", ""]}


@pytest.mark.parametrize(
    ("values", "number"),
    [
        ([0.0, 65535.0], "uint16"),
        ([-1.0, 70000.0], "int32"),
        ([0.5, 1.0], "float64"),
        ([np.nan, 1.0], "float64"),
        ([0.0, 1e12], "float64"),
    ],
)
def test_whole_numbers_become_counts(values, number):
    got = with_integer_type(np.array(values))
    assert got.dtype == number
    np.testing.assert_array_equal(got, values)


def test_names_sort_as_a_person_would():
    ordered = ["5", "5²3.csv", "5²20.csv", "7" * 5000, "Exp1", "Exp2", "Exp10", "Exp²1"]
    paths = [Path(name) for name in ordered[::-1]]
    assert [p.name for p in sorted(paths, key=natural_order)] == ordered


@pytest.mark.parametrize(
    ("raw", "text", "named"),
    [
        (b"\xff\xfe\x00", (), "is not CSV"),
        (b"a,b\n1,\xff\n", (), "row 2, column 'b'"),
        (b"a,b\n1,\xff\x00\n", ["b"], "byte 0xff"),
    ],
)
def test_files_that_are_not_text(tmp_path, raw, text, named):
    path = tmp_path / "a.csv"
    path.write_bytes(raw)
    with pytest.raises(RecordingError, match=named):
        read_table(path, text)


class CountedName(str):
    """Name of a column that counts how often it is compared with another one."""

    n_compared = 0
    __slots__ = ()

    def __eq__(self, other):
        CountedName.n_compared += 1
        return str.__eq__(self, other)

    __hash__ = str.__hash__


def test_the_columns_of_a_wide_table_are_found_in_linear_time():
    names = tuple(CountedName(f"t{k}_x") for k in range(2000))
    table = Table(Path("a.csv"), names, np.arange(2000.0)[None], 2, ())
    assert table.columns([str(name) for name in names]).tolist() == [list(range(2000))]
    assert CountedName.n_compared < 20_000


def test_the_first_of_two_columns_with_one_name_is_used():
    table = Table(Path("a.csv"), ("a", "a"), np.array([[1.0, 2.0]]), 2, ())
    assert table.columns(["a"]).tolist() == [[1.0]]


class TestLongCells:
    """Cells that the csv module alone refuses, or that need larger blocks of pyarrow."""

    @pytest.mark.parametrize("n", [131_073, 600_000, 1 << 20])
    def test_text(self, tmp_path, n):
        path = tmp_path / "a.csv"
        path.write_text(f"a,note\n1,{'x' * n}\n2,y\n3,{'z' * n}\n")
        table, cells = read_table(path, ["note"])
        assert table.values[:, 0].tolist() == [1, 2, 3]
        assert [len(cell) for cell in cells["note"]] == [n, 1, n]

    @pytest.mark.parametrize("cell", ["x" * 200_000, "9" * 140_000 + "a"])
    def test_a_long_cell_that_is_no_number(self, tmp_path, cell):
        path = tmp_path / "a.csv"
        path.write_text(f"a,b\n1,2\n3,{cell}\n")
        with pytest.raises(RecordingError, match=rf"row 3, column 'b': '.{{40}}'.*{len(cell)}"):
            read_table(path)

    @pytest.mark.parametrize("text", [["note"], []])
    def test_too_long(self, tmp_path, text):
        path = tmp_path / "a.csv"
        path.write_text(f"a,note\n1,{'x' * ((1 << 20) + 1)}\n")
        with pytest.raises(RecordingError, match=r"a\.csv.* 10485\d\d"):
            read_table(path, text)

    def test_the_limit_of_other_programs_stays(self, tmp_path):
        before = csv.field_size_limit()
        path = tmp_path / "a.csv"
        path.write_text("a\n1\n")
        read_table(path)
        assert csv.field_size_limit() == before


@pytest.mark.parametrize("decimals", [0, 6, 17])
def test_numbers_equal_those_of_another_reader(tmp_path, decimals):
    from pyarrow import csv as other

    generator = np.random.default_rng(decimals)
    numbers = generator.normal(size=(200, 7)) * 10.0 ** generator.integers(-20, 20, size=(200, 7))
    np.savetxt(tmp_path / "a.csv", numbers, f"%.{decimals}e", ",", header="a,b,c,d,e,f,g")
    (tmp_path / "a.csv").write_text((tmp_path / "a.csv").read_text().replace("# ", "", 1))
    expected = other.read_csv(tmp_path / "a.csv").to_pandas().to_numpy()
    np.testing.assert_array_equal(read_table(tmp_path / "a.csv")[0].values, expected)


@pytest.mark.parametrize("cell", ["1_000", "\u0661", '"1\n"', "0x1", "1,5"])
def test_forms_of_numbers_that_only_python_reads(tmp_path, cell):
    (tmp_path / "a.csv").write_text(f"a,b\n1,2\n1,{cell}\n")
    with pytest.raises(RecordingError, match=r"a\.csv, row 3.* given, (a number|2) expected"):
        read_table(tmp_path / "a.csv")
