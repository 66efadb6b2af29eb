"""Names that say finger, taxel and axis, and those that say something else."""

import hypothesis.strategies as st
import pytest
from hypothesis import given

from holdfast.errors import RecordingError
from holdfast.io.importers.names import (
    are_fingers,
    module_names,
    named_groups,
    run_of,
)


def header(form, n=3, modules=("",), first=0):
    """Names of all taxel columns of a form with {module}, {taxel} and {axis}."""
    return [
        form.format(module=module, taxel=k + first, axis=axis)
        for module in modules
        for k in range(n)
        for axis in "xyz"
    ]


def groups_of(names, *n_taxels):
    groups = named_groups(names, n_taxels)
    return dict(zip(module_names(list(groups)), groups.values(), strict=True))


# The table of docs/importing.md.
FORMS = [
    "t{taxel}_{axis}", "s{taxel}.{axis}", "F{axis}{taxel}", "p{taxel}-{axis}", "mag_{axis}{taxel}",
    "{taxel} {axis}", "²{axis}{taxel}", "B{axis}{taxel} [uT]", "p{taxel}_f{axis}_N",
    "0-2-NxN-{axis}[{taxel}]", "S{taxel}{axis}",
]  # fmt: skip


@given(first=st.integers(0, 1), n=st.integers(2, 30), form=st.sampled_from(FORMS))
def test_every_taxel_and_axis_is_found(first, n, form):
    names = ["time", *header(form, n, first=first), "note"]
    (cells,) = groups_of(names, n).values()
    assert [cells[k + 1, axis] for k in range(n) for axis in "xyz"] == names[1:-1]


MODULES = [
    ("{module}_{taxel}_{axis}", ("thumb", "index"), ["thumb", "index"]),
    ("f{module}_t{taxel}{axis}", ("1", "2", "3"), ["f1", "f2", "f3"]),
    ("B{module}S{taxel}{axis}", ("0", "1"), ["B0", "B1"]),
    ("{module}.t{taxel:02d}.{axis}", ("a/1", "b"), ["a/1", "b"]),
]


@pytest.mark.parametrize(("form", "modules", "names"), MODULES)
def test_modules_are_found_by_the_part_that_differs(form, modules, names):
    assert list(groups_of(["t", *header(form, 4, modules)], 4)) == names


def test_the_number_of_taxels_decides_between_two_readings_of_a_name():
    names = ["t", *header("f{taxel}_{axis}", 2, first=1)]
    assert list(groups_of(names, 1)) == ["f1", "f2"]
    assert list(groups_of(names, 2)) == [""]


@pytest.mark.parametrize("names", [("thumb", "index"), ("a1", "a2"), ("left", "right"), ("0", "1")])
def test_names_of_fingers(names):
    assert are_fingers(names)


@pytest.mark.parametrize(
    "names", [("d", "f"), ("A", "G"), ("force", "displacement"), ("raw", "lp")]
)
def test_other_words_may_be_other_quantities(names):
    assert not are_fingers(names)


def test_a_column_that_is_missing_is_named():
    names = header("f{taxel}_{axis}", 16, first=1)
    names.remove("f16_z")
    with pytest.raises(RecordingError, match="'f16_z' is missing"):
        named_groups(names, {16})


def test_one_taxel_in_two_columns():
    with pytest.raises(RecordingError, match="'t1_x' and 't01_x'"):
        named_groups(("t1_x", "t01_x", "t1_y", "t1_z"), {1})


@pytest.mark.parametrize(("text", "message"), [("a..e", "no column 'e'"), ("c..a", "0 columns")])
def test_runs_that_the_file_does_not_have(text, message):
    with pytest.raises(RecordingError, match=message):
        run_of(text, ("t", "a", "b", "c", "d"))
