"""The paper's protocol as printed: samples pooled, split at random, searched, fitted, counted.

Of the 25 parts of a pool, 0 to 4 are the 20 % held out; the rest train, in five folds of four.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.classifiers import RECIPES, Classifier, Parameters, Recipe, Samples, Threshold
from holdfast.metrics import bootstrap_interval, ratio_of_sums
from holdfast.metrics.intervals import Interval
from holdfast.metrics.statistics import percent
from holdfast.study.paper.pooled_samples import Integers, Pool, pooled
from holdfast.study.plan import Corpus
from holdfast.study.report.result_tables import Row
from holdfast.training.design import thin, thinning_step
from holdfast.training.setting import SEARCH_SAMPLES
from holdfast.training.splits import inner_folds
from holdfast.training.tuning import search

N_FOLDS = 5
N_HELD = 5

TRAINING = "training data"
VALIDATED = "cross-validated"
HELD_OUT = "held out"
FRESH = "fresh recordings"
ELSEWHERE = "other recordings"
OBJECTS = "other objects"
ON = (TRAINING, VALIDATED, HELD_OUT, FRESH, ELSEWHERE, OBJECTS)
"""What a figure may be measured on."""

WAYS: dict[str, Recipe] = {**RECIPES, "threshold": Threshold(side="below")}
"""How a classifier is fitted; a threshold calls stable what is below it."""
Kind = tuple[str, tuple[str, ...]]
"""A classifier, and what it sees."""

ConfusionCounts = list[list[int]]
"""Of each recording [TN, FP, FN, TP]."""

CONFUSION_RATES: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "TNR": ((0,), (0, 1)),
    "FPR": ((1,), (0, 1)),
    "FNR": ((2,), (2, 3)),
    "TPR": ((3,), (2, 3)),
    "FDR": ((1,), (1, 3)),
    "accuracy": ((0, 3), (0, 1, 2, 3)),
}
"""Which of TN, FP, FN, TP each figure divides by which."""


class FitBudget(msgspec.Struct, frozen=True):
    """How much work goes into one classifier.

    Attributes:
        trials: of the search for hyper-parameters.
        n_fit: samples that a fit takes at most, evenly spread over those it may take.
    """

    trials: int
    n_fit: int


class Cell(msgspec.Struct, frozen=True):
    """How one classifier on some features did.

    Attributes:
        classifier: its name.
        features: what it saw, of `COLUMNS`.
        parameters: that the search found.
        n_fitted: samples of the fit.
        counts: for what it was measured on, the confusion counts of each recording.
    """

    classifier: str
    features: tuple[str, ...]
    parameters: dict[str, float | str | None]
    n_fitted: int
    counts: dict[str, ConfusionCounts]


def judge(
    corpora: Mapping[str, Corpus],
    finger: str,
    window: int,
    kinds: Sequence[Kind],
    effort: FitBudget,
    seed: int,
    thorough: bool,
) -> list[Cell]:
    """How classifiers on features of one finger at one window do, by the paper's protocol.

    Args:
        corpora: "main", which trains; "fresh" and "others" are judged too where they are given.
        finger: whose force.
        window: N_w.
        kinds: classifiers, and what they see.
        effort: of each.
        seed: of split and search.
        thorough: also on the training data, cross-validated, and on other objects by leaving
            one out where there are no "others".

    Raises:
        TrainingError: the finger has one class.
    """
    rate = corpora["main"].rate
    main = pooled(corpora["main"], rate, finger, window, seed)
    roles = [(role, on) for role, on in (("fresh", FRESH), ("others", OBJECTS)) if role in corpora]
    tests = {on: pooled(corpora[role], rate, finger, window, seed) for role, on in roles}
    return [_judge(main, tests, kind, effort, seed, thorough) for kind in kinds]


@dataclass(frozen=True)
class _Fit:
    """A way of fitting, ready for samples."""

    recipe: Recipe
    parameters: Parameters
    n_fit: int
    seed: int

    def __call__(self, samples: Samples) -> Classifier:
        taken = ungrouped(thin(samples, self.n_fit))
        return self.recipe.fit(taken, self.parameters, self.seed)

    def out_of_fold(
        self, samples: Samples, folds: Iterable[npt.NDArray[np.bool_]], n_recordings: int
    ) -> Integers:
        """The counts of samples judged by a fit without their fold."""
        counts = np.zeros((n_recordings, 4), dtype=np.int64)
        for held in folds:
            counts += confusion_counts(self(samples.take(~held)), samples.take(held), n_recordings)
        return counts


def ungrouped(samples: Samples) -> Samples:
    """The samples as the paper takes them: all from one source, independent of each other."""
    return samples._replace(groups=np.zeros_like(samples.groups))


def _judge(
    main: Pool,
    tests: Mapping[str, Pool],
    kind: Kind,
    effort: FitBudget,
    seed: int,
    thorough: bool,
) -> Cell:
    classifier, names = kind
    how = WAYS[classifier]
    samples, n = main.only(names), len(main.objects)
    trains = main.parts >= N_HELD
    train = samples.take(trains)
    folds = main.parts[trains] % N_FOLDS
    parameters = _search(train, folds, how, effort.trials, seed)
    fit = _Fit(how, parameters, effort.n_fit, seed)
    rule = fit(train)
    counts = {HELD_OUT: confusion_counts(rule, samples.take(~trains), n)}
    for on, pool in tests.items():
        counts[on] = confusion_counts(rule, pool.only(names), len(pool.objects))
    if thorough:
        each_fold = (folds == fold for fold in range(N_FOLDS))
        counts[TRAINING] = confusion_counts(rule, train, n)
        counts[VALIDATED] = fit.out_of_fold(train, each_fold, n)
    for on, held in _without_corpora(main, tests, seed, thorough).items():
        counts[on] = fit.out_of_fold(samples, held, n)
    return Cell(
        classifier,
        tuple(names),
        dict(parameters),
        len(thin(train, effort.n_fit).stable),
        {on: counts[on].tolist() for on in ON if on in counts},
    )


def _without_corpora(
    main: Pool, tests: Mapping[str, Pool], seed: int, thorough: bool
) -> dict[str, list[npt.NDArray[np.bool_]]]:
    """The folds that stand for the corpora that there are not."""
    folds = {}
    if FRESH not in tests:
        folds[ELSEWHERE] = inner_folds(main.samples, N_FOLDS, seed)
    names = sorted({name for name in main.objects if name is not None})
    if OBJECTS not in tests and thorough and None not in main.objects and len(names) > 1:
        of_recording = np.array([names.index(str(name)) for name in main.objects])
        by_object = main.samples._replace(groups=of_recording[main.samples.groups])
        folds[OBJECTS] = inner_folds(by_object, len(names), seed)
    return folds


def _search(train: Samples, folds: Integers, how: Recipe, trials: int, seed: int) -> Parameters:
    """The hyper-parameters by Bayesian optimisation over random folds, as the paper's toolbox."""
    if not how.reference:
        return {}
    few = ungrouped(thin(train, SEARCH_SAMPLES))
    step = thinning_step(len(folds), SEARCH_SAMPLES)
    masks = [folds[::step] == fold for fold in range(N_FOLDS)]
    return search(few, masks, how, n_trials=trials, seed=seed)


def confusion_counts(classifier: Classifier, samples: Samples, n_recordings: int) -> Integers:
    """(n_recordings, 4) how many TN, FP, FN and TP each recording has; it alone decides."""
    called = classifier.probability(samples.features) >= classifier.threshold
    place = 4 * samples.groups + 2 * samples.stable + called
    return np.bincount(place, minlength=4 * n_recordings).reshape(-1, 4)


def rate_rows(
    counts: ConfusionCounts, names: Iterable[str], seed: int
) -> Iterator[tuple[str, Row]]:
    """Each figure of confusion counts by recording, as a row that has no keys yet.

    Args:
        counts: [TN, FP, FN, TP] of each recording; recordings without samples do not count.
        names: of `CONFUSION_RATES`.
        seed: of the bootstrap.
    """
    table = np.array(counts, dtype=np.int64).reshape(-1, 4)
    table = table[table.sum(axis=1) > 0]
    for name in names:
        part, whole = (table[:, list(columns)].sum(axis=1) for columns in CONFUSION_RATES[name])
        ours = percent(int(part.sum()), int(whole.sum()))
        interval = bootstrap_interval(ratio_of_sums(part, whole), len(table), seed=seed)
        yield name, Row({}, ours, n=len(table), interval=_percent(interval))


def _percent(interval: Interval | None) -> Interval | None:
    if interval is None:
        return None
    low, high = (None if end is None else 100 * end for end in interval)
    return low, high
