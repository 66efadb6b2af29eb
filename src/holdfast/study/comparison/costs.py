"""What a decision costs: features and probability of a recording, and a live update."""

import time
from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from holdfast.classifiers import LinearClassifier
from holdfast.detector import Detector
from holdfast.features import DEPLOYED_FEATURES, Tare, parse_features
from holdfast.features.specs import HOLDFAST_FEATURES, FeatureSpec
from holdfast.model import FingerModel, Model
from holdfast.recordings import Recording
from holdfast.study.comparison.jobs import Results, titles
from holdfast.study.evaluation.fitted_method import FittedMethod, gather_training_samples
from holdfast.study.evaluation.recording_features import corpus_features
from holdfast.study.evaluation.variation import Variation
from holdfast.study.methods import METHODS, hand_signal
from holdfast.study.methods.paper import WINDOW
from holdfast.study.plan import Corpus, StudyPlan
from holdfast.study.report.result_tables import Key, ResultTable, Row
from holdfast.study.tasks import Task

TASK = "cost"
FITTED_TO = 4
"""Recordings that are enough for a classifier whose time is taken."""
ROUNDS = 7
N_UPDATES = 3_000
N_WARM = 200
LIVE: dict[str, tuple[FeatureSpec, ...]] = {
    "logreg": parse_features(DEPLOYED_FEATURES, WINDOW),
    "svm": parse_features(DEPLOYED_FEATURES, WINDOW),
    "holdfast": HOLDFAST_FEATURES,
}
"""Features of the methods whose model the detector runs; all have a linear rule."""
MICRO = 1e6


class Cost(msgspec.Struct, frozen=True):
    """Times of one method [s], for one sample of one finger.

    Attributes:
        features: to compute them, of a whole recording, its forces given.
        probability: to get it from the features.
    """

    features: float
    probability: float


class Costs(msgspec.Struct, frozen=True):
    """Times of all methods, taken in one process.

    Attributes:
        methods: by name.
        live: by name, median time of `Detector.update` of all fingers of a hand [s].
        n_fingers: of that hand.
    """

    methods: dict[str, Cost]
    live: dict[str, float]
    n_fingers: int


def tasks(plan: StudyPlan) -> list[Task]:
    """One task, for times are compared."""
    arguments = (plan.main, tuple(titles(plan)), plan.seed)
    return [Task(TASK, measure, arguments, Costs, cost=30.0)]


def measure(corpus: Corpus, names: Sequence[str], seed: int) -> Costs:
    """The times of methods, the least of some rounds.

    Args:
        corpus: of whose recordings the first is taken.
        names: of the methods.
        seed: of the classifiers.
    """
    few = msgspec.structs.replace(corpus, recordings=_few(corpus.recordings))
    recording = few.load()[0]
    live = {name: _live(recording, few, LIVE[name]) for name in names if name in LIVE}
    costs = {name: _cost(name, few, seed) for name in names}
    return Costs(costs, live, len(_fingers(recording, few)))


def table(plan: StudyPlan, results: Results) -> ResultTable:
    """What a decision costs."""
    costs: Costs = results[TASK]
    rows: list[Row] = []
    for name, title in titles(plan).items():
        cost = costs.methods[name]
        times = {"features [µs]": cost.features, "probability [µs]": cost.probability}
        times["both [µs]"] = sum(times.values())
        if name in costs.live:
            times["live, a hand [µs]"] = costs.live[name]
        keys: dict[str, Key] = {"method": title}
        rows += [Row(keys | {"figure": each}, MICRO * value) for each, value in times.items()]
    note = (
        "Times of this machine, which differ from run to run; compare them with one another. "
        "For one sample of one finger (of a hand, where the hand is judged as a whole), of a "
        "whole recording at once; forces are given to most, holdfast's are made anew. Live: the "
        f"median of one Detector.update of {costs.n_fingers} fingers, from readings to states."
    )
    return ResultTable("cost", "Cost of a decision", note, rows, ("method",), digits=2)


def _cost(name: str, corpus: Corpus, seed: int) -> Cost:
    method = METHODS[name]
    recordings = corpus_features(method, corpus, Variation())
    fitted = FittedMethod.fit(
        method, gather_training_samples(recordings, 2_000), range(len(recordings)), seed
    )
    recording = corpus.load()[0]
    hand = hand_signal(recording, Tare.parse(corpus.tare), tuple(recordings[0].times))
    n = sum(len(rows) for rows in recordings[0].features.values())
    first = recordings[0].features
    return Cost(
        features=_least(lambda: method.features(hand)) / n,
        probability=_least(
            lambda: [c.probability(first[unit]) for unit, c in fitted.classifiers.items()]
        )
        / n,
    )


def _live(recording: Recording, corpus: Corpus, features: tuple[FeatureSpec, ...]) -> float:
    """Median time of an update [s]; what the rule says does not matter."""
    ones = (1.0,) * len(features)
    rule = LinearClassifier(mean=ones, scale=ones, coefficients=(0.01,) * len(ones), intercept=0.1)
    modules = {name: recording.modules[name] for name in _fingers(recording, corpus)}
    fingers = {
        name: FingerModel(features=features, classifier=rule, sensor=module.sensor.name)
        for name, module in modules.items()
    }
    sensors = {module.sensor.name: module.sensor for module in modules.values()}
    detector = Detector(Model(fingers=fingers, sensors=sensors, rate=corpus.rate))
    n = min(N_WARM + N_UPDATES, *(module.n_samples for module in modules.values()))
    nanoseconds = []
    for k in range(n):
        samples = {name: module.readings[k] for name, module in modules.items()}
        start = time.perf_counter_ns()
        detector.update(samples, k / corpus.rate)
        nanoseconds.append(time.perf_counter_ns() - start)
    return float(np.median(nanoseconds[min(N_WARM, n // 2) :])) * 1e-9


def _fingers(recording: Recording, corpus: Corpus) -> list[str]:
    return [name for name in corpus.fingers if name in recording.modules]


def _few(names: Sequence[str]) -> tuple[str, ...]:
    """Some recordings, spread over all."""
    places = np.linspace(0, len(names) - 1, min(FITTED_TO, len(names))).round().astype(int)
    return tuple(names[place] for place in np.unique(places))


def _least(work: Callable[[], object]) -> float:
    work()
    seconds = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return min(seconds)
