"""Cuts of arrays over time into spans that all of them share."""

from collections.abc import Collection, Iterator, Mapping

import numpy as np

from holdfast.sensors.types import Array


def spans(
    times: Mapping[str, Array],
    seconds: float,
    n_most: int = 1 << 62,
    counted: Collection[str] | None = None,
) -> Iterator[dict[str, slice]]:
    """Consecutive spans of time, each with the samples of every array that fall in it.

    A span begins at the next sample of any array, so that gaps give no empty spans.

    Args:
        times: (n,) strictly increasing [s], by key.
        seconds: how long a span is at most [s].
        n_most: how many samples of one array it holds at most.
        counted: keys of the arrays that `n_most` holds for; all where it is None.

    Yields:
        For each key the slice of its samples, which may be empty.

    Example:
        >>> for span in spans({"a": np.arange(5.0), "b": np.array([3.0])}, 3.0):
        ...     print(span["a"], span["b"])
        slice(0, 3, None) slice(0, 0, None)
        slice(3, 5, None) slice(0, 1, None)
    """
    first = dict.fromkeys(times, 0)
    while left := [key for key in times if first[key] < len(times[key])]:
        start = min(float(times[key][first[key]]) for key in left)
        end = max(start + seconds, float(np.nextafter(start, np.inf)))
        for key in left:
            if key in (counted or times) and first[key] + n_most < len(times[key]):
                end = min(end, float(times[key][first[key] + n_most]))
        last = {key: int(np.searchsorted(times[key], end)) for key in times}
        yield {key: slice(first[key], max(first[key], last[key])) for key in times}
        first = last
