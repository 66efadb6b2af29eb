"""Print results on stdout, and messages on stderr.

Names come from files, servers and topics of others. Nothing that is printed here can control the
terminal or begin a line: characters that are not printable are shown as escapes.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence

MAX_ERROR_LENGTH = 2000
"""Number of characters of an error message that are printed."""


def visible(text: str) -> str:
    r"""Return a text in one line, with every character that is not printable as an escape.

    Example:
        >>> visible("Möhre"), visible("\x1b[2Jcan\n\u202e")
        ('Möhre', '\\x1b[2Jcan\\n\\u202e')
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def visible_json(text: str) -> str:
    """Return JSON with every character that is not printable as an escape of JSON.

    JSON itself escapes only the first 32 characters, and terminals have further control characters.
    """
    if text.isascii() and "\x7f" not in text:
        return text
    return "".join(c if c.isprintable() or c == "\n" else _json_escape(c) for c in text)


def _json_escape(character: str) -> str:
    units = character.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[place : place + 4]}" for place in range(0, len(units), 4))


def print_message(text: str) -> None:
    """Print a message for a person on stderr, in one line."""
    sys.stderr.write(f"{visible(text)}\n")


def print_error(text: str) -> None:
    """Print an error message on stderr, in one line."""
    line = " ".join(text.split())
    if len(line) > MAX_ERROR_LENGTH:
        line = f"{line[:MAX_ERROR_LENGTH]}..."
    print_message(f"holdfast: {line}")


def print_line(text: str = "") -> None:
    """Print a line of a result on stdout."""
    sys.stdout.write(f"{visible(text)}\n")


def print_lines(lines: Iterable[str]) -> None:
    """Print lines of a result on stdout."""
    for line in lines:
        print_line(line)


def print_json(value: object) -> None:
    """Print a value as one line of JSON on stdout; numbers that are not finite become null.

    NumPy values, mappings and paths are converted.

    Example:
        >>> print_json({"rate": 150.0, "delay": float("nan")})
        {"rate":150.0,"delay":null}
    """
    from msgspec import json

    text = json.encode(value, enc_hook=_to_json_value).decode()
    sys.stdout.write(f"{visible_json(text)}\n")


def print_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print rows in aligned columns on stdout; columns of numbers are aligned right.

    Example:
        >>> print_table(("sensor", "taxels"), [("gtac", 15), ("anyskin", 5)])
        sensor   taxels
        gtac         15
        anyskin       5
    """
    lines = [[visible(str(cell)) for cell in row] for row in (header, *rows)]
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
