"""Threads that can be left, and the processors that this process may use."""

import os
from collections.abc import Callable
from concurrent.futures import Future
from threading import Thread
from typing import TypeVar

T = TypeVar("T")


def in_thread(call: Callable[[], T]) -> Future[T]:
    """Make a call in a thread that can be left, which has no event loop.

    Returns:
        Its result, or the exception that it raised.
    """
    result: Future[T] = Future()

    def make() -> None:
        try:
            result.set_result(call())
        except BaseException as cause:  # raised where the result is read
            result.set_exception(cause)

    Thread(target=make, daemon=True).start()
    return result


def usable_processors() -> int:
    """Return the number of processors that this process may use."""
    # A container or `taskset` may allow fewer than the machine has.
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
