"""Part of the study: the paper's figures, of recordings that are chosen by name alone.

Which recording is shown depends on nothing but what was done in it and what it is called, so
that no figure is shown because it looks well.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Literal

import msgspec
import numpy as np

from holdfast.errors import TrainingError
from holdfast.features import Tare
from holdfast.plots.experiment import draw_experiment, draw_features, draw_forces
from holdfast.plots.time_series import Codes, FingerSeries, finger_series
from holdfast.study.evaluation.fitted_method import (
    FittedMethod,
    TrainingSamples,
    gather_training_samples,
)
from holdfast.study.evaluation.recording_features import corpus_features
from holdfast.study.evaluation.variation import Variation
from holdfast.study.methods import METHODS, Method
from holdfast.study.paper.paper_tables import first_finger
from holdfast.study.plan import Corpus, StudyPlan
from holdfast.study.report.html_report import ReportFigure
from holdfast.study.report.result_tables import ResultTable
from holdfast.study.tasks import Task

TASK = "figures/experiments"
SHOWN = ("logreg", "svm")
UNSEEN = ("fresh", "others", "gentle", "vigorous", "main")
"""Where a recording is looked for, in this order: what did not train comes first."""

Experiment = Literal["protocol", "failed", "disturbed", "any"]
CASES: dict[Experiment, str] = {"failed": "failed", "disturbed": "2"}
"""What its metadata say of the case of a recording: 2 is with disturbances."""


class Shown(msgspec.Struct, frozen=True):
    """A recording that a figure shows.

    Attributes:
        experiment: "protocol" (of the main recordings, nothing predicted), "failed",
            "disturbed", or "any" where no recording tells its case.
        role: of its corpus.
        recording: its name.
        finger: that is shown.
        states: by the name of a method, (n,) codes of what a fit without it says.
    """

    experiment: Experiment
    role: str
    recording: str
    finger: str
    states: dict[str, list[int]] = {}


def tasks(plan: StudyPlan) -> list[Task]:
    """One: what LogReg and SVM say of the recordings of the figures."""
    corpora = {role: plan.corpora[role] for role in UNSEEN if role in plan.corpora}
    arguments = (corpora, first_finger(plan), plan.seed)
    return [Task(TASK, predict, arguments, list[Shown], cost=5.0)]


def tables(plan: StudyPlan, results: Mapping[str, Any]) -> list[ResultTable]:
    """None."""
    return []


def figures(plan: StudyPlan, results: Mapping[str, Any]) -> list[ReportFigure]:
    """The paper's figures."""
    drawn: list[ReportFigure] = []
    for shown in results[TASK]:
        series = _series(plan.corpora[shown.role], shown.recording, shown.finger)
        if shown.experiment == "protocol":
            drawn += _of_protocol(series)
        else:
            drawn.append(_of_experiment(shown, series))
    return drawn


def predict(corpora: Mapping[str, Corpus], finger: str, seed: int) -> list[Shown]:
    """What the paper's methods say of a recording of each experiment, not having seen it.

    Args:
        corpora: "main", which trains, and others, in the order in which they are searched.
        finger: whose labels train, and whose are predicted.
        seed: of the fits.

    Raises:
        TrainingError: the finger has one class.
    """
    main = corpora["main"]
    judged = list(_chosen(corpora, finger))
    for name in SHOWN:
        material = gather_training_samples(
            corpus_features(METHODS[name], _of(main, finger), Variation())
        )
        for shown in judged:
            states = _states(METHODS[name], material, corpora, shown, seed)
            shown.states[name] = states.tolist()
    first = _first(main, finger, CASES["disturbed"]) or main.recordings[0]
    return [Shown("protocol", "main", first, finger), *judged]


def _chosen(corpora: Mapping[str, Corpus], finger: str) -> Iterator[Shown]:
    """The recording of each experiment; the first of all where no case is told."""
    found = False
    for experiment, case in CASES.items():
        names = ((role, _first(corpus, finger, case)) for role, corpus in corpora.items())
        for role, name in names:
            if name is not None:
                found = True
                yield Shown(experiment, role, name, finger)
                break
    if not found:
        role, corpus = next(iter(corpora.items()))
        yield Shown("any", role, corpus.recordings[0], finger)


def _first(corpus: Corpus, finger: str, case: str) -> str | None:
    """The first recording of a case, by name."""
    for recording in corpus.load():
        if recording.metadata.get("case") == case and finger in recording.modules:
            return recording.name
    return None


def _states(
    method: Method,
    material: TrainingSamples,
    corpora: Mapping[str, Corpus],
    shown: Shown,
    seed: int,
) -> Codes:
    """What a fit to all main recordings, but for the one that is judged, says of it."""
    names = corpora["main"].recordings
    places = {k for k, name in enumerate(names) if (shown.role, shown.recording) != ("main", name)}
    fitted = FittedMethod.fit(method, material, places, seed)
    if not fitted.classifiers:
        raise TrainingError(f"without {shown.recording} the {shown.finger} has labels of one class")
    (seen,) = corpus_features(
        method, _of(corpora[shown.role], shown.finger, shown.recording), Variation()
    )
    return fitted.scores(seen).decide(seen, seen.labels).fingers[shown.finger].states


def _of(corpus: Corpus, finger: str, recording: str | None = None) -> Corpus:
    """One finger of a corpus, or of one recording of it."""
    names = corpus.recordings if recording is None else (recording,)
    return msgspec.structs.replace(corpus, fingers=(finger,), recordings=names)


def _series(corpus: Corpus, name: str, finger: str) -> FingerSeries:
    (recording,) = _of(corpus, finger, name).load()
    series = finger_series(recording, finger, Tare.parse(corpus.tare))
    return series._replace(name=f"{name}, {finger}")


def _of_protocol(series: FingerSeries) -> Iterator[ReportFigure]:
    chosen = "The first of the recordings with disturbances, by name."
    yield ReportFigure(
        "forces",
        "Components of the fingertip force over one recording, and what was going on (the paper's "
        f"figure of the phases). F_x is along the normal of the pad. {chosen}",
        draw_forces(series),
    )
    yield ReportFigure(
        "features",
        "Features and labels of one experiment (the paper's figure of the same). From above: the "
        "components of the force; its amplitude F_a and mean m over the window; the instability "
        f"sigma; the label, 1 = stable. {chosen}",
        draw_features(series),
    )


_TITLES: dict[Experiment, tuple[str, str]] = {
    "failed": ("experiment-1", "Experiment 1, a grasp that failed"),
    "disturbed": ("experiment-2", "Experiment 2: locked, disturbed, released"),
    "any": ("experiment", "One recording and what is predicted of it"),
}


def _of_experiment(shown: Shown, series: FingerSeries) -> ReportFigure:
    name, title = _TITLES[shown.experiment]
    predicted = {
        {"logreg": "LogReg", "svm": "SVM"}[method]: np.array(states)
        for method, states in shown.states.items()
    }
    where = (
        "by fits to all the other recordings"
        if shown.role == "main"
        else f"by fits to the main recordings; this one is of {shown.role!r}"
    )
    caption = (
        f"{title}. F_a, sigma, the label, and what LogReg and SVM predict {where}. The share of "
        "labelled samples that they have right stands beside. Chosen: the first by name."
    )
    return ReportFigure(name, caption, draw_experiment(series, predicted))
