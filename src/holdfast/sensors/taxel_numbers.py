"""Numbers of taxels: from 1 for people and in files, where arrays have indices from 0."""

from collections.abc import Iterable

FIRST_TAXEL = 1
"""Number of the first taxel of a sensor.

Columns of files, tables, figures, options, documents and messages count taxels from it. Arrays,
and arguments and results in Python that index them, count from 0."""


def taxel_number(index: int) -> int:
    """Return the number of the taxel at an index of the readings.

    Example:
        >>> taxel_number(0), taxel_index(1)
        (1, 0)
    """
    return index + FIRST_TAXEL


def taxel_numbers(indices: Iterable[int]) -> tuple[int, ...]:
    """Return the numbers of the taxels at these indices of the readings."""
    return tuple([index + FIRST_TAXEL for index in indices])


def taxel_index(number: int) -> int:
    """Return the index in the readings of the taxel with a number."""
    return number - FIRST_TAXEL


def index_ranges(indices: Iterable[int]) -> str:
    """Return indices as ranges.

    Example:
        >>> index_ranges([5, 3, 4, 9])
        '3-5, 9'
    """
    runs: list[list[int]] = []
    for index in sorted(indices):
        if runs and index == runs[-1][1] + 1:
            runs[-1][1] = index
        else:
            runs.append([index, index])
    return ", ".join(f"{a}-{b}" if a < b else f"{a}" for a, b in runs)
