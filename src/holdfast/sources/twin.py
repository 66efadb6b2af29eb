"""The twin as a source: a grasp that is simulated, then replayed."""

from holdfast.sources.source import Arrival, Source
from holdfast.sources.uri import Address


class Twin(Source):
    """A grasp of the twin, as if it came now."""

    def __init__(self, address: Address, *, speed: float = 1.0, loop: bool = False) -> None:
        raise NotImplementedError

    def open(self) -> None:
        """Simulates the grasp."""

    def read(self, timeout: float) -> Arrival | None:
        """What arrived next."""

    def close(self) -> None:
        """Forgets it."""
