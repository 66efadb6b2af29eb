"""Counts of XELA packets, parsed in C, against the parser in Python."""

import json

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.devices.sources.xela.packet import Counts, InvalidPacket, PlainCounts, read_sensor
from holdfast.kernel import _extension


def parsed(data, integer="null"):
    found = _extension.parse_counts(data.encode(), integer.encode())
    return None if found is None else np.frombuffer(found, np.uint16).tolist()


@pytest.mark.parametrize(
    ("data", "integer"),
    [
        ('"0000,fFfF,8Ca0"', "[0,65535,36000]"),
        ('"0000,fFfF,8Ca0"', "[0, 65535 ,  36000 ]"),
        ('"0000,fFfF,8Ca0"', "null"),
    ],
)
def test_usual_forms(data, integer):
    assert parsed(data, integer) == [0, 65535, 36000]


@pytest.mark.parametrize(
    "data",
    ["null", '""', '"0"', '"000"', '"0001,"', '"0001,002"', '"0001;0002"', '"000g"', '"-001"']
    + ['"0001, 002"', '"+001,0002"', '"00\\u0030\\u0031"', "12345678901", "[0001]", "\"0001',"]
    + [f'"{character}001"' for character in "/:@G`g\x7f"],
)
def test_other_strings_are_left_to_python(data):
    assert parsed(data) is None


@pytest.mark.parametrize(
    "integer",
    [
        *("[]", "[1]", "[1,3]", "[1,2,3]", "[1,2.0]", "[1,2e0]", "[1,-2]", "[1,65538]"),
        *("", "[", "]", "[ ", "[1,2", "[1,2 ", "[1,000002]", "[1,2]]", "[1,2,]"),
        *("[1,true]", "[1,[2]]", '"12"', "2", "{}", "[1\t,2]", "[1,18446744073709551618]"),
    ],
)
def test_other_lists_are_left_to_python(integer):
    assert parsed('"0001,0002"', integer) is None


@given(
    counts=st.lists(st.integers(0, 65535), min_size=3, max_size=9),
    place=st.integers(0, 60),
    character=st.sampled_from('0123456789abcdefABCDEFg", []-+.\\x'),
)
def test_what_it_reads_is_what_python_reads(counts, place, character):
    """One character is replaced: the parser in C reads the same values, or none."""
    counts = counts[: len(counts) // 3 * 3]
    text = json.dumps({"data": ",".join(f"{count:04X}" for count in counts), "integer": counts})
    text = text[:place] + character + text[place + 1 :]
    try:
        expected = msgspec.json.decode(text, type=Counts).readings()
    except (msgspec.DecodeError, InvalidPacket):
        expected = None
    try:
        found = read_sensor(msgspec.Raw(text.encode()), calibrated=False).readings()
    except InvalidPacket:
        found = None
    assert (found is None) == (expected is None)
    assert found is None or found.tolist() == expected.tolist()


def test_a_usual_sensor_is_parsed_in_c():
    raw = msgspec.Raw(b'{"data": "0001,0002,0003", "integer": [1, 2, 3], "taxels": 1}')
    part = read_sensor(raw, calibrated=False)
    assert isinstance(part, PlainCounts)
    assert (part.taxels, part.readings().tolist()) == (1, [[1, 2, 3]])


@pytest.mark.parametrize("given", [(), (b"",), ("text", b"null"), (b'"0001"', None)])
def test_refuses_other_arguments(given):
    with pytest.raises(TypeError):
        _extension.parse_counts(*given)
