"""What a decision costs: features and probability of a recording, and a live update."""

import time
from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from holdfast import benchmark
from holdfast.features import Tare
from holdfast.methods import METHODS, signal_of
from holdfast.study.changes import Change
from holdfast.study.corpus import Corpus
from holdfast.study.expert import Expert, look, material_of
from holdfast.study.jobs import Results, titles
from holdfast.study.plan import Plan
from holdfast.study.tables import Key, Row, Table
from holdfast.study.work import Task

TASK = "cost"
FITTED_TO = 4
"""Recordings that are enough for a classifier whose time is taken."""
ROUNDS = 3
N_UPDATES = 3_000
LIVE = ("logreg", "svm")
"""Methods whose model the detector runs; both have the deployed features and a linear rule."""
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
        live: median time of `Detector.update` of a hand of four fingers [s].
    """

    methods: dict[str, Cost]
    live: float


def tasks(plan: Plan) -> list[Task]:
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
    live = benchmark.hand_update(N_UPDATES)["p50"]
    return Costs({name: _cost(name, few, seed) for name in names}, live)


def table(plan: Plan, results: Results) -> Table:
    """What a decision costs."""
    costs: Costs = results[TASK]
    rows: list[Row] = []
    for name, title in titles(plan).items():
        cost = costs.methods[name]
        times = {"features [µs]": cost.features, "probability [µs]": cost.probability}
        times["both [µs]"] = sum(times.values())
        if name in LIVE:
            times["live, a hand [µs]"] = costs.live
        keys: dict[str, Key] = {"method": title}
        rows += [Row(keys | {"figure": each}, MICRO * value) for each, value in times.items()]
    note = (
        "Times of this machine, which differ from run to run; compare them with one another. "
        "For one sample of one finger (of a hand, where the hand is judged as a whole), of a "
        "whole recording at once, forces given. Live: the median of one `Detector.update` of "
        "four fingers of 30 taxels, from readings to states."
    )
    return Table("cost", "Cost of a decision", note, rows, ("method",), digits=2)


def _cost(name: str, corpus: Corpus, seed: int) -> Cost:
    method = METHODS[name]
    recordings = look(method, corpus, Change())
    expert = Expert.fit(method, material_of(recordings, 2_000), range(len(recordings)), seed)
    recording = corpus.load()[0]
    hand = signal_of(recording, Tare.parse(corpus.tare), tuple(recordings[0].times))
    n = sum(len(rows) for rows in recordings[0].features.values())
    first = recordings[0].features
    return Cost(
        features=_least(lambda: method.features(hand)) / n,
        probability=_least(
            lambda: [c.probability(first[unit]) for unit, c in expert.classifiers.items()]
        )
        / n,
    )


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
