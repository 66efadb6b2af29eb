"""Part of the study: the figures of the paper.

A recording is chosen by what was done in it and by its name, not by the look of its figure.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Literal

import msgspec
import numpy as np

from holdfast.detection import Tare
from holdfast.errors import TrainingError
from holdfast.plots.time_series import FingerSeries, finger_series
from holdfast_lab.figures.experiment import draw_experiment, draw_features, draw_forces
from holdfast_lab.report.sections import ReportFigure
from holdfast_lab.study.evaluation.fitted_method import MethodTraining
from holdfast_lab.study.evaluation.recording_features import corpus_features
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.paper.paper_tables import first_finger
from holdfast_lab.study.plan import Corpus, StudyPlan
from holdfast_lab.tasks import Task

TASK = "figures/experiments"
TITLES = {"logreg": "LogReg", "svm": "SVM"}
"""Methods whose decisions are drawn, and their titles."""
SEARCH_ORDER = ("fresh", "others", "gentle", "vigorous", "main")
"""Roles in which a recording is searched; those not used for training come first."""

Experiment = Literal["protocol", "failed", "disturbed", "any"]
EXPERIMENT_CASES: dict[Experiment, str] = {"failed": "failed", "disturbed": "2"}
"""Case of each experiment in the metadata of a recording; 2 is with disturbances."""
CAPTIONS: dict[Experiment, tuple[str, str]] = {
    "failed": ("experiment-1", "Experiment 1, a grasp that failed"),
    "disturbed": ("experiment-2", "Experiment 2: locked, disturbed, released"),
    "any": ("experiment", "One recording and predicted states"),
}
"""Name of the figure of each experiment, and first words of its caption."""


class ExampleRecording(msgspec.Struct, frozen=True):
    """A recording that a figure shows.

    Attributes:
        experiment: "protocol" (of the main recordings, without predictions), "failed",
            "disturbed", or "any" if no recording has a case.
        role: of its corpus.
        recording: name of the recording.
        finger: that is drawn.
        states: by name of a method: (n,) state codes, by a fit without this recording.
        stable: by name of a method: (n,) probability that the finger is stable; -1 if unknown.
    """

    experiment: Experiment
    role: str
    recording: str
    finger: str
    states: dict[str, list[int]] = {}
    stable: dict[str, list[float]] = {}


def tasks(plan: StudyPlan) -> list[Task]:
    """Return one task: the decisions of LogReg and SVM on the recordings of the figures."""
    corpora = {role: plan.corpora[role] for role in SEARCH_ORDER if role in plan.corpora}
    arguments = (corpora, first_finger(plan), plan.seed)
    return [Task(TASK, predict_examples, arguments, list[ExampleRecording], cost=5.0)]


def figures(plan: StudyPlan, results: Mapping[str, Any]) -> list[ReportFigure]:
    """Return the figures of the paper."""
    every: list[ReportFigure] = []
    for example in results[TASK]:
        corpus = plan.corpora[example.role]
        (recording,) = _select(corpus, example.finger, example.recording).load()
        series = finger_series(recording, example.finger, Tare.parse(corpus.tare))
        series = series._replace(name=f"{example.recording}, {example.finger}")
        if example.experiment == "protocol":
            every += protocol_figures(series)
        else:
            every.append(experiment_figure(example, series))
    return every


def predict_examples(
    corpora: Mapping[str, Corpus], finger: str, seed: int
) -> list[ExampleRecording]:
    """Choose a recording of each experiment, and predict its states without training on it.

    Args:
        corpora: "main" for training, and others, in the order in which they are searched.
        finger: for training and prediction.
        seed: of the fits.

    Raises:
        TrainingError: the finger has labels of one class only.
    """
    main = corpora["main"]
    examples = list(choose_examples(corpora, finger))
    for name in TITLES:
        features = corpus_features(METHODS[name], _select(main, finger))
        training = MethodTraining.of(METHODS[name], features, seed=seed)
        for example in examples:
            # By a fit to all other main recordings.
            key = (example.role, example.recording)
            numbers = {
                k for k, other_name in enumerate(main.recordings) if key != ("main", other_name)
            }
            fitted = training.fit(numbers)
            if not fitted.classifiers:
                raise TrainingError(
                    f"without {example.recording} the {example.finger} has labels of one class"
                )
            corpus = _select(corpora[example.role], example.finger, example.recording)
            (shown,) = corpus_features(training.method, corpus)
            scores = fitted.scores(shown).fingers[example.finger]
            example.states[name] = scores.states().tolist()
            # JSON has no NaN.
            example.stable[name] = np.nan_to_num(scores.probability, nan=-1.0).round(4).tolist()
    # The first figures show what the paper does, so a recording with disturbances.
    first = _first(main, finger, EXPERIMENT_CASES["disturbed"]) or main.recordings[0]
    return [ExampleRecording("protocol", "main", first, finger), *examples]


def choose_examples(corpora: Mapping[str, Corpus], finger: str) -> Iterator[ExampleRecording]:
    """Yield a recording of each experiment; the first recording if none has a case."""
    any_found = False
    for experiment, case in EXPERIMENT_CASES.items():
        names = ((role, _first(corpus, finger, case)) for role, corpus in corpora.items())
        for role, name in names:
            if name is not None:
                any_found = True
                yield ExampleRecording(experiment, role, name, finger)
                break
    if not any_found:
        role, corpus = next(iter(corpora.items()))
        yield ExampleRecording("any", role, corpus.recordings[0], finger)


def _first(corpus: Corpus, finger: str, case: str) -> str | None:
    """Return the name of the first recording of a case."""
    for recording in corpus.load():
        if recording.metadata.get("case") == case and finger in recording.modules:
            return recording.name
    return None


def _select(corpus: Corpus, finger: str, recording: str | None = None) -> Corpus:
    """Return one finger of a corpus, or of one recording of it."""
    names = corpus.recordings if recording is None else (recording,)
    return msgspec.structs.replace(corpus, fingers=(finger,), recordings=names)


def protocol_figures(series: FingerSeries) -> Iterator[ReportFigure]:
    """Yield the figures of forces and of features."""
    chosen = "Chosen: the first recording with disturbances, by name."
    yield ReportFigure(
        "forces",
        "Fingertip force in one recording. The shades are the phases of the experiment, as in the "
        f"paper's figure of the phases. F_x is along the normal of the pad. {chosen}",
        draw_forces(series),
    )
    yield ReportFigure(
        "features",
        "Features and labels of one experiment, as in the paper. From top to bottom: components "
        "of the force; its amplitude F_a and mean m over the window; the instability sigma; the "
        f"label, 1 = stable. {chosen}",
        draw_features(series),
    )


def experiment_figure(example: ExampleRecording, series: FingerSeries) -> ReportFigure:
    """Return the figure of an experiment with predicted states."""
    name, title = CAPTIONS[example.experiment]
    predicted = {TITLES[method]: np.array(states) for method, states in example.states.items()}
    stable = {
        TITLES[method]: np.where(np.array(values) < 0, np.nan, values)
        for method, values in example.stable.items()
    }
    fits = (
        "fits to all other recordings"
        if example.role == "main"
        else f"fits to the main recordings (this recording is from {example.role!r})"
    )
    caption = (
        f"{title}. F_a, sigma, P(stable), the label, and the states that LogReg and SVM predict "
        f"by {fits}. Beside each strip: the fraction of labelled samples that are correct. "
        "Chosen: the first recording by name."
    )
    return ReportFigure(name, caption, draw_experiment(series, predicted, stable))
