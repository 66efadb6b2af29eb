import re

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from holdfast.errors import RecordingError
from holdfast.io.importers.csv_columns import Columns
from holdfast.io.importers.csv_times import TIME_UNITS, seconds_of


def header(form, n=3, modules=("",), first=0):
    """Names of all taxel columns of a form with {module}, {taxel} and {axis}."""
    return [
        form.format(module=module, taxel=k + first, axis=axis)
        for module in modules
        for k in range(n)
        for axis in "xyz"
    ]


LONG = ["my_time", "label", *header("{module}_{taxel}_{axis}", modules=("thumb", "index"))]
GUESSES = [
    (["t", *header("t{taxel}_{axis}", first=1)], "time=t,taxels=t{taxel}_{axis}"),
    (["Timestamp (ms)", *header("s{taxel}.{axis}")], "taxels=s{taxel}.{axis}"),
    (["stamp", *header("{axis}{taxel}"), "index"], "time=stamp,taxels={axis}{taxel}"),
    (LONG, "time=my_time,taxels={module}_{taxel}_{axis},label=label"),
    (["t", *header("f{module}_t{taxel}{axis}", 4, modules=(1, 2, 3))], "{module}_t{taxel}{axis}"),
    (["t", "FX", "FY", "FZ"], "time=t,taxels=F{axis}"),
]


@pytest.mark.parametrize(("names", "text"), GUESSES)
def test_a_guess_from_the_header(names, text):
    assert text in str(Columns().completed(names, ()))


def test_the_number_of_taxels_decides_between_two_readings_of_a_header():
    names = ["t", *header("{module}_{taxel}{axis}", 2, modules=(1, 2, 3, 4))]
    assert Columns().completed(names, {2}).taxels.endswith("_{taxel}{axis}")
    assert Columns().completed(names, {4}).taxels == "{taxel}_{module}{axis}"


@given(
    first=st.integers(0, 1),
    n=st.integers(2, 30),
    form=st.sampled_from(
        [
            "F{axis}{taxel}",
            "p{taxel}-{axis}",
            "mag_{axis}{taxel}",
            "{taxel} {axis}",
            "²{axis}{taxel}",
        ]
    ),
)
def test_every_taxel_and_axis_is_found(first, n, form):
    names = ["time", *header(form, n, first=first), "note"]
    (layout,) = Columns().completed(names, ()).layout(names).values()
    assert [layout[k + 1, axis] for k in range(n) for axis in "xyz"] == names[1:-1]


def test_a_guess_is_read_back_from_its_text():
    names = ["t", *header("{module}.{taxel}.{axis}", modules=("a", "b")), "label", "cause"]
    guess = Columns(time_unit="ms").completed(names, ())
    assert Columns.parse(str(guess)) == guess


def test_consecutive_columns():
    names = ["t", *(f"ch{k}" for k in range(6))]
    layout = Columns(taxels="ch0..ch5").layout(names)
    cells = [(taxel, axis) for taxel in (1, 2) for axis in "xyz"]
    assert layout == {"": dict(zip(cells, names[1:], strict=True))}


def test_a_rate_in_place_of_times():
    columns = Columns.parse("time=62.5Hz,taxels=a..c")
    assert columns.rate == 62.5
    assert Columns.parse("time=stamp").rate is None


@pytest.mark.parametrize("unit", TIME_UNITS)
@given(rate=st.floats(6, 4900))
def test_the_unit_of_times_follows_from_the_rate(unit, rate):
    times, found = seconds_of(np.arange(20) / rate / TIME_UNITS[unit], None)
    assert found == unit
    assert times[1] == pytest.approx(1 / rate)


@pytest.mark.parametrize("values", [[], [1.0], [2.0, 2.0], [np.nan, np.nan]])
def test_times_without_steps_are_seconds(values):
    assert seconds_of(np.array(values), None)[1] == "s"


@pytest.mark.parametrize("text", ["", "time", "time=", "when=t", "time=a,time=b", "x=y=z"])
def test_a_text_of_another_form(text):
    with pytest.raises(ValueError, match="--columns: time=COLUMN"):
        Columns.parse(text)


@pytest.mark.parametrize(
    ("names", "text"),
    [(("a", "x1", "y1", "z1"), "no column of times"), (("t", "x1", "y1"), "no taxel columns")],
)
def test_a_header_without_times_or_taxels(names, text):
    with pytest.raises(RecordingError, match=text):
        Columns().completed(names, ())


@pytest.mark.parametrize(
    ("taxels", "text"),
    [
        ("F{taxel}", "F{taxel}: {axis}"),
        ("G{axis}", "'G{axis}'"),
        ("a..e", "no column 'e'"),
        ("a..d", "4 columns"),
        ("c..a", "0 columns"),
    ],
)
def test_taxels_that_the_file_does_not_have(taxels, text):
    with pytest.raises(RecordingError, match=re.escape(text)):
        Columns(taxels=taxels).layout(("t", "a", "b", "c", "d"))
