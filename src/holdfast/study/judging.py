"""One method on one corpus: fitted on some recordings, judged on others, and counted."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import msgspec
import numpy as np

from holdfast.methods import HAND, METHODS, Method
from holdfast.metrics import (
    Decisions,
    EventMetrics,
    FingerDecisions,
    Metrics,
    hand_decisions,
    match_alarms,
    pool_events,
    summarise,
)
from holdfast.metrics.events import POSTS
from holdfast.study.changes import Change
from holdfast.study.corpus import Corpus
from holdfast.study.counting import (
    Breakdown,
    Slip,
    calibration_counts,
    count,
    n_found,
    slips_of,
)
from holdfast.study.expert import Expert, Material, Opinion, Seen, groups_of, look, material_of
from holdfast.study.thresholds import Calm, shift_for

FOLDS = 5
"""Of whole recordings, each object spread over all of them."""
INNER_FOLDS = 3
"""Of the training recordings of a fold, on which its thresholds are chosen."""
ALARM_RATES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
"""False alarms per minute of stable label that thresholds are chosen for, in training."""
CALM = 1.0
"""The rate that methods are compared at."""


class Job(msgspec.Struct, frozen=True):
    """What is judged.

    Attributes:
        method: name of it.
        train: corpus that it is fitted to.
        test: corpus that it is judged on, after a fit to all of `train`; None: out of fold.
        split: what a fold holds out: a fifth of the recordings, or one object.
        change: of the recordings of both corpora.
        seed: of everything random.
    """

    method: str
    train: Corpus
    test: Corpus | None = None
    split: Literal["recording", "object"] = "recording"
    change: Change = Change()
    seed: int = 0


class Point(msgspec.Struct, frozen=True):
    """Events at thresholds chosen, on training recordings, for a rate of false alarms.

    Attributes:
        per_minute: the rate asked for.
        events: of the hand, by exact labels.
        n_slips: how many slips there were.
        n_found: of them, within each of `POSTS`.
    """

    per_minute: float
    events: EventMetrics
    n_slips: int
    n_found: dict[str, int]


class Judged(msgspec.Struct, frozen=True):
    """What was counted.

    Attributes:
        names: of the recordings judged, in order.
        fingers: by sample, at the method's own threshold; None of a method for whole hands.
        hand: of the hand at the method's own threshold, by exact labels.
        calm: of the hand at thresholds for `CALM` false alarms a minute, by exact labels.
        slips: at the same thresholds, of each recording.
        curve: a point for each of `ALARM_RATES`.
        breakdown: of errors, at the method's own threshold.
        calibration: (10, 3) sum of probabilities, stable samples and samples of each bin.
    """

    names: list[str]
    fingers: Metrics | None
    hand: Metrics
    calm: Metrics
    slips: list[list[Slip]]
    curve: list[Point]
    breakdown: list[Breakdown]
    calibration: list[list[float]]


class Fold(NamedTuple):
    """One fit: its experts, and what they are for.

    Attributes:
        expert: fitted to all training recordings.
        inner: fitted without one group of them each.
        groups: (n_recordings,) the inner group of each recording of `train`; -1 of those that
            the fold holds out.
        tested: places of the recordings that it judges, in the corpus that is judged.
    """

    expert: Expert
    inner: Sequence[Expert]
    groups: Sequence[int]
    tested: frozenset[int]


class Case(NamedTuple):
    """A recording that was judged: by which fold, what was seen, what was thought of it."""

    fold: int
    seen: Seen
    opinion: Opinion

    def hand(self, shift: float) -> FingerDecisions:
        """The hand by exact labels, with thresholds moved by so many log odds."""
        return self.opinion.hand(self.seen, self.seen.exact, shift)


def judge(job: Job) -> Judged:
    """Fits the method, chooses its thresholds on what it was fitted to, and judges the rest.

    Raises:
        TrainingError: a whole-hand method gets too few fingers.
    """
    method = METHODS[job.method]
    recordings = look(method, job.train, job.change)
    folds = list(_folds(job, method, material_of(recordings)))
    calms = [_calms(fold, recordings) for fold in folds]
    tested = recordings if job.test is None else look(method, job.test, job.change)
    cases = [_case(folds, place, seen) for place, seen in enumerate(tested)]
    return _judged(cases, [[shift_for(calm, rate) for rate in ALARM_RATES] for calm in calms])


def _case(folds: Sequence[Fold], place: int, seen: Seen) -> Case:
    fold = next(k for k, fold in enumerate(folds) if place in fold.tested)
    return Case(fold, replace(seen, features={}), folds[fold].expert.opinion(seen))


def _folds(job: Job, method: Method, material: Material) -> Iterator[Fold]:
    everyone = set(range(len(material.objects)))
    if job.test is not None:
        tested = frozenset(range(len(job.test.recordings)))
        yield _fold(job, method, material, everyone, tested)
        return
    if job.split == "object":
        names = list(dict.fromkeys(material.objects))
        units = np.array([names.index(name) for name in material.objects])
    else:
        units = groups_of(material.objects, min(FOLDS, len(everyone)), job.seed)
    for unit in np.unique(units):
        held = frozenset(np.flatnonzero(units == unit).tolist())
        yield _fold(job, method, material, everyone - held, held)


def _fold(
    job: Job, method: Method, material: Material, training: set[int], tested: frozenset[int]
) -> Fold:
    places = sorted(training)
    objects = [material.objects[place] for place in places]
    inner_groups = groups_of(objects, min(INNER_FOLDS, len(places)), job.seed + 1)
    groups = np.full(len(material.objects), -1)
    groups[places] = inner_groups
    inner = [
        Expert.fit(method, material, training - set(np.flatnonzero(groups == k)), job.seed)
        for k in range(max(inner_groups) + 1)
    ]
    return Fold(Expert.fit(method, material, training, job.seed), inner, groups.tolist(), tested)


def _calms(fold: Fold, recordings: Sequence[Seen]) -> list[Calm]:
    """What its training recordings tell of thresholds, each judged without itself."""
    found = []
    for group, seen in zip(fold.groups, recordings, strict=True):
        if group >= 0:
            hand = hand_decisions(seen.undecided(seen.exact), len(seen.exact))
            scores = fold.inner[group].opinion(seen).scores(seen, hand.times)
            found.append(Calm.of(hand.times, hand.labels, scores))
    return found


def _judged(cases: Sequence[Case], shifts: Sequence[Sequence[float]]) -> Judged:
    own = [case.opinion.decisions(case.seen, case.seen.labels) for case in cases]
    calm = ALARM_RATES.index(CALM)
    hands = [case.hand(shifts[case.fold][calm]) for case in cases]
    return Judged(
        names=[case.seen.name for case in cases],
        fingers=summarise(own) if own[0].fingers else None,
        hand=_summary(cases, [case.hand(0.0) for case in cases]),
        calm=_summary(cases, hands),
        slips=[slips_of(case.seen, hand) for case, hand in zip(cases, hands, strict=True)],
        curve=[
            _point(rate, cases, [case.hand(shifts[case.fold][k]) for case in cases])
            for k, rate in enumerate(ALARM_RATES)
        ],
        breakdown=[count(case.seen, each) for case, each in zip(cases, own, strict=True)],
        calibration=calibration_counts(
            [finger for each in own for finger in each.fingers.values()]
        ),
    )


def _summary(cases: Sequence[Case], hands: Sequence[FingerDecisions]) -> Metrics:
    """The metrics of hands alone, each as the one finger of its recording."""
    return summarise(
        Decisions(case.seen.name, {HAND: hand}, hand)
        for case, hand in zip(cases, hands, strict=True)
    )


def _point(rate: float, cases: Sequence[Case], hands: Sequence[FingerDecisions]) -> Point:
    matches = [match_alarms(hand.times, hand.labels, hand.states) for hand in hands]
    pairs = zip(cases, hands, strict=True)
    slips = [slip for case, hand in pairs for slip in slips_of(case.seen, hand)]
    found = {str(post): n_found(slips, post) for post in POSTS}
    return Point(rate, pool_events(matches), len(slips), found)
