"""Labels that a cross-validated classifier contradicts with confidence."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise
from typing import Literal

import msgspec
import numpy as np

from holdfast.contact import UNKNOWN, ContactState
from holdfast.errors import TrainingError
from holdfast.features import parse_features
from holdfast.labelling.review.contradictions import (
    REACH,
    Codes,
    Edge,
    confident_thresholds,
    contradictions,
    edges_of,
    shift_of,
    typical_shifts,
)
from holdfast.labelling.review.out_of_fold import N_FOLDS, out_of_fold
from holdfast.labelling.review.spans import TIME_TOLERANCE, Span, State, spans_of, state_name
from holdfast.recordings import Label, Recording, label_states
from holdfast.sensors.types import Array
from holdfast.training.setting import Setting

SHORTEST = 0.05
"""A contradiction of at least this [s] is told."""

CLOSED_GAP = 0.05
"""Gaps between contradictions shorter than this [s] are closed first."""

AT_EDGE = 0.1
"""A contradiction within this [s] of an edge, for the state beyond it, is the edge's."""

LEAST_SHIFT = 0.1
"""An edge that belongs nearer than this [s] to where it is may stay."""

EDGE_SHARE = 0.8
"""Of the state's threshold is enough for an edge, whose place has been found by a likelihood."""


class Suspect(msgspec.Struct, frozen=True):
    """A stretch of time whose label the classifier contradicts.

    Attributes:
        recording: its name.
        finger: whose label it is.
        kind: `interval`, or `edge` for a label that seems to begin or end elsewhere.
        start: of the stretch [s]; of an edge, from where it is to where it belongs.
        end: first instant after it [s].
        given: the label's state.
        expected: what the classifier takes it for.
        confidence: mean probability of the expected state in the stretch.
        shift: of an edge, from where it is to where it belongs [s]; above 0 is later.
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
        """Confidence times duration [s]: what suspects are ranked by."""
        return self.confidence * (self.end - self.start)


class Audit(msgspec.Struct, frozen=True):
    """What an audit found; `msgspec.json.encode` gives the JSON.

    Attributes:
        n_recordings: that were looked at.
        judged: how long the labels are that could be judged, over all fingers [s].
        suspects: those with the largest confidence times duration first.
    """

    n_recordings: int
    judged: float
    suspects: list[Suspect]


@dataclass(frozen=True, eq=False)
class LabelledFinger:
    """The labels of one finger in one recording, and what others' classifier says.

    Attributes:
        recording: its name.
        finger: its name.
        labels: in order of time.
        times: (n,) of the samples [s].
        period: how long the last sample lasts [s].
        probabilities: (n, 3) of no contact, unstable, stable; NaN where there are none.
    """

    recording: str
    finger: str
    labels: Sequence[Label]
    times: Array
    period: float
    probabilities: Array

    @cached_property
    def codes(self) -> Codes:
        """(n,) code of the label's state at each sample."""
        return label_states(self.labels, self.times)

    @cached_property
    def instants(self) -> Array:
        """(n + 1,) when each sample begins and the last ends [s]."""
        return np.append(self.times, self.times[-1:] + self.period)

    @property
    def judged(self) -> float:
        """How long the labels are that have probabilities [s]."""
        known = (self.codes != UNKNOWN) & np.isfinite(self.probabilities).all(axis=1)
        return float(np.diff(self.instants)[known].sum())

    def confidence(self, start: float, end: float, code: int) -> float:
        """The mean probability of a state in [start, end) [s]; 0 without any."""
        first, last = np.searchsorted(self.times, (start - TIME_TOLERANCE, end - TIME_TOLERANCE))
        values = self.probabilities[first:last, code - 1]
        values = values[np.isfinite(values)]
        return float(values.mean()) if len(values) else 0.0


def audit(
    recordings: Sequence[Recording],
    setting: Setting | None = None,
    *,
    n_folds: int = N_FOLDS,
    n_jobs: int = 1,
) -> Audit:
    """Labels that a classifier which has not seen the recording contradicts with confidence.

    Sample by sample by confident learning (`holdfast.labelling.review.contradictions`); samples are
    gathered into intervals. Beside that every edge is looked at as a whole: where its
    likeliest place is 0.1 s or more from where it is drawn, after what all edges of its kind
    have in common, it is told with its shift. What the labels of
    all recordings have wrong alike is not found.

    Args:
        recordings: labelled; a lazy dataset will do. Read one at a time, and more than once;
            memory holds three probabilities a sample.
        setting: how to train; by default `default_setting` of the recordings.
        n_folds: recordings are held out in at most so many groups.
        n_jobs: fits at a time; -1 for as many as there are processors.

    Raises:
        TrainingError: no labels, one state only, one recording only, or nothing can be judged.
        RecordingError: a recording cannot be read.
        ModelError: a finger has another sensor than where it is labelled.
        ValueError: the setting's split is random, or there are fewer than two folds.
    """
    setting = default_setting(recordings) if setting is None else setting
    judged = [
        _judged(recording, finger, probabilities)
        for recording, found in out_of_fold(recordings, setting, n_folds=n_folds, n_jobs=n_jobs)
        for finger, probabilities in found.items()
    ]
    length = sum(each.judged for each in judged)
    if not length:
        raise TrainingError(
            f"none of the labels of {len(recordings)} recordings can be judged: a finger needs "
            "two states, after tare and first window, in at least two recordings"
        )
    return Audit(len(recordings), length, suspects(judged))


def default_setting(recordings: Sequence[Recording]) -> Setting:
    """How an audit trains: our own features for counts, the paper's for newton.

    Our own tell the place of an edge far better (docs/labels.md has figures); their scale is
    that of counts.
    """
    units = {m.unit for r in recordings[:1] for m in r.modules.values()}
    if units == {"count"}:
        return Setting(trials=0, features=parse_features("holdfast"))
    return Setting(trials=0)


def suspects(judged: Sequence[LabelledFinger]) -> list[Suspect]:
    """What the probabilities contradict, those of the largest weight first.

    Thresholds, and what edges have in common, are of each finger over all recordings.

    Args:
        judged: the labels of fingers, with probabilities out of fold.
    """
    by_finger = groupby(sorted(judged, key=lambda each: each.finger), lambda each: each.finger)
    found = [suspect for _, parts in by_finger for suspect in _of_finger(list(parts))]
    return sorted(found, key=_rank)


def _judged(recording: Recording, finger: str, probabilities: Array) -> LabelledFinger:
    module = recording.modules[finger]
    return LabelledFinger(
        recording.name, finger, module.labels, module.times, module.period, probabilities
    )


def _of_finger(parts: Sequence[LabelledFinger]) -> Iterator[Suspect]:
    thresholds = confident_thresholds(
        np.concatenate([part.codes for part in parts]),
        np.concatenate([part.probabilities for part in parts]),
    )
    spans = [spans_of(part.labels) for part in parts]
    edges = [
        list(edges_of(own, part.times, part.probabilities))
        for part, own in zip(parts, spans, strict=True)
    ]
    typical = typical_shifts([edge for own in edges for edge in own])
    for part, own_spans, own_edges in zip(parts, spans, edges, strict=True):
        shifted = [
            _shifted(part, edge, shift_of(edge, typical[edge.kind]), thresholds)
            for edge in own_edges
        ]
        yield from _without_repeats(
            [*_intervals(part, own_spans, thresholds), *(each for each in shifted if each)]
        )


def _shifted(part: LabelledFinger, edge: Edge, shift: float, thresholds: Array) -> Suspect | None:
    """The edge as a suspect, if it is one.

    What lies between the edge and its place is judged where the classifier sees it: as much
    later as it sees all edges of the kind.
    """
    if abs(shift) < LEAST_SHIFT - TIME_TOLERANCE:
        return None
    given, expected = edge.kind if shift < 0 else edge.kind[::-1]
    seen = min(edge.best - shift, edge.best), max(edge.best - shift, edge.best)
    confidence = part.confidence(*seen, expected)
    if confidence < EDGE_SHARE * thresholds[expected - 1]:
        return None
    start, end = sorted((edge.at, edge.at + shift))
    return _suspect(part, "edge", (start, end), (given, expected), confidence, shift)


def _intervals(part: LabelledFinger, spans: Sequence[Span], thresholds: Array) -> Iterator[Suspect]:
    """Contradicted stretches within a label that are not its edges'."""
    codes = contradictions(part.codes, part.probabilities, thresholds)
    for place, span in enumerate(spans):
        before = spans[place - 1] if place else None
        after = spans[place + 1] if place + 1 < len(spans) else None
        for start, end, expected in _stretches(part, codes, span):
            at_start = start - span.start < AT_EDGE and _reaches(before, span.start, expected)
            at_end = span.end - end < AT_EDGE and _reaches(after, span.end, expected)
            if end - start < REACH and at_start != at_end:
                continue
            confidence = part.confidence(start, end, expected)
            yield _suspect(part, "interval", (start, end), (span.code, expected), confidence)


def _stretches(part: LabelledFinger, codes: Codes, span: Span) -> list[tuple[float, float, int]]:
    """Start [s], end [s] and expected state of contradicted stretches of one label."""
    first, last = np.searchsorted(
        part.times, (span.start - TIME_TOLERANCE, span.end - TIME_TOLERANCE)
    )
    changes = first + 1 + np.flatnonzero(np.diff(codes[first:last]))
    bounds = [int(first), *changes.tolist(), int(last)]
    found: list[tuple[float, float, int]] = []
    for start, end in pairwise(bounds):
        if start == end or codes[start] == UNKNOWN:
            continue
        began, ended, code = float(part.instants[start]), float(part.instants[end]), codes[start]
        if found and found[-1][2] == code and began - found[-1][1] < CLOSED_GAP - TIME_TOLERANCE:
            found[-1] = (found[-1][0], ended, int(code))
        else:
            found.append((began, ended, int(code)))
    return [each for each in found if each[1] - each[0] >= SHORTEST - TIME_TOLERANCE]


def _reaches(neighbour: Span | None, edge: float, code: int) -> bool:
    """Whether the neighbour has that state and meets the edge."""
    return (
        neighbour is not None
        and neighbour.code == code
        and min(abs(neighbour.start - edge), abs(neighbour.end - edge)) <= TIME_TOLERANCE
    )


def _without_repeats(found: Sequence[Suspect]) -> list[Suspect]:
    """The suspects of one finger without those that lie for half in a weightier one."""
    kept: list[Suspect] = []
    for suspect in sorted(found, key=_rank):
        half = (suspect.end - suspect.start) / 2
        overlaps = (min(suspect.end, o.end) - max(suspect.start, o.start) for o in kept)
        if all(overlap < half for overlap in overlaps):
            kept.append(suspect)
    return kept


def _rank(suspect: Suspect) -> tuple[float, str, str, float]:
    return -suspect.weight, suspect.recording, suspect.finger, suspect.start


def _suspect(
    part: LabelledFinger,
    kind: Literal["interval", "edge"],
    stretch: tuple[float, float],
    codes: tuple[int, int],
    confidence: float,
    shift: float | None = None,
) -> Suspect:
    given, expected = (state_name(_STATES[code]) for code in codes)
    return Suspect(part.recording, part.finger, kind, *stretch, given, expected, confidence, shift)


_STATES = tuple(ContactState)
