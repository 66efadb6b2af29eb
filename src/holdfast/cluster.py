"""Calls on a Dask cluster: few at a time, of one version of holdfast."""

import logging
from asyncio import run, wait_for
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import Future as Result
from concurrent.futures import wait
from contextlib import contextmanager, suppress
from functools import lru_cache, partial
from hashlib import sha256
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeVar

from holdfast.errors import EngineError, MissingExtra

if TYPE_CHECKING:
    from distributed import Client, Future

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)
Arguments = tuple[object, ...]
Call = tuple[K, Arguments]

SCHEDULER_TIMEOUT = 10.0
"""Time within which a scheduler must answer [s]."""

NO_WORKER_TIMEOUT = 30.0
"""Time for which a cluster may have neither a worker nor a new result [s]."""

CALLS_PER_THREAD = 4
"""Number of calls that a cluster holds for each of its threads; more would fill its memory."""


def in_thread(call: Callable[[], T]) -> Result[T]:
    """Make a call in a thread that can be left, which has no event loop.

    Returns:
        Its result, or the exception that it raised.
    """
    result: Result[T] = Result()

    def make() -> None:
        try:
            result.set_result(call())
        except BaseException as cause:  # raised where the result is read
            result.set_exception(cause)

    Thread(target=make, daemon=True).start()
    return result


def call_on_cluster(
    function: Callable[..., T], calls: Iterable[Call[K]], scheduler: str, shared: Arguments = ()
) -> Iterator[tuple[K, T]]:
    """Make calls on a Dask cluster, which repeats the calls of a worker that died.

    Every call uses one thread.

    Args:
        function: that the workers can import.
        calls: the name of each call and its arguments; they are read as the workers need them.
        scheduler: address of the scheduler.
        shared: first arguments of every call; each worker has one copy.

    Yields:
        The name of a call and its result, as soon as it exists.

    Raises:
        EngineError: the scheduler does not answer or ends, there are no workers, a worker has no
            holdfast or another version, or the workers of one call died several times.
        MissingExtra: dask is not installed.
    """
    with _client(scheduler) as client:
        from distributed import TimeoutError as NoWorker

        try:
            _watched(client, lambda: client.wait_for_workers(1, timeout=NO_WORKER_TIMEOUT))
        except NoWorker:
            raise _without_workers(client) from None
        # Other versions give other results, which would be kept under the digest of this one.
        expected = package_digest()
        digests = _watched(client, lambda: client.run(package_digest, on_error="return"))
        for address, digest in digests.items():
            if isinstance(digest, Exception) and ModuleNotFoundError.__name__ in repr(digest):
                raise EngineError(_NO_HOLDFAST.format(f"the worker at {address}")) from digest
            if not isinstance(digest, OSError) and digest != expected:  # OSError: it died meanwhile
                raise EngineError(_OTHER_VERSION.format(f"the worker at {address}"))
        copies: list[Future] = []
        if shared:
            copies = _watched(
                client, lambda: client.scatter(list(shared), broadcast=True, hash=False)
            )
        # The digest goes with each call: a worker may join while the calls run.
        common = (package_digest(), function, *copies)
        yield from _submit(client, common, calls)


@lru_cache
def file_digests() -> dict[Path, str]:
    """Return a digest of each file of the package, by its path in the package."""
    package = Path(__file__).parent
    return {
        path.relative_to(package): sha256(path.read_bytes()).hexdigest()
        for path in sorted(package.rglob("*"))
        if path.is_file() and "__pycache__" not in path.parts
    }


def package_digest() -> str:
    """Return a digest of all files of the package."""
    lines = (f"{name.as_posix()} {content}\n" for name, content in file_digests().items())
    return sha256("".join(lines).encode()).hexdigest()


def _call(source: str, function: Callable[..., T], *arguments: object) -> T:
    """Make a call on a worker, which must have the same source."""
    from threadpoolctl import threadpool_limits

    if source != package_digest():
        raise EngineError(_OTHER_VERSION.format("a worker of the cluster"))
    with threadpool_limits(1):  # workers would compete for processors
        return function(*arguments)


_OTHER_VERSION = "{} has another version of holdfast: install the same version on all machines"
_GONE = "the Dask scheduler is gone"
_NO_HOLDFAST = "{} cannot import this holdfast: install the same version for it and for its workers"


def _submit(
    client: "Client", common: Arguments, calls: Iterable[Call[K]]
) -> Iterator[tuple[K, Any]]:
    """Make calls on a cluster."""
    from distributed import KilledWorker

    # A queue, as calls are added while others run, and a wait must end if there is no worker.
    done: SimpleQueue[Future] = SimpleQueue()
    waiting: dict[str, tuple[Call[K], Future]] = {}
    rest = iter(calls)
    while True:
        n_free = CALLS_PER_THREAD * max(_n_threads(client), 1) - len(waiting)
        for call in islice(rest, max(n_free, 0)):
            future = client.submit(_call, *common, *call[1], pure=False)
            waiting[future.key] = call, future
            future.add_done_callback(done.put)
        if not waiting:
            return
        while True:  # wait for the next that is done, while there is a worker
            with suppress(Empty):
                call, future = waiting.pop(done.get(timeout=NO_WORKER_TIMEOUT).key)
                break
            if not _n_threads(client):
                raise _without_workers(client)
        try:
            result = _watched(client, partial(_result, future))
        except KilledWorker as cause:
            raise EngineError(f"{call[0]}: its workers died, killed or out of memory") from cause
        yield call[0], result


@contextmanager
def _client(scheduler: str) -> Iterator["Client"]:
    """Connect to a scheduler; at the end, drop the calls that are not done."""
    try:
        import distributed  # noqa: F401 (fills dask's configuration, so it must be first)
        from dask import config
        from distributed.comm import CommClosedError
    except ImportError as missing:
        raise MissingExtra("distributed", "cluster") from missing
    large = {"distributed.admin.large-graph-warning-threshold": "1GB"}
    with config.set(large), _silent_log(), _connect(scheduler) as client:
        try:
            yield client
        except OSError as cause:  # of the connection, or of a function while it is there
            if client.status == "running" and not isinstance(cause, CommClosedError):
                raise
            raise EngineError(_GONE) from cause


@contextmanager
def _silent_log() -> Iterator[None]:
    """Silence the log of the client of Dask: our errors say the same in one line."""
    logger = logging.getLogger("distributed.client")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)


def _connect(scheduler: str) -> "Client":
    from distributed import Client

    try:
        in_thread(lambda: run(_connect_once(scheduler))).result()
        return Client(scheduler, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
    except Exception as cause:  # a server of any other kind may answer there
        raise EngineError(
            f"no Dask scheduler answers at {scheduler}: start one with `dask scheduler` "
            "and give the address that it shows, tcp://HOST:8786"
        ) from cause


async def _connect_once(scheduler: str) -> None:
    """Test the connection: a `Client` that cannot connect leaves threads and delays the exit."""
    from distributed.comm import connect

    comm = await wait_for(connect(scheduler), SCHEDULER_TIMEOUT)
    await comm.close()


def _watched(client: "Client", call: Callable[[], T]) -> T:
    """Return what a call of a client returns; end it if the scheduler no longer answers.

    A scheduler that is frozen keeps its connections, and most calls of a client have no timeout.

    Raises:
        EngineError: it does not answer a new connection in time.
    """
    result = in_thread(call)
    while not wait([result], SCHEDULER_TIMEOUT).done:
        try:
            in_thread(lambda: run(_connect_once(client.scheduler.address))).result()
        except (OSError, TimeoutError) as cause:
            raise EngineError(_GONE) from cause
    return result.result()


def _n_threads(client: "Client") -> int:
    return sum(_watched(client, client.nthreads).values())


def _without_workers(client: "Client") -> EngineError:
    scheduler = client.scheduler.address
    return EngineError(
        f"the Dask scheduler at {scheduler} has no workers: "
        f"start some with `dask worker {scheduler} --nthreads 1`"
    )


def _result(future: "Future") -> Any:  # noqa: ANN401 (any function's)
    from distributed.client import FutureCancelledError

    try:
        return future.result()
    except FutureCancelledError as cause:
        raise EngineError(_GONE) from cause
    except ModuleNotFoundError as cause:
        if cause.name is None or cause.name.split(".")[0] != "holdfast":
            raise
        raise EngineError(_NO_HOLDFAST.format("a worker of the cluster")) from cause
    except RuntimeError as cause:
        if "deserialization of the task graph" not in str(cause):
            raise
        raise EngineError(_NO_HOLDFAST.format("the Dask scheduler")) from cause
