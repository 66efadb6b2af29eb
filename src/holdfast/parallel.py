"""Work side by side: in processes of this machine by joblib, or on a Dask cluster.

A process that dies costs the calls that it was at: they are done again. Results do not depend
on where or in which order the work is done.
"""

import warnings
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar

from holdfast.errors import EngineError, MissingExtra

if TYPE_CHECKING:
    from distributed import Client, Future

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)
Arguments = tuple[object, ...]
Call = tuple[K, Arguments]

MORE_LIVES = 2
"""A call whose process died is done again so many times, alone."""

PATIENCE = 10.0
"""A scheduler must answer within this [s]."""

LONELY = 30.0
"""A cluster may be without any worker, and without a result, for this long [s]."""


class Engine(NamedTuple):
    """Where work is done: here, in processes of this machine, or on a Dask cluster.

    Attributes:
        n_jobs: how many calls at a time; -1 for as many as there are processors. With 1 all
            happens here, one after the other. A cluster does as many as it has threads.
        scheduler: address of a Dask scheduler; None for this machine.
    """

    n_jobs: int = 1
    scheduler: str | None = None

    @classmethod
    def parse(cls, text: str = "loky", n_jobs: int = -1) -> Self:
        """The engine that a text names.

        Args:
            text: `loky` for processes of this machine, `dask:ADDRESS` for a cluster.
            n_jobs: how many calls at a time on this machine.

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

    def each(self, function: Callable[..., T], arguments: Iterable[Arguments]) -> Iterator[T]:
        """The results of a function for many arguments, in their order, as they come.

        Args:
            function: that can be sent to another process.
            arguments: of each call.

        Yields:
            What the function returns.

        Raises:
            EngineError: as `as_done`; it names the place of the call, counted from 0.
        """
        early: dict[int, T] = {}
        turn = 0
        for place, result in self.as_done(function, enumerate(arguments)):
            early[place] = result
            while turn in early:
                yield early.pop(turn)
                turn += 1

    def as_done(
        self, function: Callable[..., T], calls: Iterable[Call[K]]
    ) -> Iterator[tuple[K, T]]:
        """The results of a function for many arguments, in the order in which they are done.

        Args:
            function: that can be sent to another process.
            calls: the name of each call, all different, and its arguments.

        Yields:
            The name of a call and what the function returns.

        Raises:
            EngineError: the cluster cannot be reached or has no workers, or a process died
                again and again at one call, which the text names.
            MissingExtra: dask is not installed.
        """
        if self.scheduler is not None:
            return _on_cluster(function, calls, self.scheduler)
        if self.n_jobs != 1:
            return _in_processes(function, calls, self.n_jobs)
        return ((name, function(*given)) for name, given in calls)


def each(
    function: Callable[..., T], arguments: Iterable[Arguments], n_jobs: int = 1
) -> Iterator[T]:
    """The results of a function for many arguments, in their order, as they come.

    Args:
        function: that can be sent to another process.
        arguments: of each call.
        n_jobs: how many calls at a time; -1 for as many as there are processors. With 1 all
            happens here, one after the other.

    Yields:
        What the function returns.

    Raises:
        EngineError: a process died again and again at one call.
    """
    return Engine(n_jobs).each(function, arguments)


def _in_processes(
    function: Callable[..., T], calls: Iterable[Call[K]], n_jobs: int
) -> Iterator[tuple[K, T]]:
    """A death breaks the whole pool; what it was at is then done alone, the rest in a new one."""
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    # A worker that grew is replaced by loky with a warning; nothing is lost.
    warnings.filterwarnings("ignore", "A worker stopped while some jobs were given")
    rest, begun = iter(calls), dict[K, Arguments]()
    ended = False
    while begun or not ended:
        for name in list(begun):
            yield name, _alone(function, name, begun.pop(name))
        tasks = (delayed(_named)(function, *call) for call in _noted(rest, begun))
        with suppress(TerminatedWorkerError):
            for name, result in Parallel(n_jobs, return_as="generator_unordered")(tasks):
                del begun[name]
                yield name, result
            ended = True


def _noted(calls: Iterator[Call[K]], begun: dict[K, Arguments]) -> Iterator[Call[K]]:
    for name, given in calls:
        begun[name] = given
        yield name, given


def _named(function: Callable[..., T], name: K, given: Arguments) -> tuple[K, T]:
    return name, function(*given)


def _alone(function: Callable[..., T], name: object, given: Arguments) -> T:
    """The result of one call in another process, where nothing else is to blame for a death."""
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    for _ in range(MORE_LIVES):
        with suppress(TerminatedWorkerError):
            result: T = Parallel(n_jobs=2)([delayed(function)(*given)])[0]
            return result
    raise EngineError(
        f"{name}: its process died {1 + MORE_LIVES} times, killed or out of memory; "
        "try with fewer jobs"
    )


def _on_cluster(
    function: Callable[..., T], calls: Iterable[Call[K]], scheduler: str
) -> Iterator[tuple[K, T]]:
    """Dask does again what a worker was at when it died; decision 0006 tells the rest."""
    with _client(scheduler) as client:
        suspects: list[Call[K]] = []
        yield from _together(client, function, calls, suspects)
        for call in suspects:
            guilty: list[Call[K]] = []
            yield from _together(client, function, [call], guilty)
            if guilty:
                raise EngineError(
                    f"{call[0]}: its worker died again and again, killed or out of memory"
                )


def _together(
    client: "Client", function: Callable[..., T], calls: Iterable[Call[K]], suspects: list[Call[K]]
) -> Iterator[tuple[K, T]]:
    """What is done; `suspects` takes the calls during which, or beside which, workers died."""
    from distributed import KilledWorker

    done: SimpleQueue[Future] = SimpleQueue()
    waiting: dict[str, tuple[Call[K], Future]] = {}
    for call in calls:
        future = client.submit(partial(function, *call[1]), pure=False)
        waiting[future.key] = call, future
        future.add_done_callback(done.put)
    while waiting:
        call, future = waiting.pop(_next(done, client).key)
        try:
            result = _result(future)
        except KilledWorker:
            suspects.append(call)
        else:
            yield call[0], result


@contextmanager
def _client(scheduler: str) -> Iterator["Client"]:
    """A connection to the scheduler; what it is asked to do is dropped at the end."""
    try:
        import distributed  # noqa: F401 (fills dask's configuration, so it must be first)
        from dask import config
    except ImportError as missing:
        raise MissingExtra("distributed", "cluster") from missing
    large = {"distributed.admin.large-graph-warning-threshold": "1GB"}
    with config.set(large), _connected(scheduler) as client:
        yield client


def _connected(scheduler: str) -> "Client":
    from asyncio import run, wait_for
    from concurrent.futures import ThreadPoolExecutor
    from logging import CRITICAL, getLogger

    from distributed import Client

    getLogger("distributed.client").setLevel(CRITICAL)  # what it tells, our errors tell in a line
    try:
        with ThreadPoolExecutor(1) as thread:  # has no event loop yet, whoever calls
            thread.submit(run, wait_for(_knock(scheduler), PATIENCE)).result()
        return Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except Exception as cause:  # whatever answers there may be anything
        raise EngineError(
            f"no Dask scheduler answers at {scheduler}: start one with `dask scheduler` "
            "and give the address that it shows, tcp://HOST:8786"
        ) from cause


async def _knock(scheduler: str) -> None:
    """Connects once: a `Client` that cannot leaves threads behind and holds up the exit."""
    from distributed.comm import connect

    comm = await connect(scheduler)
    await comm.close()


def _next(done: "SimpleQueue[Future]", client: "Client") -> "Future":
    """The next future that is done."""
    while True:
        with suppress(Empty):
            return done.get(timeout=LONELY)
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
