"""One line on stderr while kernels compile, for the command line. No import of numba."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

COMPILE_LOGGER = logging.getLogger("holdfast.compiled")
"""`compiled.py` logs here that a kernel is not in the cache. Without a handler nothing appears."""
COMPILE_LOGGER.addHandler(logging.NullHandler())
COMPILING = "compiling, once on this machine, about two minutes"


class _FirstOnly(logging.StreamHandler):  # type: ignore[type-arg]
    """Handler that prints its first record only: a verb compiles about 200 functions."""

    done = False

    def emit(self, record: logging.LogRecord) -> None:
        if not self.done:
            self.done = True
            super().emit(record)


@contextmanager
def compiling_shown() -> Iterator[None]:
    """Print the line at the first compilation; afterwards the logger is as before."""
    handler, level = _FirstOnly(), COMPILE_LOGGER.level
    COMPILE_LOGGER.addHandler(handler)
    COMPILE_LOGGER.setLevel(logging.INFO)
    try:
        yield
    finally:
        COMPILE_LOGGER.removeHandler(handler)
        COMPILE_LOGGER.setLevel(level)


def is_waiting() -> bool:
    """Return whether this process would print the line at its next compilation."""
    return any(isinstance(one, _FirstOnly) and not one.done for one in COMPILE_LOGGER.handlers)
