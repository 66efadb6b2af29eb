"""What every source is: a context manager that gives samples with their times."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from holdfast.contact import Fault
from holdfast.sensors import Sensor

PATIENCE = 0.5
"""How long iterating waits for a packet before it looks again [s]."""


class Arrival(NamedTuple):
    """What came from a source: the samples of one instant, or word of a fault, or both.

    Attributes:
        time: of the samples, on the clock of the source [s]; later than that of every arrival
            with samples before. Without samples, NaN.
        samples: (n_taxels, 3) by module, of those that have a sample at that instant; not to
            be written to, and not written to again by the source.
        received: when the last byte was in hand, by `time.monotonic` [s].
        faults: of each module, what is wrong with how it arrives (`TAXEL_COUNT`,
            `PACKET_GAP`, `LATE`, `CLOCK_JUMP`); until the next arrival that holds the module,
            or names it here.
        n_lost: packets that are missing before this one, by the device's own count.
        n_refused: packets that were dropped since the last arrival because they make no sense.
        notices: what a person should know, a line each.
    """

    time: float
    samples: Mapping[str, npt.NDArray[Any]]
    received: float
    faults: Mapping[str, tuple[Fault, ...]] = {}
    n_lost: int = 0
    n_refused: int = 0
    notices: tuple[str, ...] = ()


class Source(ABC):
    """A device, a recording or the twin: anything that gives samples of a hand.

    It is a context manager. Entering connects, and waits until the modules are known. It is
    for one thread. A device that falls silent or goes away is waited for, reconnected to, and
    told about in arrivals without samples; only entering raises.

    Attributes:
        name: what it was asked for by.
        sensors: of each module; known once it is open.
        metadata: of a recording made from it (`source`, `hand`, ...); plain JSON values.
        paced: whether samples come as time goes by; False where they come as fast as they are
            taken.
        speed: how fast its time goes by; 1 is real time, 0 as fast as samples are taken.

    Example:
        >>> from holdfast.sources import open_source
        >>> with open_source("grasp.parquet", speed=0) as source:  # doctest: +SKIP
        ...     for arrival in source:
        ...         print(arrival.time, list(arrival.samples))

        To detect contact states, use `holdfast.StreamDetector`: it also resamples, and handles
        faults and modules that the model does not use.
    """

    name: str = ""
    sensors: Mapping[str, Sensor] = {}
    metadata: Mapping[str, Any] = {}
    paced: bool = True
    speed: float = 1.0

    @abstractmethod
    def open(self) -> None:
        """Connects, and waits until the modules are known.

        Raises:
            SourceError: it cannot be reached, says nothing, or not what is expected.
        """

    @abstractmethod
    def read(self, timeout: float) -> Arrival | None:
        """What arrived next, or None where nothing did within `timeout` [s] or it has ended."""

    @property
    def ended(self) -> bool:
        """Whether nothing will come any more; a device never ends."""
        return False

    @abstractmethod
    def close(self) -> None:
        """Lets go of the device; again, it does nothing."""

    def __iter__(self) -> Iterator[Arrival]:
        """Everything that arrives, until the source ends."""
        while not self.ended:
            arrival = self.read(PATIENCE)
            if arrival is not None:
                yield arrival

    def __enter__(self) -> Self:
        try:
            self.open()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def notice_arrival(
    received: float,
    *notices: str,
    faults: Mapping[str, tuple[Fault, ...]] | None = None,
    n_refused: int = 0,
) -> Arrival:
    """An arrival without samples."""
    return Arrival(np.nan, {}, received, faults or {}, n_refused=n_refused, notices=notices)
