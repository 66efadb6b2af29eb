"""The protocol of the paper: pool samples, split at random, search, fit and count errors.

Of the 25 parts of a pool, parts 0 to 4 are the 20 % held out. The other parts are used for
training, in five folds of four parts.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.metrics import bootstrap_interval, ratio_of_sums
from holdfast.metrics.statistics import percent
from holdfast.sensors.types import Integers
from holdfast.training.classifiers import RECIPES, Parameters, Recipe, Samples
from holdfast.training.finger_samples import thin, thinning_step
from holdfast.training.setting import SEARCH_SAMPLES
from holdfast.training.splits import inner_folds
from holdfast_lab.classifiers import Classifier, StudyRecipe, ungrouped
from holdfast_lab.classifiers.threshold import Threshold
from holdfast_lab.report.result_tables import Row
from holdfast_lab.study.paper.pooled_samples import SamplePool, pool_samples
from holdfast_lab.study.plan import Corpus

N_FOLDS = 5
N_HELD_OUT_PARTS = 5

TRAINING = "training data"
VALIDATED = "cross-validated"
HELD_OUT = "held out"
FRESH = "fresh recordings"
OTHER_RECORDINGS = "other recordings"
UNSEEN_OBJECTS = "other objects"
TEST_DATA = (TRAINING, VALIDATED, HELD_OUT, FRESH, OTHER_RECORDINGS, UNSEEN_OBJECTS)
"""Data on which a classifier may be tested, in the order of the tables."""


SEARCHED_C = {"logreg": (1e-4, 1e4), "svm": (1e-5, 1e3)}
"""Range of C in which the search draws."""


@dataclass(frozen=True)
class FixedWeights:
    """A recipe whose class weights are fixed, and not found by the search.

    Attributes:
        name: of the recipe.
        class_weight: "balanced", or None to weight all samples alike.
    """

    name: str
    class_weight: str | None

    @property
    def recipe(self) -> Recipe:
        """The recipe, which fits the classifier."""
        return RECIPES[self.name]

    @property
    def reference(self) -> Parameters:
        """Reference parameters, with the fixed weights."""
        return self.fixed(self.recipe.reference)

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Classifier:
        """Fit a classifier with the fixed weights."""
        return self.recipe.fit(samples, self.fixed(parameters), seed)

    def fixed(self, parameters: Parameters) -> Parameters:
        """Return the parameters with the fixed weights."""
        return {**parameters, "class_weight": self.class_weight}


FIT_RECIPES: dict[str, StudyRecipe] = {
    **{name: FixedWeights(name, None) for name in RECIPES},
    **{f"{name}_balanced": FixedWeights(name, "balanced") for name in RECIPES},
    "threshold": Threshold(side="below"),
}
"""How each classifier is fitted; a threshold calls samples below it stable.

`logreg` and `svm` weight all samples alike, as the paper's toolbox does.
"""
Variant = tuple[str, tuple[str, ...]]
"""Name of a classifier, and its features."""

ConfusionCounts = list[list[int]]
"""[TN, FP, FN, TP] of each recording."""

CONFUSION_RATES: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "TNR": ((0,), (0, 1)),
    "FPR": ((1,), (0, 1)),
    "FNR": ((2,), (2, 3)),
    "TPR": ((3,), (2, 3)),
    "FDR": ((1,), (1, 3)),
    "accuracy": ((0, 3), (0, 1, 2, 3)),
}
"""Positions in [TN, FP, FN, TP] that are summed in numerator and denominator of each rate."""


class FitBudget(msgspec.Struct, frozen=True):
    """Limits of the work for one classifier.

    Attributes:
        trials: of the search for hyper-parameters.
        n_fit: maximum number of samples of a fit, which are selected at even steps.
    """

    trials: int
    n_fit: int


class VariantResult(msgspec.Struct, frozen=True):
    """Errors of one classifier on some features.

    Attributes:
        classifier: name of the classifier.
        features: of `COLUMNS`.
        parameters: hyper-parameters found by the search.
        n_fitted: number of samples of the fit.
        counts: for each kind of test data, the confusion counts of each recording.
    """

    classifier: str
    features: tuple[str, ...]
    parameters: dict[str, float | str | None]
    n_fitted: int
    counts: dict[str, ConfusionCounts]


def evaluate_variants(
    corpora: Mapping[str, Corpus],
    finger: str,
    window: int,
    variants: Sequence[Variant],
    budget: FitBudget,
    seed: int,
    thorough: bool,
) -> list[VariantResult]:
    """Evaluate classifiers on one finger and window, by the protocol of the paper.

    Args:
        corpora: "main" for training; "fresh" and "others" for tests, if they are given.
        finger: name of the finger.
        window: N_w [samples].
        variants: classifiers and their features.
        budget: of each classifier.
        seed: of split and search.
        thorough: test also on the training data, by cross-validation, and, without "others", by
            leaving one object out.

    Raises:
        TrainingError: the finger has labels of one class only.
    """
    rate = corpora["main"].rate
    main = pool_samples(corpora["main"], rate, finger, window, seed)
    roles = {
        role: on for role, on in (("fresh", FRESH), ("others", UNSEEN_OBJECTS)) if role in corpora
    }
    tests = {
        on: pool_samples(corpora[role], rate, finger, window, seed) for role, on in roles.items()
    }
    return [_evaluate(main, tests, variant, budget, seed, thorough) for variant in variants]


def confusion_counts(classifier: Classifier, samples: Samples, n_recordings: int) -> Integers:
    """Return the numbers (n_recordings, 4) of TN, FP, FN and TP of each recording."""
    called_stable = classifier.probability(samples.features) >= classifier.threshold
    # One number for each pair of a recording and an index in [TN, FP, FN, TP].
    cell = 4 * samples.groups + 2 * samples.positive + called_stable
    return np.bincount(cell, minlength=4 * n_recordings).reshape(-1, 4)


def rate_rows(
    counts: ConfusionCounts, names: Iterable[str], seed: int
) -> Iterator[tuple[str, Row]]:
    """Yield the name of each rate and its row, still without keys.

    Args:
        counts: [TN, FP, FN, TP] of each recording; recordings without samples are ignored.
        names: of `CONFUSION_RATES`.
        seed: of the bootstrap.
    """
    table = np.array(counts, dtype=np.int64).reshape(-1, 4)
    table = table[table.sum(axis=1) > 0]
    for name in names:
        part, whole = (table[:, list(columns)].sum(axis=1) for columns in CONFUSION_RATES[name])
        ours = percent(int(part.sum()), int(whole.sum()))
        interval = bootstrap_interval(ratio_of_sums(part, whole), len(table), seed=seed)
        if interval is not None:
            low, high = (None if end is None else 100 * end for end in interval)
            interval = (low, high)
        yield name, Row({}, ours, n=len(table), interval=interval)


@dataclass(frozen=True)
class _Fit:
    """A recipe with its hyper-parameters."""

    recipe: StudyRecipe
    parameters: Parameters
    n_fit: int
    seed: int

    def __call__(self, samples: Samples) -> Classifier:
        selected = ungrouped(thin(samples, self.n_fit))
        return self.recipe.fit(selected, self.parameters, self.seed)

    def out_of_fold(
        self, samples: Samples, folds: Iterable[npt.NDArray[np.bool_]], n_recordings: int
    ) -> Integers:
        """Return the counts of each fold, by a classifier that is fitted to the other folds."""
        counts = np.zeros((n_recordings, 4), dtype=np.int64)
        for left_out in folds:
            counts += confusion_counts(
                self(samples.take(~left_out)), samples.take(left_out), n_recordings
            )
        return counts


def _evaluate(
    main: SamplePool,
    tests: Mapping[str, SamplePool],
    variant: Variant,
    budget: FitBudget,
    seed: int,
    thorough: bool,
) -> VariantResult:
    name, features = variant
    recipe = FIT_RECIPES[name]
    samples, n = main.select(features), len(main.objects)
    in_training = main.parts >= N_HELD_OUT_PARTS
    train = samples.take(in_training)
    folds = main.parts[in_training] % N_FOLDS
    # Hyper-parameters by Bayesian optimisation of the error over random folds, as in the paper.
    parameters: Parameters = {}
    if isinstance(recipe, FixedWeights):
        # The masks are thinned by the step by which `thin` takes the samples.
        few = ungrouped(thin(train, SEARCH_SAMPLES))
        step = thinning_step(len(folds), SEARCH_SAMPLES)
        masks = [folds[::step] == fold for fold in range(N_FOLDS)]
        parameters = search(few, masks, recipe, budget.trials, seed)
    fit = _Fit(recipe, parameters, budget.n_fit, seed)
    classifier = fit(train)
    counts = {HELD_OUT: confusion_counts(classifier, samples.take(~in_training), n)}
    for on, pool in tests.items():
        counts[on] = confusion_counts(classifier, pool.select(features), len(pool.objects))
    if thorough:
        counts[TRAINING] = confusion_counts(classifier, train, n)
        counts[VALIDATED] = fit.out_of_fold(train, (folds == k for k in range(N_FOLDS)), n)
    for on, left_out in _substitute_folds(main, tests, seed, thorough).items():
        counts[on] = fit.out_of_fold(samples, left_out, n)
    return VariantResult(
        name,
        tuple(features),
        dict(parameters),
        len(thin(train, budget.n_fit).positive),
        {on: counts[on].tolist() for on in TEST_DATA if on in counts},
    )


def search(
    samples: Samples,
    folds: Sequence[npt.NDArray[np.bool_]],
    recipe: FixedWeights,
    n_trials: int,
    seed: int,
) -> Parameters:
    """Return the parameters with the fewest errors in the held-out samples of the folds.

    The first trial is the reference setting; the others are drawn by TPE.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)  # its warnings are tracebacks
    pairs = [(samples.take(~held_out), samples.take(held_out)) for held_out in folds]
    low, high = SEARCHED_C[recipe.name]

    def error_of(trial: optuna.Trial) -> float:
        # The weights are drawn too, although the fits ignore them: the published draws of C are
        # those beside them.
        parameters = {
            "C": trial.suggest_float("C", low, high, log=True),
            "class_weight": trial.suggest_categorical("class_weight", ["balanced", None]),
        }
        n_wrong = 0
        for fitted, tested in pairs:
            classifier = recipe.fit(fitted, parameters, seed)
            called = classifier.probability(tested.features) >= classifier.threshold
            n_wrong += int((called != tested.positive).sum())
        return n_wrong / sum(len(tested.positive) for _, tested in pairs)

    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=seed))
    study.enqueue_trial(dict(recipe.reference))
    study.optimize(error_of, n_trials=n_trials)
    return recipe.fixed(study.best_params)


def _substitute_folds(
    main: SamplePool, tests: Mapping[str, SamplePool], seed: int, thorough: bool
) -> dict[str, list[npt.NDArray[np.bool_]]]:
    """Return folds of the main recordings that replace missing test corpora."""
    folds = {}
    if FRESH not in tests:
        folds[OTHER_RECORDINGS] = inner_folds(main.samples, N_FOLDS, seed)
    names = sorted({name for name in main.objects if name is not None})
    if UNSEEN_OBJECTS not in tests and thorough and None not in main.objects and len(names) > 1:
        object_of_recording = np.array([names.index(str(name)) for name in main.objects])
        by_object = main.samples._replace(groups=object_of_recording[main.samples.groups])
        # As many folds as objects, so each object is left out by itself.
        folds[UNSEEN_OBJECTS] = inner_folds(by_object, len(names), seed)
    return folds
