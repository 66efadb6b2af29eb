import struct

import numpy as np
import pytest
from hypothesis import given, settings

from holdfast.ros.definitions import Decoder, parse_definition
from holdfast.ros.encoder import Encoder

pytest.importorskip("rosbags", reason="rosbags is not installed")

from sources.ros_build import INNER, OUTER, message_of, plain, store, values


@pytest.fixture(scope="module")
def both():
    """rosbags' way to write messages, ours, and ours to read them."""
    types = store("p", {"Outer": OUTER, "Inner": INNER}, ros2=True)
    definition = parse_definition("p/Outer", types.generate_msgdef("p/msg/Outer", ros_version=2)[0])

    def theirs(given):
        return bytes(types.serialize_cdr(message_of(types, given), "p/msg/Outer"))

    return theirs, Encoder(definition), Decoder(definition, ros2=True)


@given(values())
@settings(deadline=None)
def test_the_bytes_are_those_that_rosbags_writes(both, given):
    theirs, ours, decode = both
    assert plain(decode(ours(given))) == given
    assert ours(given) == theirs(given)


def test_values_that_do_not_fit():
    encode = Encoder(parse_definition("p/A", "uint8[2] pair"))
    assert encode({"pair": np.array([1, 2])})[4:] == b"\x01\x02"
    with pytest.raises(ValueError, match="pair: 2 values expected, 3 given"):
        encode({"pair": [1, 2, 3]})
    with pytest.raises(struct.error):
        encode({"pair": [1, 256]})
    with pytest.raises(KeyError):
        encode({})
