"""Parallel calls: in processes of this machine by joblib, or on a Dask cluster.

Results do not depend on where or in which order the calls are made.
"""

import os
import time
from collections.abc import Callable, Hashable, Iterable, Iterator
from functools import cache, partial
from pathlib import Path
from threading import Thread
from typing import NamedTuple, Self, TypeVar

from holdfast.cluster import Arguments, Call, call_on_cluster
from holdfast.errors import EngineError, MissingExtra, OutputError, is_installed

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)

PARENT_CHECK_INTERVAL = 1.0
"""Time between two checks of a process whether the process that started it still runs [s]."""


class Engine(NamedTuple):
    """Where calls are made: this process, processes of this machine, or a Dask cluster.

    Attributes:
        n_jobs: number of calls at a time; -1 for one per processor. With 1, all calls are made
            in this process. On a cluster, its number of threads counts instead.
        scheduler: address of a Dask scheduler; None for this machine.
    """

    n_jobs: int = 1
    scheduler: str | None = None

    @classmethod
    def parse(cls, text: str = "loky", n_jobs: int = -1) -> Self:
        """Return the engine that a text names.

        Args:
            text: `loky` for processes of this machine, `dask:ADDRESS` for a cluster.
            n_jobs: number of calls at a time on this machine.

        Raises:
            ValueError: the text names no engine.

        Example:
            >>> Engine.parse("dask:tcp://10.0.0.1:8786").scheduler
            'tcp://10.0.0.1:8786'
        """
        kind, _, address = text.partition(":")
        if text == "loky":
            return cls(n_jobs)
        if kind == "dask" and address:
            return cls(n_jobs, address)
        raise ValueError(f"unknown engine {text!r}; there are loky and dask:ADDRESS")

    @property
    def in_this_process(self) -> bool:
        """Whether a call is made in this process, when its result is needed."""
        return self.scheduler is None and self.n_jobs == 1

    def path(self, path: Path) -> Path:
        """Return a path as all processes can use it: absolute on a cluster.

        A worker has another working folder. Its machine must have the file at the same path.
        """
        return path if self.scheduler is None else path.absolute()

    def check_written(self, path: Path) -> None:
        """Check that a file that a call has written is there.

        Raises:
            OutputError: a worker of a cluster wrote it to a disk of its own.
        """
        if self.scheduler is not None and not path.exists():
            raise OutputError(
                f"a worker wrote {path.absolute()}, but it is not on this machine: choose a folder "
                "that all machines have at the same path"
            )

    def check(self) -> None:
        """Make one call, so that an engine that cannot be reached is found before the work.

        Raises:
            EngineError, MissingExtra: as `map_unordered`.
        """
        if self.scheduler is not None:
            list(self.map_ordered(abs, [(0,)]))

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
            shared: first arguments of every call. A cluster copies them to each worker once.

        Yields:
            The name of a call and its result.

        Raises:
            EngineError: the cluster cannot be reached, has no workers or a worker without this
                version of holdfast, or a process died.
            MissingExtra: joblib or dask is not installed.
        """
        if self.scheduler is not None:
            return call_on_cluster(function, calls, self.scheduler, shared)
        if shared:
            function = partial(function, *shared)
        if self.n_jobs != 1:
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
