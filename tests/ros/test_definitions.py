import re
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.ros.definitions import Decoder, Field, parse_definition

pytest.importorskip("rosbags", reason="rosbags is not installed")

from sources.ros_build import INNER, OUTER, message_of, plain, store, values


@pytest.fixture(scope="module", params=[False, True], ids=["ros1", "ros2"])
def wire(request):
    """rosbags' way to write messages, and ours to read them."""
    ros2 = request.param
    types = store("p", {"Outer": OUTER, "Inner": INNER}, ros2=ros2)
    text, _ = types.generate_msgdef("p/msg/Outer", ros_version=2 if ros2 else 1)
    write = types.serialize_cdr if ros2 else types.serialize_ros1
    decode = Decoder(parse_definition("p/msg/Outer", text), ros2=ros2)
    return lambda given: bytes(write(message_of(types, given), "p/msg/Outer")), decode


@given(values())
@settings(deadline=None)
def test_any_message_that_rosbags_writes_is_read(wire, given):
    write, decode = wire
    assert plain(decode(write(given))) == given


@given(values(), st.data())
@settings(deadline=None)
def test_a_cut_or_longer_message_is_refused(wire, given, data):
    write, decode = wire
    whole = write(given)
    cut = data.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(ValueError, match=r"cut|left|CDR|UTF-8"):
        decode(whole[:cut])
    with pytest.raises(ValueError, match="bytes too many"):
        decode(whole + bytes(4))


@given(st.binary(max_size=200))
@settings(deadline=None)
def test_garbage_is_refused_or_read_but_nothing_else(wire, given):
    _, decode = wire
    with suppress(ValueError):
        decode(given)


def test_cdr_of_either_byte_order():
    types = store("p", {"Outer": OUTER, "Inner": INNER}, ros2=True)
    decode = Decoder(parse_definition("p/Inner", INNER), ros2=True)
    message = types.types["p/msg/Inner"](True, "ö", np.array([0.5, -2.0]))
    for little in (True, False):
        data = types.serialize_cdr(message, "p/msg/Inner", little_endian=little)
        assert plain(decode(bytes(data))) == {"flag": 1, "name": "ö", "pair": [0.5, -2.0]}


def test_a_length_that_lies_takes_no_memory():
    decode = Decoder(parse_definition("p/A", "B[] b\n====\nMSG: p/B\n"), ros2=False)
    with pytest.raises(ValueError, match="b: 4294967295 given, 0 bytes left"):
        decode(b"\xff" * 4)
    decode = Decoder(parse_definition("p/A", "float64[] b"), ros2=False)
    with pytest.raises(ValueError, match="cut: 4294967295 float64 expected, 3 bytes left"):
        decode(b"\xff" * 7)


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
    ("text", "told"),
    [
        ("uint8", "p/A: 'uint8' is no field of a message"),
        ("wstring x", "p/A: a field is of wstring, which is not defined"),
        ("A x", "p/A holds itself, or is nested too deep"),
        ("B[] x\n===\nMSG: p/B\nA[] y", "p/A holds itself, or is nested too deep"),
    ],
)
def test_bad_definitions(text, told):
    with pytest.raises(ValueError, match=re.escape(told)):
        parse_definition("p/A", text)
