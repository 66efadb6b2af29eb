"""A recording as a source: at its own pace, faster, or as fast as it is taken."""

from holdfast.sources.source import Arrival, Source


class Replay(Source):
    """A recording, as if it came now."""

    def __init__(self, path: str, *, speed: float = 1.0, loop: bool = False) -> None:
        raise NotImplementedError

    def open(self) -> None:
        """Reads its beginning."""

    def read(self, timeout: float) -> Arrival | None:
        """What arrived next."""

    def close(self) -> None:
        """Closes the file."""
