"""Audit of labels: find those that a cross-validated classifier contradicts with confidence."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise
from typing import Literal

import msgspec
import numpy as np

from holdfast.contact import TIME_TOLERANCE, UNKNOWN
from holdfast.detector.detection import STATE_BY_CODE
from holdfast.errors import TrainingError
from holdfast.features import parse_features
from holdfast.labelling.review.contradictions import (
    MAX_EDGE_SHIFT,
    Codes,
    Edge,
    confident_thresholds,
    contradictions,
    edges_of,
    unusual_shift,
    usual_shifts,
)
from holdfast.labelling.review.out_of_fold import MAX_AUDIT_FOLDS, out_of_fold
from holdfast.labelling.review.spans import Span, State, spans_of, state_name
from holdfast.recordings import Label, Recording, label_states
from holdfast.sensors.types import Array
from holdfast.training.setting import Setting

MIN_CONTRADICTION = 0.05
"""Shortest contradiction that is reported [s]."""

MAX_CLOSED_GAP = 0.05
"""Shorter gaps between contradictions are closed first [s]."""

EDGE_DISTANCE = 0.1
"""A contradiction this near to an edge, for the state beyond it, belongs to the edge [s]."""

MIN_EDGE_SHIFT = 0.1
"""Smallest shift of an edge that is reported [s]."""

EDGE_THRESHOLD_SHARE = 0.8
"""Share of a state's threshold that is enough at an edge, whose time comes from a likelihood."""


class Suspect(msgspec.Struct, frozen=True):
    """An interval whose label the classifier contradicts.

    Attributes:
        recording: name.
        finger: name.
        kind: `interval`, or `edge` for a label that seems to begin or end at another time.
        start: of the interval [s]; for an edge, the earlier of its present and expected times.
        end: of the interval [s].
        given: labelled state.
        expected: state by the classifier.
        confidence: mean probability of the expected state in the interval.
        shift: expected minus present time of an edge [s].
    """

    recording: str
    finger: str
    kind: Literal["interval", "edge"]
    start: float
    end: float
    given: State
    expected: State
    confidence: float
    shift: float | None = None

    @property
    def weight(self) -> float:
        """Confidence times duration [s]."""
        return self.confidence * (self.end - self.start)

    @property
    def rank(self) -> tuple[float, str, str, float]:
        """What suspects are sorted by: the largest weight first, and always in the same order."""
        return -self.weight, self.recording, self.finger, self.start


class Audit(msgspec.Struct, frozen=True):
    """Result of an audit; `msgspec.json.encode` gives the JSON.

    Attributes:
        n_recordings: number of recordings.
        judged: total duration of the labels that have probabilities, over all fingers [s].
        suspects: largest weight first.
    """

    n_recordings: int
    judged: float
    suspects: list[Suspect]


@dataclass(frozen=True, eq=False)
class LabelledFinger:
    """Labels of one finger in one recording, with probabilities out of fold.

    Attributes:
        recording: name.
        finger: name.
        labels: in order of time.
        times: (n,) of the samples [s].
        period: of the samples [s].
        probabilities: (n, 3) of no contact, unstable, stable; NaN if unknown.
    """

    recording: str
    finger: str
    labels: Sequence[Label]
    times: Array
    period: float
    probabilities: Array

    @cached_property
    def codes(self) -> Codes:
        """(n,) code of the labelled state of each sample."""
        return label_states(self.labels, self.times)

    @cached_property
    def bounds(self) -> Array:
        """(n + 1,) start of each sample, and end of the last [s]."""
        return np.append(self.times, self.times[-1:] + self.period)

    @property
    def audited_duration(self) -> float:
        """Total duration of the samples with a label and probabilities [s]."""
        known = (self.codes != UNKNOWN) & np.isfinite(self.probabilities).all(axis=1)
        return float(np.diff(self.bounds)[known].sum())

    def confidence(self, start: float, end: float, code: int) -> float:
        """Return the mean probability of a state in [start, end) [s]; 0 if it is unknown."""
        interval = (start - TIME_TOLERANCE, end - TIME_TOLERANCE)
        first, last = np.searchsorted(self.times, interval)
        values = self.probabilities[first:last, code - 1]
        values = values[np.isfinite(values)]
        return float(values.mean()) if len(values) else 0.0

    def suspect(
        self,
        kind: Literal["interval", "edge"],
        interval: tuple[float, float],
        codes: tuple[int, int],
        confidence: float,
        shift: float | None = None,
    ) -> Suspect:
        """Return a suspect of this finger, from the codes of its given and expected states."""
        given, expected = (state_name(STATE_BY_CODE[code]) for code in codes)
        return Suspect(
            self.recording, self.finger, kind, *interval, given, expected, confidence, shift
        )


def audit(
    recordings: Sequence[Recording],
    setting: Setting | None = None,
    *,
    n_folds: int = MAX_AUDIT_FOLDS,
    n_jobs: int = 1,
) -> Audit:
    """Find labels that a classifier contradicts with confidence.

    The classifier of a recording is trained on other recordings. Labels are compared with its
    probabilities sample by sample, by confident learning, and contradicted samples are joined to
    intervals. Edges of labels are compared as a whole: an edge is reported if its likeliest time,
    corrected by the usual shift of such edges, is 0.1 s or more from its present time. An error
    that the labels of all recordings have in common is not found.

    Args:
        recordings: labelled; may be a lazy dataset. Each is read more than once, one at a time;
            memory holds three probabilities per sample.
        setting: how to train; by default `default_setting` of the recordings.
        n_folds: largest number of groups of recordings that are held out in turn.
        n_jobs: number of parallel fits; -1 for the number of processors.

    Raises:
        TrainingError: there are no labels, only one state or recording, or no probabilities.
        RecordingError: a recording cannot be read.
        ModelError: a finger has different sensors in different recordings.
        ValueError: the split of the setting is random, or there are fewer than two folds.
    """
    setting = default_setting(recordings) if setting is None else setting
    parts = [
        LabelledFinger(recording.name, finger, m.labels, m.times, m.period, probabilities)
        for recording, found in out_of_fold(recordings, setting, n_folds=n_folds, n_jobs=n_jobs)
        for finger, probabilities in found.items()
        for m in [recording.modules[finger]]
    ]
    duration = sum(part.audited_duration for part in parts)
    if not duration:
        raise TrainingError(
            f"none of the labels of {len(recordings)} recordings can be audited: a finger needs "
            "two states, after tare and first window, in at least two recordings"
        )
    return Audit(len(recordings), duration, suspects(parts))


def default_setting(recordings: Sequence[Recording]) -> Setting:
    """Return how an audit trains: on holdfast's features for counts, on the paper's for newton.

    Holdfast's features locate edges much better (docs/study/labels-by-rules.md has figures); their
    scale is that of counts.
    """
    units = {m.unit for r in recordings[:1] for m in r.modules.values()}
    if units == {"count"}:
        return Setting(trials=0, features=parse_features("holdfast"))
    return Setting(trials=0)


def suspects(parts: Sequence[LabelledFinger]) -> list[Suspect]:
    """Return contradicted intervals and edges, largest weight first.

    Thresholds and usual shifts are computed for each finger over all recordings.

    Args:
        parts: labels of fingers, with probabilities out of fold.
    """
    by_finger = groupby(sorted(parts, key=lambda each: each.finger), lambda each: each.finger)
    found = [suspect for _, own in by_finger for suspect in _suspects_of_finger(list(own))]
    return sorted(found, key=lambda suspect: suspect.rank)


def _suspects_of_finger(parts: Sequence[LabelledFinger]) -> Iterator[Suspect]:
    thresholds = confident_thresholds(
        np.concatenate([part.codes for part in parts]),
        np.concatenate([part.probabilities for part in parts]),
    )
    spans = [spans_of(part.labels) for part in parts]
    edges = [
        list(edges_of(own, part.times, part.probabilities))
        for part, own in zip(parts, spans, strict=True)
    ]
    usual = usual_shifts([edge for own in edges for edge in own])
    for part, own_spans, own_edges in zip(parts, spans, edges, strict=True):
        shifted = [
            _shifted_edge(part, edge, unusual_shift(edge, usual[edge.change]), thresholds)
            for edge in own_edges
        ]
        # A shifted edge shows as a contradicted interval beside it, too: one of the two is enough,
        # so what lies half or more in a suspect of larger weight is left out.
        kept: list[Suspect] = []
        found = [*_intervals(part, own_spans, thresholds), *(edge for edge in shifted if edge)]
        for suspect in sorted(found, key=lambda suspect: suspect.rank):
            half = (suspect.end - suspect.start) / 2
            overlaps = (min(suspect.end, o.end) - max(suspect.start, o.start) for o in kept)
            if all(overlap < half for overlap in overlaps):
                kept.append(suspect)
        yield from kept


def _shifted_edge(
    part: LabelledFinger, edge: Edge, shift: float, thresholds: Array
) -> Suspect | None:
    """Return an edge as a suspect; None if its shift is small or its confidence low.

    The confidence is that between the present and the expected edge, delayed by the usual shift.
    """
    if abs(shift) < MIN_EDGE_SHIFT - TIME_TOLERANCE:
        return None
    # An edge that comes too late leaves samples of the state after it under the label before.
    given, expected = edge.change if shift < 0 else edge.change[::-1]
    start, end = sorted((edge.likeliest - shift, edge.likeliest))
    confidence = part.confidence(start, end, expected)
    if confidence < EDGE_THRESHOLD_SHARE * thresholds[expected - 1]:
        return None
    start, end = sorted((edge.time, edge.time + shift))
    return part.suspect("edge", (start, end), (given, expected), confidence, shift)


def _intervals(part: LabelledFinger, spans: Sequence[Span], thresholds: Array) -> Iterator[Suspect]:
    """Yield contradicted intervals within labels that do not belong to an edge."""
    codes = contradictions(part.codes, part.probabilities, thresholds)

    def is_beyond(neighbour: Span | None, edge: float, code: int) -> bool:
        return (
            neighbour is not None
            and neighbour.code == code
            and min(abs(neighbour.start - edge), abs(neighbour.end - edge)) <= TIME_TOLERANCE
        )

    for before, span, after in zip([None, *spans], spans, [*spans[1:], None], strict=False):
        for start, end, expected in _contradicted(part, codes, span):
            near_start, near_end = start - span.start, span.end - end
            at_start = near_start < EDGE_DISTANCE and is_beyond(before, span.start, expected)
            at_end = near_end < EDGE_DISTANCE and is_beyond(after, span.end, expected)
            # It continues the state beyond one edge: that edge may be late or early, which
            # `_shifted_edge` judges. Between two such labels it may be a gap that was overlooked.
            if end - start < MAX_EDGE_SHIFT and at_start != at_end:
                continue
            confidence = part.confidence(start, end, expected)
            yield part.suspect("interval", (start, end), (span.code, expected), confidence)


def _contradicted(part: LabelledFinger, codes: Codes, span: Span) -> list[tuple[float, float, int]]:
    """Return start [s], end [s] and expected state of the contradicted intervals of a label."""
    interval = (span.start - TIME_TOLERANCE, span.end - TIME_TOLERANCE)
    first, last = np.searchsorted(part.times, interval)
    changes = first + 1 + np.flatnonzero(np.diff(codes[first:last]))
    found: list[tuple[float, float, int]] = []
    for i, j in pairwise([int(first), *changes.tolist(), int(last)]):
        if i == j or codes[i] == UNKNOWN:
            continue
        start, end, code = float(part.bounds[i]), float(part.bounds[j]), int(codes[i])
        begin, last_end, last_code = found[-1] if found else (0.0, -np.inf, UNKNOWN)
        if last_code == code and start - last_end < MAX_CLOSED_GAP - TIME_TOLERANCE:
            found[-1] = (begin, end, code)
        else:
            found.append((start, end, code))
    return [each for each in found if each[1] - each[0] >= MIN_CONTRADICTION - TIME_TOLERANCE]
