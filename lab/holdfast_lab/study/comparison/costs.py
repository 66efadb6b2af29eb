"""The time of a decision: features and probability of a recording, and a live update."""

import time
from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from holdfast.classifiers import Linear
from holdfast.detector import Detector
from holdfast.features import DEFAULT_WINDOW, DEPLOYED_FEATURES, Tare, parse_features
from holdfast.features.specs import HOLDFAST_FEATURES, FeatureSpec
from holdfast.model import FingerModel, Head, Model
from holdfast.recordings import Recording
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.jobs import Results, method_titles
from holdfast_lab.study.evaluation.fitted_method import MethodTraining
from holdfast_lab.study.evaluation.recording_features import corpus_features
from holdfast_lab.study.methods import METHODS, hand_signal
from holdfast_lab.study.plan import Corpus, StudyPlan
from holdfast_lab.tasks import Task

TASK = "cost"
N_RECORDINGS = 4
"""Recordings that the timed classifiers are fitted to."""
MAX_TIMED_SAMPLES = 2_000
"""Samples of a finger that the timed classifiers are fitted to."""
N_COST_ROUNDS = 7
N_UPDATES = 3_000
N_WARM_UP = 200
LIVE_FEATURES: dict[str, tuple[FeatureSpec, ...]] = {
    "logreg": parse_features(DEPLOYED_FEATURES, DEFAULT_WINDOW),
    "svm": parse_features(DEPLOYED_FEATURES, DEFAULT_WINDOW),
    "holdfast": HOLDFAST_FEATURES,
}
"""Features of the methods that the detector can run; all have a linear rule."""
MICROSECONDS = 1e6


class MethodCost(msgspec.Struct, frozen=True):
    """Times of one method for one sample of one finger [s].

    Attributes:
        features: of the features of a whole recording, with given forces.
        probability: of the probability, with given features.
    """

    features: float
    probability: float


class MethodCosts(msgspec.Struct, frozen=True):
    """Times of all methods, measured in one process.

    Attributes:
        methods: by name.
        live: median time of `Detector.update` for all fingers of a hand, by name [s].
        n_fingers: of that hand.
    """

    methods: dict[str, MethodCost]
    live: dict[str, float]
    n_fingers: int


def tasks(plan: StudyPlan) -> list[Task]:
    """Return one task, so that all times are measured in one process."""
    arguments = (plan.main, tuple(method_titles(plan)), plan.seed)
    return [Task(TASK, measure_costs, arguments, MethodCosts, cost=30.0)]


def measure_costs(corpus: Corpus, names: Sequence[str], seed: int) -> MethodCosts:
    """Measure the times of methods: the shortest of several rounds.

    Args:
        corpus: its first recording is used.
        names: of the methods.
        seed: of the classifiers.
    """
    # At even steps, because recordings are sorted by object and case.
    every = corpus.recordings
    steps = np.linspace(0, len(every) - 1, min(N_RECORDINGS, len(every))).round().astype(int)
    few = msgspec.structs.replace(corpus, recordings=tuple(every[k] for k in np.unique(steps)))
    recording = few.load()[0]
    live = {
        name: _measure_update(recording, few, LIVE_FEATURES[name])
        for name in names
        if name in LIVE_FEATURES
    }
    costs = {name: _measure_method(name, few, seed) for name in names}
    return MethodCosts(costs, live, len(_fingers(recording, few)))


def table(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of the times of a decision."""
    costs: MethodCosts = results[TASK]
    rows: list[Row] = []
    for name, title in method_titles(plan).items():
        cost = costs.methods[name]
        times = {"features [µs]": cost.features, "probability [µs]": cost.probability}
        times["both [µs]"] = sum(times.values())
        if name in costs.live:
            times["live, a hand [µs]"] = costs.live[name]
        keys: dict[str, Key] = {"method": title}
        rows += [Row(keys | {"figure": f}, MICROSECONDS * each) for f, each in times.items()]
    note = (
        "Times of this machine, which differ from run to run: compare them only with each other. "
        "For one sample of one finger (of one hand, for a whole-hand method), from a whole "
        "recording at once. Most methods get the forces; holdfast computes its own. Live: the "
        f"median of one Detector.update of {costs.n_fingers} fingers, from readings to states."
    )
    return ResultTable("cost", "Cost of a decision", note, rows, ("method",), digits=2)


def _measure_method(name: str, corpus: Corpus, seed: int) -> MethodCost:
    method = METHODS[name]
    recordings = corpus_features(method, corpus)
    fitted = MethodTraining.of(method, recordings, MAX_TIMED_SAMPLES, seed).fit()
    first = recordings[0]
    hand = hand_signal(corpus.load()[0], Tare.parse(corpus.tare), tuple(first.times))
    n = sum(len(rows) for rows in first.features.values())

    def probabilities() -> object:
        return [
            classifier.probability(first.features[unit])
            for unit, classifier in fitted.classifiers.items()
        ]

    return MethodCost(
        features=_shortest(lambda: method.features(hand)) / n,
        probability=_shortest(probabilities) / n,
    )


def _measure_update(
    recording: Recording, corpus: Corpus, features: tuple[FeatureSpec, ...]
) -> float:
    """Return the median time of an update [s]."""
    # The weights do not matter for the time: any rule of this length will do.
    ones = np.ones(len(features))
    rule = Linear.of(ones, ones, 0.01 * ones, 0.1)
    head = Head(name="stable", link="logit", features=features, rule=rule)
    modules = {name: recording.modules[name] for name in _fingers(recording, corpus)}
    fingers = {
        name: FingerModel(heads=(head,), sensor=module.sensor.name)
        for name, module in modules.items()
    }
    sensors = {module.sensor.name: module.sensor for module in modules.values()}
    detector = Detector(Model(fingers=fingers, sensors=sensors, rate=corpus.rate))
    n = min(N_WARM_UP + N_UPDATES, *(module.n_samples for module in modules.values()))
    nanoseconds = []
    for k in range(n):
        samples = {name: module.readings[k] for name, module in modules.items()}
        start = time.perf_counter_ns()
        detector.update(samples, k / corpus.rate)
        nanoseconds.append(time.perf_counter_ns() - start)
    # Without the warm-up, of which a short recording has less.
    return float(np.median(nanoseconds[min(N_WARM_UP, n // 2) :])) * 1e-9


def _fingers(recording: Recording, corpus: Corpus) -> list[str]:
    return [name for name in corpus.fingers if name in recording.modules]


def _shortest(work: Callable[[], object]) -> float:
    """Return the shortest time of a piece of work, after one warm-up [s]."""
    work()
    seconds = []
    for _ in range(N_COST_ROUNDS):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return min(seconds)
