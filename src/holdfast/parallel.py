"""Parallel calls, in processes of this machine by joblib.

Results do not depend on where or in which order the calls are made.
"""

import os
import time
from collections.abc import Callable, Hashable, Iterable, Iterator
from functools import cache, partial
from threading import Thread
from typing import NamedTuple, TypeVar

from holdfast.errors import EngineError, MissingExtra, is_installed

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)
Arguments = tuple[object, ...]
Call = tuple[K, Arguments]

PARENT_CHECK_INTERVAL = 1.0
"""Time between two checks of a process whether the process that started it still runs [s]."""


class Engine(NamedTuple):
    """Where calls are made: in this process, or in processes of this machine.

    Attributes:
        n_jobs: number of calls at a time; -1 for one per processor. With 1, all calls are made
            in this process.
    """

    n_jobs: int = 1

    @property
    def in_this_process(self) -> bool:
        """Whether a call is made in this process, when its result is needed."""
        return self.n_jobs == 1

    def map_ordered(
        self,
        function: Callable[..., T],
        arguments: Iterable[Arguments],
        shared: Arguments = (),
    ) -> Iterator[T]:
        """Call a function with many arguments; yield the results in the order of the arguments.

        Args:
            function: any function that can be sent to another process.
            arguments: the arguments of each call.
            shared: as in `map_unordered`.

        Yields:
            The result of each call, as soon as all earlier results have been yielded.

        Raises:
            EngineError: as `map_unordered`; the text names the index of the call, from 0.
        """
        waiting: dict[int, T] = {}
        next_index = 0
        for index, result in self.map_unordered(function, enumerate(arguments), shared):
            waiting[index] = result
            while next_index in waiting:
                yield waiting.pop(next_index)
                next_index += 1

    def map_unordered(
        self, function: Callable[..., T], calls: Iterable[Call[K]], shared: Arguments = ()
    ) -> Iterator[tuple[K, T]]:
        """Call a function with many arguments; yield each result as soon as it exists.

        Args:
            function: any function that can be sent to another process.
            calls: the name of each call and its arguments. All names differ.
            shared: first arguments of every call.

        Yields:
            The name of a call and its result.

        Raises:
            EngineError: a process died.
            MissingExtra: joblib is not installed.
        """
        if shared:
            function = partial(function, *shared)
        if not self.in_this_process:
            return _in_processes(function, calls, self.n_jobs)
        return ((name, function(*arguments)) for name, arguments in calls)


def _in_processes(
    function: Callable[..., T], calls: Iterable[Call[K]], n_jobs: int
) -> Iterator[tuple[K, T]]:
    """Make calls with joblib."""
    if not is_installed("joblib"):
        raise MissingExtra("joblib", "train")
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    call_named = delayed(_call_in_worker)
    tasks = (call_named(os.getpid(), function, *call) for call in calls)
    try:
        yield from Parallel(n_jobs, backend="loky", return_as="generator_unordered")(tasks)
    except TerminatedWorkerError as cause:
        raise EngineError("a process died, killed or out of memory; try with fewer jobs") from cause


def _call_in_worker(
    parent: int, function: Callable[..., T], name: K, arguments: Arguments
) -> tuple[K, T]:
    _end_with(parent)
    return name, function(*arguments)


@cache
def _end_with(parent: int) -> None:
    """End this process when its parent has died; no other process would end it."""

    def wait() -> None:
        # An orphan gets another parent.
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK_INTERVAL)
        os._exit(1)

    if os.getpid() != parent:
        Thread(target=wait, name="holdfast-parent", daemon=True).start()
