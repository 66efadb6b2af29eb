"""Metrics by event: missed events, detection delays and false alarms.

The label and the decided state of a sample last until the next sample; those of the last sample
last for the median interval between samples.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import (
    LABEL_STATES,
    NO_CONTACT,
    STABLE,
    TIME_TOLERANCE,
    UNKNOWN,
    UNSTABLE,
    ContactState,
)
from holdfast.metrics.alarms import first_alarms, outside
from holdfast.metrics.decisions import Codes, FingerDecisions, check_lengths, check_times
from holdfast.metrics.masks import Mask, runs
from holdfast.metrics.statistics import finite_or_none, percent, quantile
from holdfast.metrics.truth_labels import Onsets, common_onsets
from holdfast.sensors.types import Array

MIN_EVENT_DURATION = 0.05
"""Minimum duration of the not-stable labels of an event [s]."""

MIN_GAP_DURATION = 0.1
"""Shorter gaps between not-stable labels are closed first [s]."""

MIN_STABLE_DURATION = 0.5
"""Minimum duration of unbroken stable labels directly before an event [s]."""

EARLY_TOLERANCE = 0.02
"""Maximum time of an alarm before the onset of its event [s]: three samples at 150 Hz."""

LATE_TOLERANCE = 0.25
"""Maximum time of an alarm after the end of its event [s]."""

POST_DURATIONS = (0.05, 0.1, 0.2)
"""Values of `post` [s]: an event is missed at `post` without an alarm until onset + post."""


class InstabilityEvent(NamedTuple):
    """The onset of instability in a held contact.

    Attributes:
        onset: time of the first not-stable label [s].
        end: time of the first label after the not-stable labels [s].
        alarm: time of the first alarm that belongs to the event [s]; None if it was missed.
    """

    onset: float
    end: float
    alarm: float | None = None

    @property
    def delay(self) -> float:
        """Detection delay [s]: alarm minus onset, at least -0.02; infinite for a missed event."""
        return math.inf if self.alarm is None else self.alarm - self.onset


class FalseAlarm(NamedTuple):
    """An alarm in labelled time that belongs to no event.

    Attributes:
        time: of the alarm [s].
        label: labelled state at that time.
    """

    time: float
    label: ContactState


class HeldTime(NamedTuple):
    """Decisions while a contact is held: its label is STABLE or UNSTABLE.

    Attributes:
        seconds: duration [s].
        unstable_seconds: time of these that is decided as UNSTABLE [s].
        n_rises: changes of the decision to UNSTABLE outside disturbances: the label is STABLE, and
            no alarm here would belong to a run of not-stable labels.
    """

    seconds: float = 0.0
    unstable_seconds: float = 0.0
    n_rises: int = 0

    @classmethod
    def total(cls, parts: Sequence[Self]) -> Self:
        """Return the sums over all parts."""
        return cls(*map(sum, zip(*parts, strict=True)))


NO_HELD_TIME = HeldTime()


@dataclass(frozen=True)
class AlarmMatch:
    """Events and alarms of one finger, or hand, in one recording.

    Attributes:
        events: in order of time, each with its alarm.
        false_alarms: in order of time.
        stable_seconds: duration of stable labels [s].
        onsets: where the labels come from in which the events were found.
        n_unlabelled: number of other alarms, where nothing is labelled: neither true nor false.
        held: time that is UNSTABLE, and rises to it, in held contact.
    """

    events: tuple[InstabilityEvent, ...]
    false_alarms: tuple[FalseAlarm, ...]
    stable_seconds: float
    onsets: Onsets = "labels"
    n_unlabelled: int = 0
    held: HeldTime = NO_HELD_TIME


@dataclass(frozen=True, eq=False)
class EventCounts:
    """Counts of the events and alarms of one finger, or hand, in one or more recordings.

    Attributes:
        delays: (n_events,) in ascending order [s]; infinite for a missed event.
        false_alarms: number of false alarms by labelled state.
        stable_seconds: duration of stable labels [s].
        onsets: where the onsets come from; empty without recordings.
        n_unlabelled: number of alarms where nothing is labelled.
        held: time that is UNSTABLE, and rises to it, in held contact.
    """

    delays: Array
    false_alarms: Mapping[ContactState, int]
    stable_seconds: float
    onsets: frozenset[Onsets]
    n_unlabelled: int
    held: HeldTime

    @classmethod
    def of(cls, match: AlarmMatch) -> Self:
        """Return the counts of one recording."""
        labels = [alarm.label for alarm in match.false_alarms]
        return cls(
            event_delays([match]),
            {state: labels.count(state) for state in LABEL_STATES},
            match.stable_seconds,
            frozenset({match.onsets}),
            match.n_unlabelled,
            match.held,
        )

    @classmethod
    def total(cls, parts: Sequence[Self]) -> Self:
        """Return the counts of all parts together."""
        return cls(
            np.sort(np.concatenate([np.empty(0), *(part.delays for part in parts)])),
            {state: sum(part.false_alarms[state] for part in parts) for state in LABEL_STATES},
            sum(part.stable_seconds for part in parts),
            frozenset[Onsets]().union(*(part.onsets for part in parts)),
            sum(part.n_unlabelled for part in parts),
            HeldTime.total([NO_HELD_TIME, *(part.held for part in parts)]),
        )

    @property
    def n_false(self) -> int:
        """Number of false alarms."""
        return sum(self.false_alarms.values())

    def n_missed(self, post: float) -> int:
        """Return the number of events without an alarm until onset + post [s]."""
        return int((self.delays > post + TIME_TOLERANCE).sum())


class EventMetrics(msgspec.Struct, frozen=True):
    """Metrics of the detection of the onsets of instability.

    Attributes:
        n_events: number of events.
        stable_minutes: duration of stable labels [min].
        missed: for each `post` [s], the percentage of events without an alarm until
            onset + post [%]; None without events.
        delay_median: median of alarm minus onset over all events; a missed event counts as
            infinite [s]. None if it is infinite, or without events.
        delay_p95: 95th percentile of the same.
        false_alarms_per_minute: per minute of stable label; None without stable labels.
        false_alarms: number of false alarms by labelled state.
        onsets: `truth` where the recordings have it, else `labels`; `mixed` if some have it;
            `rule` if a rule made labels of one.
        unlabelled_alarms: number of alarms where nothing is labelled: neither true nor false.
        held_unstable: share of held time (labels STABLE and UNSTABLE) that is decided as
            UNSTABLE [%]; None without held time.
        rises_per_minute: changes to UNSTABLE outside disturbances, per minute of held time; None
            without held time.
    """

    n_events: int
    stable_minutes: float
    missed: dict[str, float | None]
    delay_median: float | None
    delay_p95: float | None
    false_alarms_per_minute: float | None
    false_alarms: dict[str, int]
    onsets: Onsets = "labels"
    unlabelled_alarms: int = 0
    held_unstable: float | None = None
    rises_per_minute: float | None = None


def event_metrics(
    times: npt.ArrayLike, labels: npt.ArrayLike, states: npt.ArrayLike
) -> EventMetrics:
    """Compute the event metrics of one recording.

    `match_alarms` has the definitions. `pool_events` does the same for several recordings.

    Args:
        times: (n,) strictly increasing [s].
        labels: (n,) codes of the labelled states; UNKNOWN without a label.
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
    """Return the events of one recording, each with its alarm, and the false alarms.

    An event is a run of not-stable labels (UNSTABLE or NO_CONTACT) of at least 0.05 s, after
    gaps under 0.1 s are closed. It directly follows at least 0.5 s of unbroken stable labels.
    An alarm is a change of the decided state from STABLE at one sample to UNSTABLE or
    NO_CONTACT at the next. It belongs to the event for which

        onset - 0.02 s <= alarm <= end + 0.25 s

    The first alarm of an event counts; its other alarms are ignored. An alarm that belongs to no
    event is a false alarm; where nothing is labelled it is neither true nor false, and counted
    apart.

    Args:
        times: (n,) strictly increasing [s].
        labels: (n,) codes of the labelled states; UNKNOWN without a label.
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
    return LabelledEvents.of(times, labels).match(states)


@dataclass(frozen=True, eq=False)
class LabelledEvents:
    """The events in the labels of one finger, or hand, in one recording; see `match_alarms`.

    States at many thresholds are matched with the same events.

    Attributes:
        times: (n,) [s].
        labels: (n,) codes.
        events: (n_events, 2) onset and end [s].
        stable_seconds: duration of stable labels [s].
        is_held: (n,) labels STABLE and UNSTABLE.
        held_seconds: duration of these labels [s].
        is_calm: (n,) stable labels at which no alarm would belong to a run of not-stable labels.
        instants: (n + 1,) the times, and the end of the last sample [s].
    """

    times: Array
    labels: Codes
    events: Array
    stable_seconds: float
    is_held: Mask
    held_seconds: float
    is_calm: Mask
    instants: Array

    @classmethod
    def of(cls, times: npt.ArrayLike, labels: npt.ArrayLike) -> Self:
        """Find the events in labels.

        Raises:
            ValueError: the shapes differ, or the times do not increase.
        """
        time, label = np.asarray(times, dtype=np.float64), np.asarray(labels, dtype=np.int8)
        check_lengths(times=time, labels=label)
        check_times(time)
        period = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
        instants = np.append(time, time[-1:] + period)
        is_held = np.isin(label, (STABLE, UNSTABLE))
        stable, unstable = instants[runs(label == STABLE)], instants[runs(_not_stable(label))]
        # Gaps are closed before the runs are measured: a shake that leaves the finger for a moment
        # is one event, and its parts alone would be too short. So the end of a run counts only if
        # the next begins late enough, and the beginning only if the run before ended early enough.
        wide = unstable[1:, 0] - unstable[:-1, 1] >= MIN_GAP_DURATION - TIME_TOLERANCE
        first, last = np.append(True, wide)[: len(unstable)], np.append(wide, True)[: len(unstable)]
        onsets, ends = unstable[first, 0], unstable[last, 1]
        # An alarm needs a detector that was STABLE before, so an event needs a hold in which it can
        # be.
        held = stable[stable[:, 1] - stable[:, 0] >= MIN_STABLE_DURATION - TIME_TOLERANCE]
        is_long = ends - onsets >= MIN_EVENT_DURATION - TIME_TOLERANCE
        return cls(
            time,
            label,
            np.column_stack([onsets, ends])[is_long & np.isin(onsets, held[:, 1])],
            _seconds(stable),
            is_held,
            _seconds(instants[runs(is_held)]),
            (label == STABLE) & outside(time, alarm_windows(unstable)),
            instants,
        )

    def match(self, states: npt.ArrayLike) -> AlarmMatch:
        """Return the events, each with its alarm, and the false alarms of (n,) decided states.

        Raises:
            ValueError: the shapes differ.
        """
        state = np.asarray(states, dtype=np.int8)
        check_lengths(times=self.times, labels=self.labels, states=state)
        windows, alarms = alarm_windows(self.events), alarm_indices(state)
        first = first_alarms(self.times, alarms, windows)[0]
        others = alarms[outside(self.times, windows)[alarms]]
        # An alarm where nothing is labelled is neither right nor wrong.
        false = others[self.labels[others] != UNKNOWN]
        return AlarmMatch(
            tuple(
                InstabilityEvent(onset, end, alarm if math.isfinite(alarm) else None)
                for (onset, end), alarm in zip(self.events.tolist(), first.tolist(), strict=True)
            ),
            tuple(FalseAlarm(float(self.times[k]), _STATES[self.labels[k]]) for k in false),
            self.stable_seconds,
            n_unlabelled=len(others) - len(false),
            held=self._held_time(state == UNSTABLE),
        )

    def _held_time(self, is_unstable: Mask) -> HeldTime:
        rises = np.flatnonzero(is_unstable[1:] & ~is_unstable[:-1]) + 1
        unstable = self.instants[runs(self.is_held & is_unstable)]
        return HeldTime(self.held_seconds, _seconds(unstable), int(self.is_calm[rises].sum()))


def _seconds(spans: Array) -> float:
    return float((spans[:, 1] - spans[:, 0]).sum())


def alarm_windows(events: Array) -> Array:
    """Return the first and the last time of an alarm that belongs to each event [s].

    Windows do not overlap: at least 0.5 s of stable labels are between two events.

    Args:
        events: (n_events, 2) onset and end [s].
    """
    early, late = EARLY_TOLERANCE + TIME_TOLERANCE, LATE_TOLERANCE + TIME_TOLERANCE
    return np.asarray(events + np.array([-early, late]))


def match_decisions(finger: FingerDecisions) -> AlarmMatch:
    """Return the events and alarms of a finger, or hand; events by the exact labels, if known."""
    if finger.exact_labels is None:
        return match_alarms(finger.times, finger.labels, finger.states)
    return replace(
        match_alarms(finger.times, finger.exact_labels, finger.states), onsets=finger.onsets
    )


def alarm_indices(states: Codes) -> npt.NDArray[np.intp]:
    """Return the samples at which alarms come: not stable, right after a stable sample.

    Example:
        >>> alarm_indices(np.array([STABLE, UNSTABLE, UNSTABLE, STABLE, NO_CONTACT])).tolist()
        [1, 4]
    """
    return np.flatnonzero((states[:-1] == STABLE) & _not_stable(states[1:])) + 1


def pool_events(matches: Sequence[AlarmMatch]) -> EventMetrics:
    """Compute the event metrics of several recordings, or fingers, together.

    Args:
        matches: one for each recording, from `match_alarms`.

    Example:
        >>> hit = AlarmMatch((InstabilityEvent(1.0, 1.2, 1.03),), (), 60.0)
        >>> miss = AlarmMatch((InstabilityEvent(2.0, 2.5),), (), 60.0)
        >>> metrics = pool_events([hit, miss])
        >>> metrics.missed["0.2"], metrics.delay_median, metrics.stable_minutes
        (50.0, None, 2.0)
    """
    return event_metrics_of(EventCounts.total([EventCounts.of(match) for match in matches]))


def event_metrics_of(counts: EventCounts) -> EventMetrics:
    """Compute the event metrics from the counts of one or more recordings."""
    minutes = counts.stable_seconds / 60
    return EventMetrics(
        n_events=len(counts.delays),
        stable_minutes=minutes,
        missed={
            str(post): percent(counts.n_missed(post), len(counts.delays)) for post in POST_DURATIONS
        },
        delay_median=finite_or_none(quantile(counts.delays, 0.5)),
        delay_p95=finite_or_none(quantile(counts.delays, 0.95)),
        false_alarms_per_minute=counts.n_false / minutes if minutes else None,
        false_alarms={str(state): n for state, n in counts.false_alarms.items()},
        onsets=common_onsets(counts.onsets),
        unlabelled_alarms=counts.n_unlabelled,
        held_unstable=percent(counts.held.unstable_seconds, counts.held.seconds),
        rises_per_minute=counts.held.n_rises * 60 / counts.held.seconds
        if counts.held.seconds
        else None,
    )


def event_delays(matches: Sequence[AlarmMatch]) -> Array:
    """Return the delays of all events in ascending order [s]; infinite for a missed event."""
    return np.sort(np.array([event.delay for match in matches for event in match.events]))


_STATES = tuple(ContactState)


def _not_stable(codes: Codes) -> Mask:
    return np.asarray((codes == UNSTABLE) | (codes == NO_CONTACT))
