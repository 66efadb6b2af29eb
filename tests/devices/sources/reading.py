"""Arrivals of a source that tests wait for, and a clock that only they move."""

import time

LIMIT = 20.0
"""A test that hangs fails after this [s]."""


def until(source, wanted):
    """Return the arrivals up to the first that is wanted."""
    got = []
    end = time.monotonic() + LIMIT
    while time.monotonic() < end:
        arrival = source.read(0.05)
        if arrival is not None:
            got.append(arrival)
            if wanted(arrival):
                return got
    raise AssertionError(f"not among {got}")


def some_of(source, n):
    """Return the next arrivals with samples."""
    return [until(source, lambda arrival: arrival.samples)[-1] for _ in range(n)]


class Clock:
    """A clock that only sleep and tests move."""

    def __init__(self):
        self.now = 100.0
        self.slept = []

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        assert seconds >= 0
        self.slept.append(seconds)
        self.now += seconds
