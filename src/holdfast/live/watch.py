"""A source read for a judge, turn by turn, and whether samples still come."""

import time

from holdfast.live.judge import Decision, Judge
from holdfast.sources import Arrival, Source


class Watch:
    """Reads a source for a judge; it blocks for as long as silence takes to be one.

    Silent is a source without samples of a judged finger, whatever else it says: a device that
    sends nonsense must not leave a finger STABLE.

    Args:
        source: that is open.
        judge: of its samples.

    Attributes:
        silent: whether no samples come.
    """

    def __init__(self, source: Source, judge: Judge) -> None:
        self._source = source
        self._judge = judge
        self._slowness = 1 / min(source.speed or 1.0, 1.0)
        self._heard_at = time.monotonic()
        self.silent = False

    def turn(self) -> tuple[Arrival | None, list[Decision]]:
        """What came, where something did, and what is said to it, or to silence once."""
        silence = self._judge.silence * self._slowness
        arrival = self._source.read(silence)
        decisions = [] if arrival is None else self._judge.take(arrival)
        if arrival is not None and not self._judge.fingers.keys().isdisjoint(arrival.samples):
            self.silent = False
            self._heard_at = time.monotonic()
        elif not (self.silent or self._source.ended) and self._is_over(arrival, silence):
            self.silent = True
            said = self._judge.silent()
            decisions += [said] if said else []
        return arrival, decisions

    def _is_over(self, arrival: Arrival | None, silence: float) -> bool:
        """Whether nothing came, or only words for too long."""
        return arrival is None or time.monotonic() - self._heard_at >= silence
