import re

import pytest

from holdfast.ros.definitions import Field, parse_definition


def test_definitions():
    fields = "Header header\nint8[<=3] some # many\nstring<=9 name 'x'\n"
    text = fields + "=====\nMSG: std_msgs/Header\ntime stamp\n"
    definition = parse_definition("p/msg/A", text)
    assert definition.name == "p/A"
    assert definition.fields == (
        Field("header", "std_msgs/Header"),
        Field("some", "int8", 0),
        Field("name", "string"),
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("uint8", "p/A: 'uint8' is no field of a message"),
        ("wstring x", "p/A: a field is of wstring, which is not defined"),
        ("A x", "p/A holds itself, or is nested too deep"),
        ("B[] x\n===\nMSG: p/B\nA[] y", "p/A holds itself, or is nested too deep"),
    ],
)
def test_bad_definitions(text, expected):
    with pytest.raises(ValueError, match=re.escape(expected)):
        parse_definition("p/A", text)
