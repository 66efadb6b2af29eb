"""Queue of work that other threads request from the thread of a session or of a grip loop."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future

Work = Callable[[], None]


class RequestQueue:
    """Queue of requests. Any thread may append one; one thread carries them out.

    Example:
        >>> requests = RequestQueue()
        >>> result = requests.append(lambda: print("carried out"))
        >>> requests.carry_out()
        carried out
        >>> result.done()
        True
    """

    def __init__(self) -> None:
        self._requests: deque[tuple[Work, Future[None]]] = deque()

    def append(self, work: Work, *, cancellable: bool = True) -> "Future[None]":
        """Append a request, and return its result, which is there when it was carried out.

        Args:
            work: is called in the thread that carries out the requests.
            cancellable: whether the caller may cancel it while it waits, as after a time-out.
        """
        future: Future[None] = Future()
        if not cancellable:
            future.set_running_or_notify_cancel()
        self._requests.append((work, future))
        return future

    def carry_out(self, follow_up: Work = lambda: None) -> None:
        """Carry out the requests that wait now, then `follow_up`, then set the results.

        A request that fails has its exception as its result. If `follow_up` fails, the other
        requests have that exception, and it is raised.
        """
        waiting = [self._requests.popleft() for _ in range(len(self._requests))]
        done = [future for work, future in waiting if _run(work, future)]
        try:
            follow_up()
        except Exception as failure:
            for future in done:
                future.set_exception(failure)
            raise
        for future in done:
            future.set_result(None)


def _run(work: Work, future: "Future[None]") -> bool:
    """Run the work of a request. Return False if it was cancelled before, or has failed."""
    if not (future.running() or future.set_running_or_notify_cancel()):
        return False
    try:
        work()
    except Exception as failure:
        future.set_exception(failure)
        return False
    return True
