"""Work side by side: one small face over joblib, whose back end a caller may choose."""

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")


def each(
    function: Callable[..., T], arguments: Iterable[tuple[object, ...]], n_jobs: int = 1
) -> Iterator[T]:
    """The results of a function for many arguments, in their order, as they come.

    Args:
        function: that can be sent to another process.
        arguments: of each call.
        n_jobs: how many calls at a time; -1 for as many as there are processors. With 1 all
            happens here, one after the other.

    Yields:
        What the function returns.
    """
    if n_jobs == 1:
        for given in arguments:
            yield function(*given)
        return
    from joblib import Parallel, delayed

    tasks = (delayed(function)(*given) for given in arguments)
    yield from Parallel(n_jobs=n_jobs, return_as="generator")(tasks)
