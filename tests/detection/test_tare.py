import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.detection import Tare


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (0.5, Tare("seconds", 0.5)),
        (1, Tare("seconds", 1.0)),
        ("0.5", Tare("seconds", 0.5)),
        ("first", Tare("first")),
        ("none", Tare("none")),
        ("1:2.5", Tare("interval", interval=(1.0, 2.5))),
        ("-1:2", Tare("interval", interval=(-1.0, 2.0))),
        ((1, 2), Tare("interval", interval=(1.0, 2.0))),
        (Tare("first"), Tare("first")),
    ],
)
def test_forms(given, expected):
    assert Tare.parse(given) == expected


@pytest.mark.parametrize(
    "given",
    ["", "last", "0", 0, -1.0, "nan", "inf", float("nan"), "2:1", "1:1", "1:", ":", "0:inf",
     "1:2:3", (1,), (1, 2, 3), (2, 1), None],
)  # fmt: skip
def test_refusals(given):
    with pytest.raises(ValueError, match=re.escape(repr(given))):
        Tare.parse(given)


@pytest.mark.parametrize("text", ["0.5", "1", "0.123456789", "first", "none", "1:2", "0.5:1.25"])
def test_text_is_as_short_as_given(text):
    assert str(Tare.parse(text)) == text


numbers = st.floats(1e-6, 1e10)


@given(st.one_of(numbers, st.tuples(numbers, numbers).filter(lambda pair: pair[0] < pair[1])))
def test_text_is_read_as_the_same(given):
    assert Tare.parse(str(Tare.parse(given))) == Tare.parse(given)


def test_only_seconds_are_without_contact():
    given = [0.5, "first", "none", "1:2"]
    assert [Tare.parse(g).without_contact for g in given] == [True, False, False, False]
