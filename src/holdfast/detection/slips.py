"""Slips in a stream of estimates: when each began and ended, and how far the finger slid."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from holdfast.contact import Cause, ContactEstimate


class DetectedSlip(NamedTuple):
    """Time in which a finger was decided to slide.

    Attributes:
        finger: name of the finger.
        begin: time of the first sample that slides [s].
        end: time of the first sample after them that does not [s]; None while it slides.
        max_probability: largest probability of a slip within that time.
        distance: slid within that time [mm]; None for a model without a speed rule.
    """

    finger: str
    begin: float
    end: float | None
    max_probability: float
    distance: float | None = None


def slides(estimate: ContactEstimate) -> bool:
    """Return whether a slip rule decided that the finger slides.

    Without a slip rule the cause `slip` is only the likely cause of an UNSTABLE contact.
    """
    return estimate.slip_probability is not None and estimate.cause is Cause.SLIP


class SlipWatch:
    """Find the slips in the estimates of several fingers. It keeps one slip for each finger.

    Attributes:
        has_rule: whether any estimate was made with a slip rule.

    Example:
        >>> from holdfast.contact import ContactState, Reason
        >>> def estimate(time, probability, cause=None):
        ...     return ContactEstimate(
        ...         time, ContactState.STABLE, Reason.NONE, 0.9, 1.0, (1.0, 0.0, 0.0),
        ...         cause=cause, slip_probability=probability,
        ...     )
        >>> watch = SlipWatch()
        >>> slip = [estimate(0.0, 0.7, Cause.SLIP), estimate(0.1, 0.9, Cause.SLIP)]
        >>> changes = watch.update("thumb", [*slip, estimate(0.2, 0.1)])
        >>> [(slip.begin, slip.end, slip.max_probability) for slip in changes]
        [(0.0, None, 0.7), (0.0, 0.2, 0.9)]
    """

    def __init__(self) -> None:
        self.has_rule = False
        self._running: dict[str, DetectedSlip] = {}

    @property
    def running(self) -> list[DetectedSlip]:
        """Slips that have not ended."""
        return list(self._running.values())

    def update(self, finger: str, estimates: Iterable[ContactEstimate]) -> Iterator[DetectedSlip]:
        """Yield each slip when it begins, without an end, and again when it has ended."""
        for estimate in estimates:
            probability = estimate.slip_probability
            # One finger with a rule is enough: the others may have none.
            self.has_rule |= probability is not None
            slip = self._running.get(finger)
            if probability is not None and slides(estimate):
                begins = slip is None
                if slip is None:
                    slip = DetectedSlip(finger, estimate.time, None, probability)
                largest = max(probability, slip.max_probability)
                # Kept up to date while it runs: a page shows it before it has ended.
                slip = slip._replace(max_probability=largest, distance=estimate.slip_distance)
                self._running[finger] = slip
                if begins:
                    yield slip
            elif slip is not None:
                yield self._running.pop(finger)._replace(end=estimate.time)
