"""Part of the study: experiments 1 and 2 of the paper in numbers, over all recordings."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from holdfast.contact import (
    HELD_PHASES,
    MERGE_GAP,
    NO_CONTACT,
    STABLE,
    TIME_TOLERANCE,
    UNKNOWN,
    UNSTABLE,
    Phase,
)
from holdfast.metrics import FingerDecisions
from holdfast.metrics.decisions import Codes
from holdfast.metrics.events import MIN_STABLE_DURATION
from holdfast.metrics.masks import join_runs, runs
from holdfast.recordings import Truth
from holdfast.sensors.types import Array
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.jobs import short_title
from holdfast_lab.study.comparison.rows import count_row, quantile_row, ratio_row
from holdfast_lab.study.evaluation.evaluate_method import (
    EvaluationEffort,
    EvaluationJob,
    score_splits,
)
from holdfast_lab.study.evaluation.fitted_method import ScoredRecording
from holdfast_lab.study.evaluation.held_object import latest_rows
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.plan import Corpus, StudyPlan
from holdfast_lab.tasks import Task

EXPERIMENT_METHODS = ("logreg", "svm", "holdfast", "noise_floor", "always_stable")
QUICK_EXPERIMENT_METHODS = ("logreg", "holdfast")
ROLE_TITLES = {
    "main": "by recording",
    "fresh": "other seeds",
    "others": "unseen objects",
    "gentle": "gentle profile",
    "vigorous": "vigorous profile",
}
"""Roles whose recordings are evaluated, and their titles. "main" is evaluated out of fold."""
ONLY_FAILED = ("gentle", "vigorous")
"""Roles of which only the failed grasps are evaluated."""
EXPERIMENT_DIGITS = {
    "delay median [s]": 3,
    "delay 95 % [s]": 3,
    "disturbances": 0,
    "failed grasps": 0,
}

GRASP_PHASES = (Phase.CLOSING, *HELD_PHASES)
"""Phases of a grasp, until the release begins."""

Keys = dict[str, Key]


class DisturbanceOutcome(msgspec.Struct, frozen=True):
    """One disturbance of a held object, and its detection by the hand.

    Attributes:
        start: of the outside force [s].
        end: of the outside force [s].
        slides: whether the object slides on a finger meanwhile.
        was_stable: whether the hand was called stable directly before.
        delay: time from the start to the first alarm [s]; infinite without an alarm.
    """

    start: float
    end: float
    slides: bool
    was_stable: bool
    delay: float


class GraspOutcome(msgspec.Struct, frozen=True):
    """Decisions of one method on one grasp.

    Attributes:
        role: of the corpus.
        recording: name of the recording.
        object: in the hand.
        case: "1", "2" or "failed".
        contact: [samples in contact from the start of the closing to the release, of those not
            called stable], all fingers.
        unstable: the same of the samples labelled unstable.
        phases: by phase, samples of all fingers in contact, and those not called stable.
        first_stable: by finger, time from the lock to the first stable estimate [s]; infinite
            without one.
        lasting_stable: the same, to the first estimate that stays stable for half a second.
        disturbances: in order of time.
    """

    role: str
    recording: str
    object: str
    case: str
    contact: tuple[int, int]
    unstable: tuple[int, int]
    phases: dict[str, tuple[int, int]]
    first_stable: list[float]
    lasting_stable: list[float]
    disturbances: list[DisturbanceOutcome]


def tasks(plan: StudyPlan) -> list[Task]:
    """Return a task for each method; none without a truth."""
    if not plan.main.has_truth:
        return []
    corpora = {role: plan.corpora[role] for role in ROLE_TITLES if role in plan.corpora}
    folds, max_samples = (3, 10_000) if plan.quick else (5, 20_000)
    return [
        Task(
            f"experiments/{name}",
            grasp_outcomes,
            (name, corpora, folds, max_samples, plan.seed),
            list[GraspOutcome],
            cost=40.0,
        )
        for name in _methods(plan)
    ]


def tables(plan: StudyPlan, results: Mapping[str, Any]) -> list[ResultTable]:
    """Return the tables of experiment 1, experiment 2, phases and single disturbances."""
    by_method = {
        n: results[f"experiments/{n}"] for n in _methods(plan) if f"experiments/{n}" in results
    }
    makers = (failed_table, disturbed_table, phase_table, single_table)
    made = [make(by_method, plan.seed) for make in makers] if by_method else []
    return [table for table in made if table.rows]


def grasp_outcomes(
    name: str, corpora: Mapping[str, Corpus], n_folds: int, max_samples: int, seed: int
) -> list[GraspOutcome]:
    """Return the outcomes of a method on all recordings, none of them used for its own fit.

    Args:
        name: of the method, one for fingers.
        corpora: by role; "main" for training.
        n_folds: of the main recordings.
        max_samples: of a finger, that train a classifier.
        seed: of folds and fits.
    """
    cases = {
        role: {
            recording.name: str(recording.metadata.get("case", "")) for recording in corpus.load()
        }
        for role, corpus in corpora.items()
    }
    others: dict[str, Corpus] = {}
    for role, corpus in corpora.items():
        names = tuple(
            recording
            for recording in corpus.recordings
            if role not in ONLY_FAILED or cases[role][recording] == "failed"
        )
        # Main is tested out of fold, not as another corpus.
        if role != "main" and names:
            others[role] = msgspec.structs.replace(corpus, recordings=names)
    effort = EvaluationEffort(n_folds, inner=1, max_samples=max_samples)
    tests = tuple(others.values())
    job = EvaluationJob(name, corpora["main"], ("recording",), tests, effort=effort, seed=seed)
    return [
        outcome_of(role, cases[role][scored.recording.name], scored)
        for role, (_, recordings) in zip(("main", *others), score_splits(job), strict=True)
        for scored in recordings
    ]


def outcome_of(role: str, case: str, scored: ScoredRecording) -> GraspOutcome:
    """Return the outcome of a method on one scored grasp."""
    recording, truth = scored.recording, scored.recording.truth
    decisions = scored.decide(recording.exact_labels)
    # Samples of a grasp, from the start of the closing until the release begins: all of them and
    # those not called stable, in contact and labelled unstable.
    contact, unstable = np.zeros(2, dtype=int), np.zeros(2, dtype=int)
    phases = {str(phase): np.zeros(2, dtype=int) for phase in GRASP_PHASES}
    for finger in decisions.fingers.values():
        if truth is None:
            break
        phase = truth.hand["phase"][latest_rows(truth, finger.times)]
        closing = np.flatnonzero(phase == Phase.CLOSING)
        grasp = np.zeros(len(phase), dtype=bool)
        # Without a closing there is no grasp, and nothing counts.
        grasp[closing[0] if len(closing) else len(phase) :] = True
        grasp &= (phase != Phase.RELEASED) & (finger.states != UNKNOWN)
        grasp &= (finger.labels != UNKNOWN) & (finger.labels != NO_CONTACT)
        not_stable = finger.states != STABLE
        is_unstable = grasp & (finger.labels == UNSTABLE)
        contact += (grasp.sum(), (grasp & not_stable).sum())
        unstable += (is_unstable.sum(), (is_unstable & not_stable).sum())
        for name in phases:
            within = grasp & (phase == name)
            phases[name] += (within.sum(), (within & not_stable).sum())
    stable_after = [
        stable_after_lock(finger.times, finger.states, truth)
        for finger in decisions.fingers.values()
    ]
    stable_times = [time for time in stable_after if time is not None]
    return GraspOutcome(
        role=role,
        recording=recording.name,
        object=recording.object or "",
        case=case,
        contact=(int(contact[0]), int(contact[1])),
        unstable=(int(unstable[0]), int(unstable[1])),
        phases={name: (int(n), int(n_called)) for name, (n, n_called) in phases.items()},
        first_stable=[first for first, _ in stable_times],
        lasting_stable=[lasting for _, lasting in stable_times],
        disturbances=find_disturbances(decisions.hand, truth),
    )


def stable_after_lock(
    times: Array, states: Codes, truth: Truth | None
) -> tuple[float, float] | None:
    """Return the times from the lock to the first, and to the first lasting, stable estimate [s].

    Infinite where there is none while the object is held. None if it was never locked.

    Args:
        times: (n,) of the estimates [s].
        states: (n,) of the estimates.
        truth: with the phases of the experiment.
    """
    if truth is None:
        return None
    grasped = np.isin(truth.hand["phase"], HELD_PHASES)
    if not grasped.any():
        return None
    locked_at = float(truth.times[np.argmax(grasped)])
    stable = (
        (times >= locked_at - TIME_TOLERANCE)
        & grasped[latest_rows(truth, times)]
        & (states == STABLE)
    )
    first, lasting = math.inf, math.inf
    for start, end in runs(stable):
        # A sample at the lock may have a time just before it.
        begin = max(float(times[start]) - locked_at, 0.0)
        first = min(first, begin)
        if times[end - 1] - times[start] >= MIN_STABLE_DURATION - TIME_TOLERANCE:
            lasting = begin
            break
    return first, lasting


def find_disturbances(
    hand: FingerDecisions | None, truth: Truth | None
) -> list[DisturbanceOutcome]:
    """Return the disturbances of a held object, each with its detection by an alarm.

    An alarm is a change of the hand from STABLE to another known state. Disturbances with a
    shorter rest between them than a person would see are one.
    """
    if hand is None or truth is None:
        return []
    phase = truth.hand["phase"]
    disturbed = np.isin(phase, (Phase.DISTURBED, Phase.SLIPPING))
    alarm = np.zeros(len(hand.states), dtype=bool)
    alarm[1:] = (
        (hand.states[:-1] == STABLE) & (hand.states[1:] != STABLE) & (hand.states[1:] != UNKNOWN)
    )
    disturbances = []
    for start, end in runs(join_runs(disturbed, truth.times, MERGE_GAP)):
        onset, last = float(truth.times[start]), float(truth.times[end - 1])
        inside = (hand.times >= onset - TIME_TOLERANCE) & (hand.times <= last + TIME_TOLERANCE)
        # The last sample before the onset; -1 if the recording begins with it.
        before = int(np.searchsorted(hand.times, onset - TIME_TOLERANCE)) - 1
        alarms = hand.times[alarm & inside]
        disturbances.append(
            DisturbanceOutcome(
                start=onset,
                end=last,
                slides=bool((phase[start:end] == Phase.SLIPPING).any()),
                was_stable=before >= 0 and bool(hand.states[before] == STABLE),
                delay=max(float(alarms[0]) - onset, 0.0) if len(alarms) else math.inf,
            )
        )
    return disturbances


def failed_table(by_method: Mapping[str, Sequence[GraspOutcome]], seed: int) -> ResultTable:
    """Return the table of experiment 1."""
    rows: list[Row] = []
    for name, outcomes in by_method.items():
        failed = [outcome for outcome in outcomes if outcome.case == "failed"]
        for title, chosen in _groups(failed):
            keys: Keys = {"on": title, "method": METHODS[name].title}
            rows.append(count_row(keys | {"figure": "failed grasps"}, [1] * len(chosen)))
            for figure, counts in (
                ("of the grasp, called unstable [%]", [grasp.contact for grasp in chosen]),
                ("of its unstable samples [%]", [grasp.unstable for grasp in chosen]),
            ):
                n, called = np.array(counts).reshape(-1, 2).T
                rows.append(ratio_row(keys | {"figure": figure}, called, n, seed))
    note = (
        "Grasps that never locked the object, or lost it. The grasp: samples of all fingers in "
        "contact, from the start of the closing until the release begins; called unstable: not "
        "called stable. A grasp that held the object for a while before it lost it also has "
        "stable samples; the last column counts the samples that exact labels call unstable. "
        "The paper shows one failed grasp and says that both classifiers were right."
    )
    title = "Experiment 1: failed grasps"
    return ResultTable(
        "experiment_1", title, note, rows, ("on", "method"), digits_of={"failed grasps": 0}
    )


def disturbed_table(by_method: Mapping[str, Sequence[GraspOutcome]], seed: int) -> ResultTable:
    """Return the table of experiment 2."""
    rows: list[Row] = []
    for name, outcomes in by_method.items():
        whole = [outcome for outcome in outcomes if outcome.role not in ONLY_FAILED]
        for title, chosen in _groups([grasp for grasp in whole if grasp.case != "failed"]):
            rows += disturbed_rows({"on": title, "method": METHODS[name].title}, chosen, seed)
    note = (
        "Grasps that held the object. Time from the lock to the first stable estimate of a "
        "finger, and to the first that stays stable for half a second; infinite if there is none. "
        "A disturbance lasts from the first to the last touch of the operator. It is detected by "
        "an alarm of the hand meanwhile: a change from STABLE to another state. Without an alarm "
        "it is missed, also if the hand was not called stable before, which is the next column. "
        "A missed disturbance has an infinite delay. The hand is not held unstable after an "
        "alarm."
    )
    title = "Experiment 2: locked, disturbed, released"
    lines = ("on", "method")
    digits = EXPERIMENT_DIGITS | dict.fromkeys(_LOCK_FIGURES, 3)
    return ResultTable("experiment_2", title, note, rows, lines, digits_of=digits)


_LOCK_FIGURES = (
    "lock to first stable, median [s]",
    "lock to lasting stable, median [s]",
    "lock to lasting stable, 95 % [s]",
)


def disturbed_rows(keys: Keys, chosen: Sequence[GraspOutcome], seed: int) -> Iterator[Row]:
    """Yield the rows of one line of the table of experiment 2."""
    first = [grasp.first_stable for grasp in chosen]
    lasting = [grasp.lasting_stable for grasp in chosen]
    for figure, values, q in zip(
        _LOCK_FIGURES, (first, lasting, lasting), (0.5, 0.5, 0.95), strict=True
    ):
        yield quantile_row(keys | {"figure": figure}, values, q, seed)
    n = [len(grasp.disturbances) for grasp in chosen]
    yield count_row(keys | {"figure": "disturbances"}, n)
    detected = [sum(math.isfinite(d.delay) for d in grasp.disturbances) for grasp in chosen]
    yield ratio_row(keys | {"figure": "detected [%]"}, detected, n, seed)
    already = [sum(not d.was_stable for d in grasp.disturbances) for grasp in chosen]
    yield ratio_row(keys | {"figure": "not stable before [%]"}, already, n, seed)
    delays = [[d.delay for d in grasp.disturbances] for grasp in chosen]
    yield quantile_row(keys | {"figure": "delay median [s]"}, delays, 0.5, seed)
    yield quantile_row(keys | {"figure": "delay 95 % [s]"}, delays, 0.95, seed)


def phase_table(by_method: Mapping[str, Sequence[GraspOutcome]], seed: int) -> ResultTable:
    """Return the table of what is called unstable in each phase of the experiments."""
    rows = []
    for name, outcomes in by_method.items():
        for title, is_failed in (("1: failed", True), ("2: held", False)):
            chosen = [v for v in outcomes if (v.case == "failed") == is_failed and v.case != "1"]
            for phase in map(str, GRASP_PHASES) if chosen else ():
                n, called = np.array([grasp.phases[phase] for grasp in chosen]).T
                keys: Keys = {"experiment": title, "method": METHODS[name].title, "phase": phase}
                rows.append(ratio_row(keys, called, n, seed))
    note = (
        "Samples of fingers in contact that are not called stable [%], of all recordings of the "
        "experiments, by fits without them. In experiment 2, locked is a held object without a "
        "disturbance: what is called unstable there is an error, or a glitch of the hand."
    )
    title = "Experiments 1 and 2: called unstable, by phase [%]"
    lines = ("experiment", "method")
    return ResultTable("experiment_phases", title, note, rows, lines, column="phase")


def single_table(by_method: Mapping[str, Sequence[GraspOutcome]], seed: int) -> ResultTable:
    """Return the table of single disturbances."""
    del seed
    rows: list[Row] = []
    digits: dict[str, int] = {}
    for name, outcomes in by_method.items():
        short = short_title(METHODS[name].title)
        detected, delay = f"{short}: detected", f"{short}: delay [s]"
        digits |= {detected: 0, delay: 3}
        # The first recording with disturbances of each object; fresh ones, if there are.
        disturbed = [
            outcome for outcome in outcomes if outcome.disturbances and outcome.case != "failed"
        ]
        role = "fresh" if any(outcome.role == "fresh" for outcome in disturbed) else "main"
        first: dict[str, GraspOutcome] = {}
        for grasp in sorted(disturbed, key=lambda grasp: grasp.recording):
            if grasp.role == role:
                first.setdefault(grasp.object, grasp)
        for grasp in first.values():
            for number, disturbance in enumerate(grasp.disturbances, 1):
                keys: Keys = {"recording": grasp.recording, "disturbance": number}
                if name == next(iter(by_method)):
                    rows.append(Row(keys | {"figure": "from [s]"}, disturbance.start))
                    rows.append(Row(keys | {"figure": "to [s]"}, disturbance.end))
                    rows.append(Row(keys | {"figure": "slides"}, float(disturbance.slides)))
                found_it = math.isfinite(disturbance.delay)
                rows.append(Row(keys | {"figure": detected}, float(found_it)))
                rows.append(Row(keys | {"figure": delay}, disturbance.delay))
    note = (
        "Every disturbance of one recording of each object: the first by name with disturbances, "
        "from recordings not used for training. 1: detected by an alarm; 0: missed."
    )
    title = "Experiment 2: single disturbances"
    lines = ("recording", "disturbance")
    digits |= {"slides": 0, "from [s]": 2, "to [s]": 2}
    return ResultTable("disturbances", title, note, rows, lines, digits_of=digits)


def _groups(outcomes: Sequence[GraspOutcome]) -> Iterator[tuple[str, list[GraspOutcome]]]:
    """Yield the outcomes of each role, and of all roles if there are several."""
    roles = [role for role in ROLE_TITLES if any(outcome.role == role for outcome in outcomes)]
    for role in roles:
        yield ROLE_TITLES[role], [outcome for outcome in outcomes if outcome.role == role]
    if len(roles) > 1:
        yield "all", list(outcomes)


def _methods(plan: StudyPlan) -> list[str]:
    names = QUICK_EXPERIMENT_METHODS if plan.quick else EXPERIMENT_METHODS
    return [name for name in names if name in METHODS]
