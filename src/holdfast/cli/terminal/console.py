"""Print results on stdout, and messages on stderr."""

import sys
from collections.abc import Iterable, Mapping, Sequence


def print_message(text: str) -> None:
    """Print a message for a person on stderr."""
    sys.stderr.write(f"{text}\n")


def print_error(text: str) -> None:
    """Print an error message on stderr, in one line."""
    print_message(f"holdfast: {' '.join(text.split())}")


def print_line(text: str = "") -> None:
    """Print a line of a result on stdout."""
    sys.stdout.write(f"{text}\n")


def print_json(value: object) -> None:
    """Print a value as one line of JSON on stdout; numbers that are not finite become null.

    NumPy values, mappings and paths are converted.

    Example:
        >>> print_json({"rate": 150.0, "delay": float("nan")})
        {"rate":150.0,"delay":null}
    """
    from msgspec import json

    sys.stdout.write(json.encode(value, enc_hook=_to_json_value).decode() + "\n")


def print_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print rows in aligned columns on stdout; columns of numbers are aligned right.

    Example:
        >>> print_table(("sensor", "taxels"), [("gtac", 15), ("anyskin", 5)])
        sensor   taxels
        gtac         15
        anyskin       5
    """
    lines = [[str(cell) for cell in row] for row in (header, *rows)]
    columns = [_align(column) for column in zip(*lines, strict=True)]
    for cells in zip(*columns, strict=True):
        print_line("  ".join(cells).rstrip())


def _align(column: Sequence[str]) -> list[str]:
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


def _to_json_value(value: object) -> object:
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "__fspath__"):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
