"""What verbs say and print: results to stdout, all talk to stderr."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    pass

T = TypeVar("T")


def say(text: str) -> None:
    """Tells a person something, on stderr."""
    sys.stderr.write(f"{text}\n")


def complain(text: str) -> None:
    """Tells on stderr, in one line, why there is no result."""
    say(f"holdfast: {' '.join(text.split())}")


def show(text: str = "") -> None:
    """Prints a line of a result for a person, on stdout."""
    sys.stdout.write(f"{text}\n")


def print_json(value: object) -> None:
    """Prints `value` as one line of JSON on stdout; what is not finite becomes null.

    NumPy values, mappings and paths are taken as what they hold.

    Example:
        >>> print_json({"rate": 150.0, "delay": float("nan")})
        {"rate":150.0,"delay":null}
    """
    from msgspec import json

    sys.stdout.write(json.encode(value, enc_hook=_plain).decode() + "\n")


def print_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Prints rows in aligned columns on stdout; numbers stand to the right.

    Example:
        >>> print_table(("sensor", "taxels"), [("gtac", 15), ("anyskin", 5)])
        sensor   taxels
        gtac         15
        anyskin       5
    """
    lines = [[str(cell) for cell in row] for row in (header, *rows)]
    columns = [_aligned(column) for column in zip(*lines, strict=True)]
    for cells in zip(*columns, strict=True):
        show("  ".join(cells).rstrip())


def _aligned(column: Sequence[str]) -> list[str]:
    width = max(len(cell) for cell in column)
    if all(_is_number(cell) for cell in column[1:]):
        return [cell.rjust(width) for cell in column]
    return [cell.ljust(width) for cell in column]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text in ("", "-")
    return True


def _plain(value: object) -> object:
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "__fspath__"):
        return str(value)
    raise TypeError(f"{type(value).__name__} is no JSON value")
