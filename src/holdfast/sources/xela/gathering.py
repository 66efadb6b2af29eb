"""Samples that come module by module, gathered as a server tells them: all modules at a time."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy.typing as npt

PATIENCE = 1.0
"""So long a module is waited for that has had no sample yet, by the times of the source [s]."""


class Gathered(NamedTuple):
    """What is told at a time.

    Attributes:
        samples: the newest of each module.
        time: of the newest of them [s].
        times: of each module's.
    """

    samples: Mapping[str, npt.NDArray[Any]]
    time: float
    times: Mapping[str, float]


class Gathering:
    """Gathers samples, so that whoever comes anew learns of all modules from one packet.

    Where modules have stamps of their own, each sample is told at once, beside the last ones
    of the others. Else the others' would look new: samples wait until every module has one, or
    one has the next.

    Args:
        modules: that there are.
        own_stamps: whether each is told with its own time.

    Example:
        >>> gathering = Gathering(("a", "b"), own_stamps=False)
        >>> [len(list(gathering.add({name: None}, t))) for t, name in enumerate("abba")]
        [0, 1, 0, 1]
    """

    def __init__(self, modules: Iterable[str], *, own_stamps: bool) -> None:
        self._modules = frozenset(modules)
        self._own_stamps = own_stamps
        self._samples: dict[str, npt.NDArray[Any]] = {}
        self._times: dict[str, float] = {}
        self._fresh: set[str] = set()
        self._began: float | None = None

    def add(self, samples: Mapping[str, npt.NDArray[Any]], time: float) -> Iterator[Gathered]:
        """Takes the samples of an instant [s]; what is to be told then, oldest first."""
        if self._began is None:
            self._began = time
        if not self._own_stamps and not self._fresh.isdisjoint(samples):
            yield from self.rest()
        self._samples.update(samples)
        self._times.update(dict.fromkeys(samples, time))
        self._fresh.update(samples)
        if self._own_stamps or self._fresh >= self._expected(time):
            yield from self.rest()

    def rest(self) -> Iterator[Gathered]:
        """What was not told yet, once every module is there."""
        newest = max(self._times.values(), default=0.0)
        if self._fresh and self._samples.keys() >= self._expected(newest):
            self._fresh.clear()
            yield Gathered(dict(self._samples), newest, dict(self._times))

    def _expected(self, time: float) -> frozenset[str]:
        """Modules without which nothing is told: all, but later only those that were there."""
        if self._began is None or time - self._began < PATIENCE:
            return self._modules
        return frozenset(self._samples)
