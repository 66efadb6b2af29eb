"""Parallel calls: in processes of this machine by joblib, or on a Dask cluster.

When a process dies, the calls that were running are made again. Results do not depend on where
or in which order the calls are made.
"""

import os
import time
import warnings
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial
from queue import Empty, SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar

from holdfast.errors import EngineError, MissingExtra

if TYPE_CHECKING:
    from distributed import Client, Future

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)
Arguments = tuple[object, ...]
Call = tuple[K, Arguments]

MAX_RETRIES = 2
"""Number of times that a call whose process died is made again, alone."""

CONNECT_TIMEOUT = 10.0
"""Time within which a scheduler must answer [s]."""

PARENT_CHECK_INTERVAL = 1.0
"""Time between two checks of a process whether the process that started it still runs [s]."""

NO_WORKER_TIMEOUT = 30.0
"""Time for which a cluster may have neither a worker nor a new result [s]."""


class Engine(NamedTuple):
    """Place where calls are made: this process, processes of this machine, or a Dask cluster.

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

    def map_ordered(
        self, function: Callable[..., T], arguments: Iterable[Arguments]
    ) -> Iterator[T]:
        """Call a function with many arguments; yield the results in the order of the arguments.

        Args:
            function: any function that can be sent to another process.
            arguments: the arguments of each call.

        Yields:
            The result of each call, as soon as all earlier results have been yielded.

        Raises:
            EngineError: as `map_unordered`; the text names the index of the call, from 0.
        """
        waiting: dict[int, T] = {}
        next_index = 0
        for index, result in self.map_unordered(function, enumerate(arguments)):
            waiting[index] = result
            while next_index in waiting:
                yield waiting.pop(next_index)
                next_index += 1

    def map_unordered(
        self, function: Callable[..., T], calls: Iterable[Call[K]]
    ) -> Iterator[tuple[K, T]]:
        """Call a function with many arguments; yield each result as soon as it exists.

        Args:
            function: any function that can be sent to another process.
            calls: the name of each call and its arguments. All names differ.

        Yields:
            The name of a call and its result.

        Raises:
            EngineError: the cluster cannot be reached or has no workers, or the process died
                every time that one call was made. The text names that call.
            MissingExtra: dask is not installed.
        """
        if self.scheduler is not None:
            return _on_cluster(function, calls, self.scheduler)
        if self.n_jobs != 1:
            return _in_processes(function, calls, self.n_jobs)
        return ((name, function(*arguments)) for name, arguments in calls)


def map_ordered(
    function: Callable[..., T], arguments: Iterable[Arguments], n_jobs: int = 1
) -> Iterator[T]:
    """Call a function with many arguments on this machine, as `Engine.map_ordered` does.

    Args:
        function: any function that can be sent to another process.
        arguments: the arguments of each call.
        n_jobs: number of calls at a time; -1 for one per processor. With 1, all calls are made
            in this process.

    Yields:
        The result of each call, in the order of the arguments.

    Raises:
        EngineError: the process died every time that one call was made.
    """
    return Engine(n_jobs).map_ordered(function, arguments)


def _in_processes(
    function: Callable[..., T], calls: Iterable[Call[K]], n_jobs: int
) -> Iterator[tuple[K, T]]:
    """Make calls with joblib.

    A process that dies breaks the whole pool. Then each call that was running is made again
    alone, and the other calls in a new pool.
    """
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    # loky replaces a worker whose memory grew, with a warning. No result is lost.
    warnings.filterwarnings("ignore", "A worker stopped while some jobs were given")
    rest, started = iter(calls), dict[K, Arguments]()
    ended = False
    while started or not ended:
        for name in list(started):
            yield name, _call_alone(function, name, started.pop(name))
        call_named = delayed(_call_in_worker)
        tasks = (call_named(os.getpid(), function, *call) for call in _record(rest, started))
        with suppress(TerminatedWorkerError):
            for name, result in Parallel(n_jobs, return_as="generator_unordered")(tasks):
                del started[name]
                yield name, result
            ended = True


def _record(calls: Iterator[Call[K]], started: dict[K, Arguments]) -> Iterator[Call[K]]:
    """Yield the calls, each added to `started` before."""
    for name, arguments in calls:
        started[name] = arguments
        yield name, arguments


def _call_in_worker(
    parent: int, function: Callable[..., T], name: K, arguments: Arguments
) -> tuple[K, T]:
    _end_with(parent)
    return name, function(*arguments)


@cache
def _end_with(parent: int) -> None:
    """End this process when its parent has died; no other process would end it."""

    def wait() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK_INTERVAL)
        os._exit(1)

    if os.getpid() != parent:
        Thread(target=wait, name="holdfast-parent", daemon=True).start()


def _call_alone(function: Callable[..., T], name: object, arguments: Arguments) -> T:
    """Make one call in another process; only this call can be the cause if the process dies."""
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    for _ in range(MAX_RETRIES):
        with suppress(TerminatedWorkerError):
            call = delayed(_call_in_worker)(os.getpid(), function, None, arguments)
            result: T = Parallel(n_jobs=2)([call])[0][1]
            return result
    raise EngineError(
        f"{name}: its process died {1 + MAX_RETRIES} times, killed or out of memory; "
        "try with fewer jobs"
    )


def _on_cluster(
    function: Callable[..., T], calls: Iterable[Call[K]], scheduler: str
) -> Iterator[tuple[K, T]]:
    """Make calls on a Dask cluster, which repeats the calls of a worker that died.

    If a worker dies, Dask counts a failure of every call that the worker held (decision 0006).
    So a call that Dask cancels is repeated alone.
    """
    with _client(scheduler) as client:
        suspects: list[Call[K]] = []
        yield from _submit(client, function, calls, suspects)
        for call in suspects:
            failed: list[Call[K]] = []
            yield from _submit(client, function, [call], failed)
            if failed:
                raise EngineError(f"{call[0]}: its worker died each time, killed or out of memory")


def _submit(
    client: "Client", function: Callable[..., T], calls: Iterable[Call[K]], suspects: list[Call[K]]
) -> Iterator[tuple[K, T]]:
    """Make calls on a cluster; append to `suspects` those whose workers died."""
    from distributed import KilledWorker

    done: SimpleQueue[Future] = SimpleQueue()
    waiting: dict[str, tuple[Call[K], Future]] = {}
    for call in calls:
        future = client.submit(partial(function, *call[1]), pure=False)
        waiting[future.key] = call, future
        future.add_done_callback(done.put)
    while waiting:
        call, future = waiting.pop(_next_done(done, client).key)
        try:
            result = _result(future)
        except KilledWorker:
            suspects.append(call)
        else:
            yield call[0], result


@contextmanager
def _client(scheduler: str) -> Iterator["Client"]:
    """Connect to a scheduler; at the end, drop the calls that are not done."""
    try:
        import distributed  # noqa: F401 (fills dask's configuration, so it must be first)
        from dask import config
    except ImportError as missing:
        raise MissingExtra("distributed", "cluster") from missing
    large = {"distributed.admin.large-graph-warning-threshold": "1GB"}
    with config.set(large), _connect(scheduler) as client:
        yield client


def _connect(scheduler: str) -> "Client":
    from asyncio import run, wait_for
    from concurrent.futures import ThreadPoolExecutor
    from logging import CRITICAL, getLogger

    from distributed import Client

    getLogger("distributed.client").setLevel(CRITICAL)  # our errors say the same in one line
    try:
        with ThreadPoolExecutor(1) as thread:  # the calling thread may have an event loop
            thread.submit(run, wait_for(_connect_once(scheduler), CONNECT_TIMEOUT)).result()
        return Client(scheduler, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except Exception as cause:  # a server of any other kind may answer there
        raise EngineError(
            f"no Dask scheduler answers at {scheduler}: start one with `dask scheduler` "
            "and give the address that it shows, tcp://HOST:8786"
        ) from cause


async def _connect_once(scheduler: str) -> None:
    """Test the connection: a `Client` that cannot connect leaves threads and delays the exit."""
    from distributed.comm import connect

    comm = await connect(scheduler)
    await comm.close()


def _next_done(done: "SimpleQueue[Future]", client: "Client") -> "Future":
    """Wait for the next future that is done."""
    while True:
        with suppress(Empty):
            return done.get(timeout=NO_WORKER_TIMEOUT)
        if not client.scheduler_info()["workers"]:
            scheduler = client.scheduler.address
            raise EngineError(
                f"the Dask scheduler at {scheduler} has no workers: "
                f"start some with `dask worker {scheduler} --nthreads 1`"
            )


def _result(future: "Future") -> Any:  # noqa: ANN401 (any function's)
    from distributed.client import FutureCancelledError

    try:
        return future.result()
    except FutureCancelledError as cause:
        raise EngineError("the Dask scheduler is gone") from cause
    except RuntimeError as cause:
        if "deserialization of the task graph" not in str(cause):
            raise
        raise EngineError(
            "the Dask scheduler cannot import holdfast: install the same version for it and for "
            "its workers"
        ) from cause
