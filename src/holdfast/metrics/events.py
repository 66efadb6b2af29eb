"""Metrics by event: was the loss of stability told, how late, and how often for nothing.

A sample's label and decided state hold until the next sample; those of the last sample hold
for the median step in time.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE, ContactState
from holdfast.metrics.decisions import Codes, check_lengths, check_times
from holdfast.metrics.masks import runs
from holdfast.metrics.statistics import finite_or_none, percent, quantile
from holdfast.sensors.types import Array

MIN_EVENT_DURATION = 0.05
"""A run of not-stable labels of at least this [s] is an event."""

MIN_GAP_DURATION = 0.1
"""Gaps between not-stable labels shorter than this [s] are closed first."""

MIN_STABLE_DURATION = 0.5
"""An event comes right after at least this [s] of unbroken stable labels."""

EARLY_TOLERANCE = 0.02
"""An alarm may come this [s] before the onset and still belong to the event."""

LATE_TOLERANCE = 0.25
"""An alarm may come this [s] after the end and still belong to the event."""

POST_DURATIONS = (0.05, 0.1, 0.2)
"""An event is missed at `post` where no alarm came until onset + post [s]."""

TIME_TOLERANCE = 1e-6
"""Times that differ by less [s] are equal: what times in float64 lose by subtraction."""


class InstabilityEvent(NamedTuple):
    """The onset of instability in a held contact.

    Attributes:
        onset: time of the first not-stable label [s].
        end: time of the first label after the run [s].
        alarm: time of the first alarm that belongs to it [s]; None where it was missed.
    """

    onset: float
    end: float
    alarm: float | None = None

    @property
    def delay(self) -> float:
        """Alarm minus onset [s], at least -0.02; infinite where it was missed."""
        return math.inf if self.alarm is None else self.alarm - self.onset


class FalseAlarm(NamedTuple):
    """An alarm that belongs to no event.

    Attributes:
        time: of the alarm [s].
        label: the label's state at that time; UNKNOWN where there is none.
    """

    time: float
    label: ContactState


@dataclass(frozen=True)
class AlarmMatch:
    """The events and alarms of one finger, or hand, in one recording.

    Attributes:
        events: in order of time, each with its alarm.
        false_alarms: in order of time.
        stable_seconds: how long the label is stable [s].
    """

    events: tuple[InstabilityEvent, ...]
    false_alarms: tuple[FalseAlarm, ...]
    stable_seconds: float

    def n_missed(self, post: float) -> int:
        """Events without an alarm until onset + post."""
        return sum(event.delay > post + TIME_TOLERANCE for event in self.events)


class EventMetrics(msgspec.Struct, frozen=True):
    """How well the onsets of instability were told.

    Attributes:
        n_events: how many there were.
        stable_minutes: how long the label was stable [min].
        missed: for each `post` [s], the share of events without an alarm until onset + post
            [%]; None without events.
        delay_median: of alarm minus onset over all events, a miss counting as infinite [s];
            None where it is infinite, or without events.
        delay_p95: the 95th percentile of the same.
        false_alarms_per_minute: false alarms per minute of stable label; None without any.
        false_alarms: how many false alarms came under each label; UNKNOWN for none.
    """

    n_events: int
    stable_minutes: float
    missed: dict[str, float | None]
    delay_median: float | None
    delay_p95: float | None
    false_alarms_per_minute: float | None
    false_alarms: dict[str, int]


def event_metrics(
    times: npt.ArrayLike, labels: npt.ArrayLike, states: npt.ArrayLike
) -> EventMetrics:
    """How well the onsets of instability were told in one recording.

    `match_alarms` has the definitions, `pool_events` does the same for many recordings.

    Args:
        times: (n,) strictly increasing [s].
        labels: (n,) codes of the labels' states; UNKNOWN where there is none.
        states: (n,) codes of the decided states.

    Raises:
        ValueError: the shapes differ, or the times do not increase.

    Example:
        >>> times = np.arange(200) * 0.01
        >>> labels = np.where(times < 0.995, STABLE, UNSTABLE)
        >>> states = np.where(times < 1.025, STABLE, UNSTABLE)
        >>> metrics = event_metrics(times, labels, states)
        >>> metrics.n_events, round(metrics.delay_median, 6), metrics.missed["0.05"]
        (1, 0.03, 0.0)
    """
    return pool_events([match_alarms(times, labels, states)])


def match_alarms(times: npt.ArrayLike, labels: npt.ArrayLike, states: npt.ArrayLike) -> AlarmMatch:
    """The events of one recording, each with its alarm, and the false alarms.

    An event is a run of not-stable labels (UNSTABLE or NO_CONTACT) of at least 0.05 s, gaps
    under 0.1 s closed, that follows at once on at least 0.5 s of unbroken stable labels. An
    alarm is a change of the decided state from STABLE, at one sample, to UNSTABLE or
    NO_CONTACT at the next. It belongs to the event where

        onset - 0.02 s <= alarm <= end + 0.25 s

    and to no other: to the one with the latest onset, should there be two. The first alarm of
    an event counts, its others count nowhere; an alarm that belongs to no event is false.

    Args:
        times: (n,) strictly increasing [s].
        labels: (n,) codes of the labels' states; UNKNOWN where there is none.
        states: (n,) codes of the decided states.

    Raises:
        ValueError: the shapes differ, or the times do not increase.

    Example:
        >>> times = np.arange(200) * 0.01
        >>> labels = np.where(times < 0.995, STABLE, UNSTABLE)
        >>> states = np.where(times < 1.025, STABLE, UNSTABLE)
        >>> event, = match_alarms(times, labels, states).events
        >>> [round(time, 2) for time in event]
        [1.0, 2.0, 1.03]
    """
    time = np.asarray(times, dtype=np.float64)
    label, state = np.asarray(labels, dtype=np.int8), np.asarray(states, dtype=np.int8)
    check_lengths(times=time, labels=label, states=state)
    check_times(time)
    stable = _spans(label == STABLE, time)
    onsets, ends = _events(_spans(_not_stable(label), time), stable)
    alarms = np.flatnonzero((state[:-1] == STABLE) & _not_stable(state[1:])) + 1
    owners = _owners(time[alarms], onsets, ends)
    false = alarms[owners < 0]
    return AlarmMatch(
        _with_alarms(onsets, ends, time[alarms], owners),
        tuple(FalseAlarm(float(time[k]), _STATES[label[k]]) for k in false),
        float((stable[:, 1] - stable[:, 0]).sum()),
    )


def pool_events(matches: Sequence[AlarmMatch]) -> EventMetrics:
    """The event metrics over many recordings, or fingers; events never cross from one to another.

    Args:
        matches: one for each recording, from `match_alarms`.

    Example:
        >>> hit = AlarmMatch((InstabilityEvent(1.0, 1.2, 1.03),), (), 60.0)
        >>> miss = AlarmMatch((InstabilityEvent(2.0, 2.5),), (), 60.0)
        >>> metrics = pool_events([hit, miss])
        >>> metrics.missed["0.2"], metrics.delay_median, metrics.stable_minutes
        (50.0, None, 2.0)
    """
    delays = event_delays(matches)
    minutes = sum(match.stable_seconds for match in matches) / 60
    under = [alarm.label for match in matches for alarm in match.false_alarms]
    return EventMetrics(
        n_events=len(delays),
        stable_minutes=minutes,
        missed={
            str(post): percent(sum(match.n_missed(post) for match in matches), len(delays))
            for post in POST_DURATIONS
        },
        delay_median=finite_or_none(quantile(delays, 0.5)),
        delay_p95=finite_or_none(quantile(delays, 0.95)),
        false_alarms_per_minute=len(under) / minutes if minutes else None,
        false_alarms={str(state): under.count(state) for state in ContactState},
    )


def event_delays(matches: Sequence[AlarmMatch]) -> Array:
    """Delays of all events in ascending order [s]; infinite for a miss."""
    return np.sort(np.array([event.delay for match in matches for event in match.events]))


_STATES = tuple(ContactState)


def _not_stable(codes: Codes) -> npt.NDArray[np.bool_]:
    return np.isin(codes, (UNSTABLE, NO_CONTACT))


def _spans(mask: npt.NDArray[np.bool_], times: Array) -> Array:
    """(m, 2) start and end [s] of each unbroken run of True."""
    period = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    instants = np.append(times, times[-1:] + period)
    return instants[runs(mask)]


def _events(unstable: Array, stable: Array) -> tuple[Array, Array]:
    """Onsets and ends [s] of the not-stable runs that are events."""
    wide = unstable[1:, 0] - unstable[:-1, 1] >= MIN_GAP_DURATION - TIME_TOLERANCE
    first, last = np.append(True, wide)[: len(unstable)], np.append(wide, True)[: len(unstable)]
    onsets, ends = unstable[first, 0], unstable[last, 1]
    long_stable = stable[stable[:, 1] - stable[:, 0] >= MIN_STABLE_DURATION - TIME_TOLERANCE]
    chosen = (ends - onsets >= MIN_EVENT_DURATION - TIME_TOLERANCE) & np.isin(
        onsets, long_stable[:, 1]
    )
    return onsets[chosen], ends[chosen]


def _owners(alarms: Array, onsets: Array, ends: Array) -> npt.NDArray[np.intp]:
    """The place of the event that each alarm belongs to; -1 for a false alarm."""
    latest = np.searchsorted(onsets - EARLY_TOLERANCE - TIME_TOLERANCE, alarms, side="right") - 1
    limits = np.append(ends, -np.inf) + LATE_TOLERANCE + TIME_TOLERANCE
    return np.where(alarms <= limits[latest], latest, -1)


def _with_alarms(
    onsets: Array, ends: Array, alarms: Array, owners: npt.NDArray[np.intp]
) -> tuple[InstabilityEvent, ...]:
    first: dict[int, float] = {}
    for owner, alarm in zip(owners.tolist(), alarms.tolist(), strict=True):
        first.setdefault(owner, alarm)
    spans = zip(onsets.tolist(), ends.tolist(), strict=True)
    return tuple(InstabilityEvent(*span, first.get(k)) for k, span in enumerate(spans))
