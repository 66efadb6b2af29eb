"""Damage to bytes and to JSON documents, drawn from a random generator."""

import copy
import json
from random import Random
from typing import Any

MAX_SPAN = 64
"""Longest span of bytes that is deleted, repeated or set to zero."""
DEEP = "[" * 50_000 + "]" * 50_000
"""Text of a list in lists."""

ODD_VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 1, 2**31, 2**63, 2**90, 10**400, 1e308, -1e308, 5e-324, 0.5,
    "", "x", "\x1b[2J", "../../x", "NaN", "object", "x" * 10_000, [], {}, [[]], [0] * 1000,
    {"a": 1}, [[1, 2], [3]], "DEEP",
)  # fmt: skip


def damaged(data: bytes, chance: Random) -> bytes:
    """Return bytes with one damage: flipped bits, other bytes, or a span lost, zero or twice."""
    if not data:
        return b"\x00"
    found = bytearray(data)
    place = chance.randrange(len(found))
    span = slice(place, place + chance.randint(1, MAX_SPAN))
    match chance.randrange(8):
        case 0 | 1 | 2:
            found[place] ^= 1 << chance.randrange(8)
        case 3:
            for _ in range(chance.randint(2, 8)):
                found[chance.randrange(len(found))] ^= 1 << chance.randrange(8)
        case 4:
            found[place] = chance.choice((0, 1, 0x7F, 0x80, 0xFF))
        case 5:
            del found[span]
        case 6:
            found[place:place] = found[span]
        case 7:
            found[span] = bytes(len(found[span]))
    return bytes(found)


def cut(data: bytes, chance: Random) -> bytes:
    """Return the beginning of the bytes."""
    return data[: chance.randrange(len(data))]


def flipped(data: bytes, chance: Random) -> bytes:
    """Return the bytes with one bit flipped."""
    found = bytearray(data)
    found[chance.randrange(len(found))] ^= 1 << chance.randrange(8)
    return bytes(found)


def lying(document: Any, chance: Random) -> Any:
    """Return a JSON document with one value that is odd, missing, twice or under another key."""
    found = copy.deepcopy(document)
    places = list(_places(found))
    container, key = chance.choice(places)
    match chance.randrange(4):
        case 0 | 1:
            container[key] = copy.deepcopy(chance.choice(ODD_VALUES))
        case 2:
            del container[key]
        case 3 if isinstance(container, list):
            container.append(copy.deepcopy(container[key]))
        case 3:
            container[chance.choice(("", "x", "\u202e", "schema"))] = container[key]
    return found


def encoded(document: Any) -> bytes:
    """Encode a document as JSON; the text DEEP becomes a list in lists."""
    return json.dumps(document).replace('"DEEP"', DEEP).encode()


def _places(node: Any) -> Any:
    keys = list(node) if isinstance(node, dict) else range(len(node))
    for key in keys:
        yield node, key
        if isinstance(node[key], dict | list):
            yield from _places(node[key])
