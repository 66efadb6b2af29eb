"""Print results on stdout, and messages on stderr.

Names come from files, servers and topics of others. Nothing that is printed here can control the
terminal or begin a line: characters that are not printable are shown as escapes.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from shutil import get_terminal_size
from textwrap import wrap
from threading import Timer

MAX_ERROR_LENGTH = 2000
"""Number of characters of an error message that are printed."""
SILENCE = 0.6
"""Time after which a command that has printed nothing says that it works [s]."""
SLOW_AFTER = 0.3
"""Time that a wait may last before a message says what for [s]."""
MIN_TEXT_WIDTH = 12
"""Width to which a column of text can shrink, if its longest cell is wider."""
_GAP = "  "


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
    if text.isascii() and "\x7f" not in text:  # nothing to escape, as in nearly all texts
        return text
    return "".join(c if c.isprintable() or c == "\n" else _json_escape(c) for c in text)


def _json_escape(character: str) -> str:
    # Escapes of JSON are units of UTF-16; file names that are not UTF-8 have lone surrogates.
    units = character.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[k : k + 4]}" for k in range(0, len(units), 4))


_silence: Timer | None = None
"""Running while the command of this process has printed nothing; see `break_silence`."""


@contextmanager
def break_silence(text: str) -> Iterator[None]:
    """Print a message on a terminal if the body has printed nothing for `SILENCE`."""
    global _silence  # noqa: PLW0603 (one command runs in a process)
    if sys.stderr.isatty():
        _silence = Timer(SILENCE, print_message, (text,))
        _silence.daemon = True
        _silence.start()
    try:
        yield
    finally:
        end_silence()


def end_silence() -> None:
    """Note that the command prints something now."""
    global _silence  # noqa: PLW0603
    if _silence is not None:
        _silence.cancel()
        _silence = None


def print_message(text: str) -> None:
    """Print a message for a person on stderr, in one line."""
    end_silence()
    sys.stderr.write(f"{visible(text)}\n")


@contextmanager
def message_if_slow(text: str, after: float = SLOW_AFTER) -> Iterator[None]:
    """Print a message if the body takes longer than `after` [s]; an empty message never."""
    timer = Timer(after, print_message, (text,))
    # A process that ends while it waits does not wait for the timer.
    timer.daemon = True
    if text:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


def print_error(text: str) -> None:
    """Print an error message on stderr, in one line."""
    line = " ".join(text.split())
    if len(line) > MAX_ERROR_LENGTH:
        line = f"{line[:MAX_ERROR_LENGTH]}..."
    print_message(f"holdfast: {line}")


def print_line(text: str = "") -> None:
    """Print a line of a result on stdout."""
    end_silence()
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
    end_silence()
    sys.stdout.write(f"{visible_json(text)}\n")


def format_number(value: float | None, digits: int) -> str:
    """Return a number with so many digits after the point; a dash if there is none.

    Example:
        >>> format_number(0.126, 2), format_number(None, 2)
        ('0.13', '-')
    """
    return "-" if value is None else f"{value:.{digits}f}"


def print_paragraph(text: str, first: str = "", later: str = "") -> None:
    """Print a text on stdout in lines as wide as the terminal.

    Args:
        text: a text of one paragraph.
        first: what the first line begins with.
        later: what all other lines begin with.
    """
    width = get_terminal_size().columns
    print_lines(wrap(visible(text), width, initial_indent=first, subsequent_indent=later))


def print_table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print rows in aligned columns on stdout; columns of numbers are aligned right.

    If the table is wider than the terminal (than 80 columns without one), headings and columns
    of text are wrapped. Numbers are not.

    Example:
        >>> print_table(("sensor", "taxels"), [("gtac", 15), ("anyskin", 5)])
        sensor   taxels
        gtac         15
        anyskin       5
    """
    lines = [[visible(str(cell)) for cell in row] for row in (header, *rows)]
    columns = list(zip(*lines, strict=True))
    numeric = [all(_is_number(cell) for cell in column[1:]) for column in columns]
    ranges = []  # smallest and natural width of each column; its first cell is its heading
    for column, is_number in zip(columns, numeric, strict=True):
        widest, least = max(map(len, column)), MIN_TEXT_WIDTH
        if is_number:  # the words of the heading may stand below each other, a number is whole
            least = max(map(len, (*column[0].split(), *column[1:], "")))
        ranges.append((min(widest, least), widest))
    widths = _fit(ranges, numeric)
    for k, row in enumerate(lines):
        cells = [_wrap(cell, width) for cell, width in zip(row, widths, strict=True)]
        height = max(map(len, cells))
        if k == 0 and any(numeric):  # a heading stands directly above its numbers
            cells = [[""] * (height - len(cell)) + cell for cell in cells]
        for parts in zip_longest(*cells, fillvalue=""):
            padded = [
                part.rjust(width) if is_number else part.ljust(width)
                for part, width, is_number in zip(parts, widths, numeric, strict=True)
            ]
            print_line(_GAP.join(padded).rstrip())


def _fit(ranges: Sequence[tuple[int, int]], numeric: Sequence[bool]) -> list[int]:
    """Return the widths of the columns of a table that fits the terminal, if it can.

    The headings of numbers are wrapped first, because that makes only one row higher.
    """
    available = get_terminal_size().columns
    widths = [max(least, min(widest, available)) for least, widest in ranges]
    # Each round takes one character from the column with most room, headings of numbers first.
    for _ in range(sum(widths) + len(_GAP) * (len(widths) - 1) - available):
        room = [
            (width > least and is_number, width - least)
            for width, (least, _), is_number in zip(widths, ranges, numeric, strict=True)
        ]
        widths[room.index(max(room))] -= max(room)[1] > 0
    return widths


def _wrap(text: str, width: int) -> list[str]:
    """Break a text between words, and a word that is too long after "_", "-", "/" or ".".

    Example:
        >>> _wrap("thumb_distal_phalanx of the left hand", 14)
        ['thumb_distal_', 'phalanx of the', 'left hand']
    """
    if len(text) <= width:
        return [text]
    parts = []
    for word in text.split(" "):
        start = 0
        while len(word) - start > width:
            marks = (word.rfind(mark, start, start + width) for mark in "_-/.")
            end = max(marks) + 1 or start + width
            parts.append(word[start:end])
            start = end
        parts.append(word[start:])
    return wrap(" ".join(parts), width, break_on_hyphens=False)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text in ("", "-")  # a dash stands for a number that is not known
    return True


def _to_json_value(value: object) -> object:
    # Arrays and scalars of NumPy, without an import of it.
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "__fspath__"):
        return str(value)
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
