"""A recording as a source: at its own pace, faster, or as fast as it is taken."""

from collections.abc import Iterable
from pathlib import Path

from holdfast.io import read_chunks
from holdfast.recordings import Recording
from holdfast.sources.player import Player

PIECE = 1024
"""Samples of a module that are read at a time: bounds the memory."""


class Replay(Player):
    """A recording, as if it came now.

    Its markers are told as notices. One that was cut off is played as far as it goes.

    Args:
        path: of the recording.
        speed: 1 is real time, 2 twice as fast, 0 as fast as samples are taken.
        loop: when it is over it begins anew; time goes on.

    Raises:
        ValueError: a speed that is negative or not finite.

    Example:
        >>> with Replay("grasp.parquet", speed=0) as source:  # doctest: +SKIP
        ...     print(sum(len(arrival.samples) for arrival in source))
    """

    def __init__(self, path: str | Path, *, speed: float = 1.0, loop: bool = False) -> None:
        super().__init__(str(path), speed=speed, loop=loop)

    def _begin(self, number: int) -> Iterable[Recording]:
        pieces = read_chunks(self.name, PIECE, labels=False)
        if number:
            self._notices.append(f"{self.name} begins anew")
        return pieces

    def _metadata(self, first: Recording) -> dict[str, object]:
        """The recording's own, under the source that it is played from now."""
        own = dict(first.metadata)
        recorded_from = {"recorded_from": own["source"]} if "source" in own else {}
        return own | recorded_from | {"source": self.name}
