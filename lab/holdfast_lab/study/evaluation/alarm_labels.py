"""Labels of a hand by which its alarms are counted, for each reading of a glitch.

The paper counts the detection of a glitch of the hand's controller as a success. For a user it is
a false alarm, because nothing but the hand itself moved the object. So every table of events has
both readings. In a third one glitches are left out.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from holdfast.contact import STABLE
from holdfast.metrics import FingerDecisions
from holdfast.metrics.alarms import outside
from holdfast.metrics.events import LabelledEvents, alarm_windows
from holdfast.metrics.masks import Mask, runs
from holdfast.metrics.slip_truth import sample_durations

EVENT = "an event"
FALSE_ALARM = "a false alarm"
LEFT_OUT = "left out"
READINGS = (EVENT, FALSE_ALARM, LEFT_OUT)
"""Readings by the words that stand for them in tables, under "a glitch is"."""


@dataclass(frozen=True, eq=False)
class AlarmLabels:
    """Labels by which the alarms of a hand, or a finger, are counted.

    Attributes:
        events: label codes, and the events in them.
        glitch: (n,) samples at which an alarm is one of a glitch.
        left_out: (n,) samples at which neither an alarm nor a stable label is counted.
    """

    events: LabelledEvents
    glitch: Mask
    left_out: Mask

    @cached_property
    def stable(self) -> Mask:
        """(n,) stable labels."""
        return np.asarray(self.events.labels == STABLE)

    @cached_property
    def counted_seconds(self) -> float:
        """Duration of the stable labels at which alarms are counted [s].

        Time in which no alarm is counted must not dilute the rate of the others.
        """
        left_out = sample_durations(self.events.times)[self.stable & self.left_out]
        return self.events.stable_seconds - float(left_out.sum())


def labels_by_reading(event: FingerDecisions, calm: FingerDecisions) -> dict[str, AlarmLabels]:
    """Return the labels of a hand for each of `READINGS`.

    Args:
        event: exact labels, in which a glitch is unstable.
        calm: the same, in which a glitch is stable, unless something else happens.
    """
    glitch = runs(event.labels != calm.labels)
    ends = event.times + sample_durations(event.times)
    spans = np.column_stack([event.times[glitch[:, 0]], ends[glitch[:, 1] - 1]])
    near = ~outside(event.times, alarm_windows(spans))
    nowhere = np.zeros_like(near)
    of_calm = LabelledEvents.of(calm.times, calm.labels)
    return {
        EVENT: AlarmLabels(LabelledEvents.of(event.times, event.labels), near, nowhere),
        FALSE_ALARM: AlarmLabels(of_calm, near, nowhere),
        LEFT_OUT: AlarmLabels(of_calm, nowhere, near),
    }
