"""Result of an attack, and how it is counted."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

SLOW = 1.0
"""A single input that takes longer counts as slow [s]."""


@dataclass
class Result:
    """Counts of an attack.

    Attributes:
        attack: what was tried.
        n_tried: number of inputs.
        n_accepted: inputs that gave samples, or an answer with a status below 400.
        n_refused: inputs that were refused as documented.
        n_wrong: accepted inputs with another value than an independent reader finds, or STABLE
            where it must not be.
        n_foreign: inputs that raised an exception which is not documented, or status 500.
        n_slow: inputs that took longer than `limit`.
        worst: longest time of one input [s].
        note: figures of this attack alone.
        limit: an input that takes longer is slow [s].
    """

    attack: str
    n_tried: int = 0
    n_accepted: int = 0
    n_refused: int = 0
    n_wrong: int = 0
    n_foreign: int = 0
    n_slow: int = 0
    worst: float = 0.0
    note: str = ""
    limit: float = SLOW

    @property
    def failed(self) -> bool:
        """Whether anything happened that must not."""
        return bool(self.n_wrong or self.n_foreign or self.n_slow)

    def timed(self, work: Callable[[], bool], *documented: type[BaseException]) -> None:
        """Try one input: `work` returns whether it was accepted, or raises if it is refused."""
        self.n_tried += 1
        begin = self.now()
        try:
            accepted = work()
        except documented:
            accepted = False
        except Exception as error:
            self.n_foreign += 1
            self.note = self.note or f"{type(error).__name__}: {error}"[:120]
            return
        finally:
            took = self.now() - begin
            self.worst = max(self.worst, took)
            self.n_slow += took > self.limit
        self.n_accepted += accepted
        self.n_refused += not accepted

    def now(self) -> float:
        """Return the time by which inputs are measured [s]."""
        return time.perf_counter()

    def document(self) -> dict[str, object]:
        """Return the counts as JSON."""
        return asdict(self)


class CpuResult(Result):
    """Result whose times are those of the processor, which other programs do not lengthen."""

    def now(self) -> float:
        """Return the time that the processor has spent on this program [s]."""
        return time.process_time()
