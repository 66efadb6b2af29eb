import re

import pytest

from holdfast.io.definitions import MessageField, field_paths, parse_definition


def nested(n_fields, depth):
    """Return a definition of messages inside messages, each with fields of the next type."""
    names = [f"p/L{k}" for k in range(depth)]
    blocks = ["\n".join(f"L{k + 1} x{n}" for n in range(n_fields)) for k in range(depth - 1)]
    texts = [
        f"MSG: {name}\n{block}" for name, block in zip(names, [*blocks, "int8 x"], strict=True)
    ]
    return "L0 x\n====\n" + "\n====\n".join(texts)


def test_definitions():
    fields = "Header header\nint8[<=3] some # many\nstring<=9 name 'x'\n"
    text = fields + "=====\nMSG: std_msgs/Header\ntime stamp\n"
    definition = parse_definition("p/msg/A", text)
    assert definition.name == "p/A"
    assert definition.fields == (
        MessageField("header", "std_msgs/Header"),
        MessageField("some", "int8", 0),
        MessageField("name", "string"),
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("uint8", "p/A: 'uint8' is no field of a message"),
        ("wstring x", "p/A: a field is of wstring, which is not defined"),
        ("A x", "p/A holds itself"),
        ("B[] x\n===\nMSG: p/B\nA[] y", "p/A holds itself"),
        ("int8[" + "9" * 5000 + "] x", "Exceeds the limit"),
    ],
)
def test_bad_definitions(text, expected):
    with pytest.raises(ValueError, match=re.escape(expected)):
        parse_definition("p/A", text)


def test_shared_types_are_visited_once():
    """Without a memory this takes 4 to the power of the depth steps, in each of two places."""
    definition = parse_definition("p/A", nested(4, 6))
    assert definition.sizes["p/A"] == 4**5
    assert len(field_paths(definition)) == 4**5


def test_the_sizes_are_those_of_the_shortest_messages():
    text = "string s\nfloat64[3] a\nuint16[] b\nB[2] c\ntime t\n===\nMSG: p/B\nbool x\nint32 y"
    assert parse_definition("p/A", text).sizes == {"p/A": 4 + 24 + 4 + 10 + 8, "p/B": 5, "time": 8}
