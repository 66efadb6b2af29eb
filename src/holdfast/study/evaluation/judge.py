"""One method: fitted on some recordings, judged on others, and counted.

No recording that is judged has a say in what judges it: not in its classifiers, not in its
contact thresholds, not in the threshold for a rate of false alarms, which is chosen on the
training recordings, each judged by a fit without it.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.metrics import Decisions, Metrics, summarise
from holdfast.study.corpus import Corpus
from holdfast.study.evaluation.changes import Change
from holdfast.study.evaluation.counting import Breakdown, calibration_counts, count
from holdfast.study.evaluation.expert import Expert, Material, material_of
from holdfast.study.evaluation.hearing import Heard, after_glitch, hear, spells_of
from holdfast.study.evaluation.opinion import Opinion
from holdfast.study.evaluation.seen import Seen, look
from holdfast.study.evaluation.thresholds import Calm, shift_for
from holdfast.study.methods import HAND, METHODS, Method
from holdfast.study.methods.cuts import CUTS

ALARM_RATES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
"""False alarms per minute of stable label that thresholds are chosen for, in training."""
COMPARED_AT = 1.0
"""The rate that methods are compared at."""
HOLD = 0.1
"""For how long a hand goes on not to be stable at those thresholds, so that one disturbance is
one alarm, whatever the method [s]."""

Split = Literal["recording", "object"]


class Effort(msgspec.Struct, frozen=True):
    """How thoroughly a method is judged.

    Attributes:
        folds: of whole recordings, each object spread over all of them.
        inner: folds of the training recordings of each, on which thresholds are chosen.
        stride: only every so many-th decision is looked at.
        max_rows: samples of a finger that a classifier is fitted to, evenly spread.
    """

    folds: int = 5
    inner: int = 3
    stride: int = 1
    max_rows: int = 20_000


class Job(msgspec.Struct, frozen=True):
    """What is judged.

    Attributes:
        method: name of it.
        train: corpus that it is fitted to.
        splits: of that corpus: a fold holds out recordings, or one object.
        tests: other corpora that it is judged on, after a fit to all of `train`.
        change: of the recordings of all corpora.
        effort: how thoroughly.
        seed: of everything random.
    """

    method: str
    train: Corpus
    splits: tuple[Split, ...] = ("recording",)
    tests: tuple[Corpus, ...] = ()
    change: Change = Change()
    effort: Effort = Effort()
    seed: int = 0


class Judged(msgspec.Struct, frozen=True):
    """What was counted.

    Attributes:
        names: of the recordings judged, in order.
        fingers: by sample, at the method's own threshold; None of a method for whole hands.
        hand: the same of the hand.
        own: its alarms, by exact labels, at the same threshold, of each recording.
        held: the same, held for `HOLD`.
        curve: the same, held, at thresholds for each of `ALARM_RATES`.
        spared: the same, held, at thresholds for one false alarm per minute, where those right
            after a jump of the controller's set point are not counted.
        breakdown: of errors at the method's own threshold, of each recording.
        calibration: of each recording, (10, 3) sum of probabilities, stable samples and samples
            of each bin.
    """

    names: list[str]
    fingers: Metrics | None
    hand: Metrics
    own: list[Heard]
    held: list[Heard]
    curve: list[list[Heard]]
    spared: list[Heard]
    breakdown: list[Breakdown]
    calibration: list[list[list[float]]]

    @property
    def metrics(self) -> Metrics:
        """Of what the method judges: the fingers, or the hand."""
        return self.fingers or self.hand

    @property
    def calm(self) -> list[Heard]:
        """At the threshold that methods are compared at."""
        return self.curve[ALARM_RATES.index(COMPARED_AT)]


class Fold(NamedTuple):
    """A fit and its thresholds.

    Attributes:
        expert: fitted to all training recordings.
        shifts: of its threshold, for each of `ALARM_RATES`, and for the one that is compared
            with alarms spared.
    """

    expert: Expert
    shifts: Sequence[float]


class Case(NamedTuple):
    """A recording that was judged: what was seen, what was thought of it, and the thresholds."""

    seen: Seen
    opinion: Opinion
    shifts: Sequence[float]


def judge(job: Job) -> dict[str, Judged]:
    """What the method is worth by each split, and on each other corpus.

    A split by object is left out where there are fewer than two, or not all are known.

    Returns:
        By the split, or the name of the corpus.

    Raises:
        TrainingError: a whole-hand method gets too few fingers.
    """
    return {key: judged_of(cases) for key, cases in cases_of(job) if cases}


def cases_of(job: Job) -> Iterator[tuple[str, list[Case]]]:
    """By split, or corpus, the recordings and what was thought of them, in order."""
    method = method_called(job.method)
    recordings = look(method, job.train, job.change, job.effort.stride)
    material = material_of(recordings, job.effort.max_rows)
    everyone = frozenset(range(len(recordings)))
    for split in job.splits:
        cases: dict[int, Case] = {}
        for held in held_out(material.objects, split, job.effort.folds, job.seed):
            fold = _fold(job, method, material, recordings, everyone - held)
            cases |= {place: _case(fold, recordings[place]) for place in held}
        yield split, [cases[place] for place in sorted(cases)]
    if job.tests:
        fold = _fold(job, method, material, recordings, everyone)
        for corpus in job.tests:
            tested = look(method, corpus, job.change, job.effort.stride)
            yield corpus.name, [_case(fold, seen) for seen in tested]


def method_called(name: str) -> Method:
    """The method of that name, also of those that the study has for one question alone."""
    return METHODS[name] if name in METHODS else CUTS[name]


def held_out(
    objects: Sequence[str | None], split: Split, n_folds: int, seed: int
) -> Iterator[frozenset[int]]:
    """Places of the recordings that each fold holds out; every recording is in one fold.

    Args:
        objects: of the recordings; None where it is not known.
        split: `recording` or `object`.
        n_folds: by recording, at most.
        seed: of the same.
    """
    if split == "object":
        names = list(dict.fromkeys(objects))
        if len(names) < 2 or None in names:
            return
        units = np.array([names.index(name) for name in objects])
    else:
        units = groups_of(objects, min(n_folds, len(objects)), seed)
    for unit in np.unique(units):
        yield frozenset(np.flatnonzero(units == unit).tolist())


def groups_of(objects: Sequence[str | None], n_groups: int, seed: int) -> npt.NDArray[np.int64]:
    """(n_recordings,) groups of about equal size, the recordings of each object spread evenly."""
    order = np.random.default_rng(seed).permutation(len(objects))
    order = order[np.argsort(np.array([str(objects[k]) for k in order]), kind="stable")]
    groups = np.empty(len(objects), dtype=np.int64)
    groups[order] = np.arange(len(objects)) % n_groups
    return groups


def _fold(
    job: Job,
    method: Method,
    material: Material,
    recordings: Sequence[Seen],
    training: frozenset[int],
) -> Fold:
    """The fit to the training recordings; nothing else is looked at."""
    places = sorted(training)
    objects = [material.objects[place] for place in places]
    n_inner = min(job.effort.inner, len(places))
    calms: list[tuple[Calm, Calm]] = []
    for held in held_out(objects, "recording", n_inner, job.seed + 1) if n_inner > 1 else ():
        left_out = {places[k] for k in held}
        inner = Expert.fit(method, material, training - left_out, job.seed)
        calms += [_calm(inner, recordings[place]) for place in sorted(left_out)]
    return Fold(Expert.fit(method, material, training, job.seed), _shifts(calms))


def _calm(expert: Expert, seen: Seen) -> tuple[Calm, Calm]:
    """What tells its false alarms: of all, and of those that no jump of the set point caused."""
    score, labels = expert.opinion(seen).score(seen).held(HOLD), seen.hand(seen.exact).labels
    spared = after_glitch(score.times, seen.truth)
    return Calm.of(score, labels), Calm.of(score, labels, spared)


def _shifts(calms: Sequence[tuple[Calm, Calm]]) -> list[float]:
    if not calms:
        return [0.0] * (1 + len(ALARM_RATES))
    every, spared = zip(*calms, strict=True)
    return [*(shift_for(every, rate) for rate in ALARM_RATES), shift_for(spared, COMPARED_AT)]


def _case(fold: Fold, seen: Seen) -> Case:
    return Case(replace(seen, features={}), fold.expert.opinion(seen), fold.shifts)


def judged_of(cases: Sequence[Case]) -> Judged:
    """What is counted of the recordings that were judged."""
    own = [case.opinion.decisions(case.seen, case.seen.labels) for case in cases]
    heard = [list(_heard(case)) for case in cases]
    return Judged(
        names=[case.seen.name for case in cases],
        fingers=summarise(own) if any(each.fingers for each in own) else None,
        hand=summarise(_hands(own)),
        own=[each[0] for each in heard],
        held=[each[1] for each in heard],
        curve=[[each[2 + k] for each in heard] for k in range(len(ALARM_RATES))],
        spared=[each[-1] for each in heard],
        breakdown=[count(case.seen, each) for case, each in zip(cases, own, strict=True)],
        calibration=[calibration_counts(each) for each in own],
    )


def _heard(case: Case) -> Iterator[Heard]:
    """Its alarms at its own threshold, then held: at its own, and at each that was chosen."""
    seen, opinion, shifts = case
    score, labels = opinion.score(seen), seen.hand(seen.exact).labels
    spells = spells_of(seen.truth)
    yield hear(score.hand(labels), seen.truth, spells)
    held = score.held(HOLD)
    for shift in (0.0, *shifts):
        yield hear(held.hand(labels, shift), seen.truth, spells)


def _hands(decided: Iterable[Decisions]) -> Iterator[Decisions]:
    """The hands alone, each as the one finger of its recording."""
    for each in decided:
        if each.hand is not None:
            yield Decisions(each.name, {HAND: each.hand}, each.hand)
