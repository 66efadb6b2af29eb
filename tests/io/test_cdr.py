from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.io.cdr import MessageDecoder, MessageEncoder
from holdfast.io.definitions import parse_definition

pytest.importorskip("rosbags", reason="rosbags is not installed")

from ros_messages import INNER, OUTER, message_of, plain, store, values


@pytest.fixture(scope="module", params=[False, True], ids=["ros1", "ros2"])
def wire(request):
    """rosbags' way to write messages, and ours to read them."""
    ros2 = request.param
    types = store("p", {"Outer": OUTER, "Inner": INNER}, ros2=ros2)
    text, _ = types.generate_msgdef("p/msg/Outer", ros_version=2 if ros2 else 1)
    write = types.serialize_cdr if ros2 else types.serialize_ros1
    decode = MessageDecoder(parse_definition("p/msg/Outer", text), ros2=ros2)
    return lambda given: bytes(write(message_of(types, given), "p/msg/Outer")), decode


@given(values())
def test_any_message_that_rosbags_writes_is_read(wire, given):
    write, decode = wire
    assert plain(decode(write(given))) == given


@given(values(), st.data())
def test_a_cut_or_longer_message_is_refused(wire, given, data):
    write, decode = wire
    whole = write(given)
    cut = data.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(ValueError, match=r"cut|left|CDR|UTF-8"):
        decode(whole[:cut])
    with pytest.raises(ValueError, match="bytes too many"):
        decode(whole + bytes(4))


@given(st.binary(max_size=200))
def test_garbage_is_refused_or_read_but_nothing_else(wire, given):
    _, decode = wire
    with suppress(ValueError):
        decode(given)


def test_cdr_of_either_byte_order():
    types = store("p", {"Outer": OUTER, "Inner": INNER}, ros2=True)
    decode = MessageDecoder(parse_definition("p/Inner", INNER), ros2=True)
    message = types.types["p/msg/Inner"](True, "ö", np.array([0.5, -2.0]))
    for little in (True, False):
        data = types.serialize_cdr(message, "p/msg/Inner", little_endian=little)
        assert plain(decode(bytes(data))) == {"flag": 1, "name": "ö", "pair": [0.5, -2.0]}


@pytest.mark.parametrize("ros2", [True, False])
@pytest.mark.parametrize(
    ("text", "n", "rest", "message"),
    [
        ("B[] x\n====\nMSG: p/B\nint8 x", 2**32 - 1, 0, "x: 4294967295 given, 0 bytes left"),
        ("float64[] x", 2**32 - 1, 3, "4294967295 float64 expected"),
        # Each element has a minimum size; nothing is created for more of them.
        ("B[] x\n====\nMSG: p/B\nfloat64 y\nstring z", 100, 1100, "x: 100 given, 1100 bytes left"),
    ],
)
def test_a_length_that_lies_takes_no_memory(ros2, text, n, rest, message):
    decode = MessageDecoder(parse_definition("p/A", text), ros2=ros2)
    data = (b"\x00\x01\x00\x00" if ros2 else b"") + n.to_bytes(4, "little") + bytes(rest)
    with pytest.raises(ValueError, match=message):
        decode(data)


@pytest.fixture(scope="module")
def both():
    """rosbags' way to write messages, ours, and ours to read them."""
    types = store("p", {"Outer": OUTER, "Inner": INNER}, ros2=True)
    definition = parse_definition("p/Outer", types.generate_msgdef("p/msg/Outer", ros_version=2)[0])

    def theirs(given):
        return bytes(types.serialize_cdr(message_of(types, given), "p/msg/Outer"))

    return theirs, MessageEncoder(definition), MessageDecoder(definition, ros2=True)


@given(values())
def test_the_bytes_are_those_that_rosbags_writes(both, given):
    theirs, ours, decode = both
    assert plain(decode(ours(given))) == given
    assert ours(given) == theirs(given)
