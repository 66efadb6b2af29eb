"""Parallel calls, in processes of this machine by joblib.

Results do not depend on where or in which order the calls are made.
"""

import os
import time
import warnings
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import suppress
from functools import cache, partial
from threading import Lock, Thread
from typing import Any, NamedTuple, TypeVar, cast

from holdfast.children import SAFE_PATH_VARIABLE, safe_path
from holdfast.errors import EngineError, MissingExtra, is_installed

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)
Arguments = tuple[object, ...]
Call = tuple[K, Arguments]

PARENT_CHECK_INTERVAL = 1.0
"""Time between two checks of a process whether the process that started it still runs [s]."""


LOKY_WARNING = "A worker stopped while some jobs were given"


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
    from joblib import delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    call_named = delayed(_call_in_worker)
    tasks = (call_named(os.getpid(), function, *call) for call in calls)
    try:
        with _WITHOUT_WARNING:
            yield from _start(n_jobs, tasks)
    except TerminatedWorkerError as cause:
        raise EngineError("a process died, killed or out of memory; try with fewer jobs") from cause


class _WarningFilter:
    """Filter that ignores the warning of loky about a worker that it replaces.

    loky replaces a worker whose memory grew; no result is lost. The filter is there while any
    pool runs. Several pools may run at a time and end in any order, so that restoring a list of
    filters, as `warnings.catch_warnings` does, would lose filters that were added meanwhile.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._n_users = 0

    def __enter__(self) -> None:
        with self._lock:
            self._n_users += 1
            if self._n_users == 1:
                warnings.filterwarnings("ignore", LOKY_WARNING)
                self._filter = warnings.filters[0]

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._n_users -= 1
            if not self._n_users:
                with suppress(ValueError):  # the program has reset the filters
                    cast(list[object], warnings.filters).remove(self._filter)


_WITHOUT_WARNING = _WarningFilter()


def _start(n_jobs: int, tasks: Iterable[object]) -> Iterator[Any]:
    """Start the processes and the first tasks; return the iterator over the results."""
    from joblib import Parallel

    # The processes start with the first tasks, which the call of the generator sends.
    with safe_path:
        results: Iterator[Any] = Parallel(
            n_jobs, backend=_backend_type()(), return_as="generator_unordered"
        )(tasks)
    return results


@cache
def _backend_type() -> type[Any]:
    """Return the back end of joblib, whose later processes have a safe path as well.

    joblib starts a new process in place of one whose memory grew, from a thread of its own. Such
    a process has the values that some variables had when the pool was started.
    """
    from joblib.parallel import LokyBackend

    class SafeBackend(LokyBackend):
        MAX_NUM_THREADS_VARS = (*LokyBackend.MAX_NUM_THREADS_VARS, SAFE_PATH_VARIABLE)

    return SafeBackend


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
