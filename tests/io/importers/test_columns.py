"""The text of a layout, and the units that are converted."""

import pytest

from holdfast.errors import RecordingError
from holdfast.io.importers.columns import Columns, unit_factor
from holdfast.sensors import flat_sensor, sensor


def test_a_layout_is_read_back_from_its_text():
    text = "time=stamp:ms,taxels=a..c,module=id,missing=65535,wrap=65536"
    columns = Columns.parse(text, "4,5,-1", "mN")
    assert (columns.time_unit, columns.axes, columns.unit) == ("ms", (4, 5, -1), "mN")
    assert Columns.parse(str(columns), "4,5,-1", "mN") == columns
    assert Columns.parse(None) == Columns()


def test_a_rate_in_place_of_times():
    assert Columns.parse("time=62.5Hz,taxels=a..c").rate == 62.5
    assert Columns.parse("time=stamp").rate is None


BAD = [
    *(((text,), "--columns: time=COLUMN") for text in ("time", "time=", "when=t", "x=y=z")),
    (("time=a,time=b",), "'time=b' given"),
    (("missing=two",), "missing=NUMBER"),
    (("taxels=F{axis}{taxel}",), "taxels=FIRST..LAST"),
    (("decimal=;",), "decimal=comma or point"),
    *((("time=t", axes), "--axes: the numbers") for axes in ("1,2", "1,1,3", "0,1,2", "x,y,z")),
    (("time=t", None, "kg"), "'kg' given"),
]


@pytest.mark.parametrize(("texts", "message"), BAD)
def test_a_text_of_another_form(texts, message):
    with pytest.raises(ValueError, match=message):
        Columns.parse(*texts)


SKIN, PAD = sensor("anyskin"), flat_sensor("pad", 1, 1, 0.001, unit="N")


@pytest.mark.parametrize(
    ("unit", "skin", "is_given", "factor", "kept"),
    [
        ("mN", PAD, False, 1e-3, "N"),
        ("g", PAD, True, 9.80665e-3, "N"),
        ("uT", SKIN, False, 1, "count"),
        ("mT", SKIN, False, 1000, "count"),
        ("N", SKIN, True, 1, "N"),
    ],
)
def test_units(unit, skin, is_given, factor, kept):
    assert unit_factor(unit, skin, is_given=is_given) == (pytest.approx(factor), kept)


@pytest.mark.parametrize(
    ("unit", "skin", "is_given"), [("mm", PAD, False), ("count", PAD, True), ("N", SKIN, False)]
)
def test_a_unit_that_cannot_be_converted(unit, skin, is_given):
    with pytest.raises(RecordingError, match=f"readings in {unit} given; .* expected"):
        unit_factor(unit, skin, is_given=is_given)
