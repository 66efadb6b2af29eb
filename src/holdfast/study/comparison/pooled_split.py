"""A random split of pooled samples, as the paper's: neighbours of what is judged have trained."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from holdfast.contact import STABLE, UNKNOWN
from holdfast.metrics import Decisions
from holdfast.study.evaluation.error_breakdown import evaluated_units
from holdfast.study.evaluation.evaluate_method import EvaluationJob, find_method
from holdfast.study.evaluation.fitted_method import FittedMethod, gather_training_samples
from holdfast.study.evaluation.recording_features import RecordingFeatures, corpus_features
from holdfast.study.paper.random_split import ConfusionCounts

FOLDS = 5
"""80 % train, 20 % test, by turns."""

Mask = npt.NDArray[np.bool_]


def judge_pooled(job: EvaluationJob) -> ConfusionCounts:
    """[TN, FP, FN, TP] of each recording, out of fold in random folds of all samples.

    All else is as in the honest splits, so that the difference is the split's: the contact
    threshold, the number of samples that a classifier is fitted to.

    Args:
        job: whose method, training corpus, change, effort and seed count.
    """
    method = find_method(job.method)
    recordings = corpus_features(method, job.train, job.change, job.effort.stride)
    generator = np.random.default_rng(job.seed)
    dealt = [
        {unit: generator.integers(FOLDS, size=len(rows)) for unit, rows in seen.features.items()}
        for seen in recordings
    ]
    total = np.zeros((len(recordings), 4), dtype=np.int64)
    for fold in range(FOLDS):
        held = [{unit: each == fold for unit, each in own.items()} for own in dealt]
        kept = [{unit: each != fold for unit, each in own.items()} for own in dealt]
        training = [_only(*each) for each in zip(recordings, kept, strict=True)]
        material = gather_training_samples(training, job.effort.max_rows)
        fitted = FittedMethod.fit(method, material, range(len(recordings)), job.seed)
        for place, each in enumerate(zip(recordings, held, strict=True)):
            tested = _only(*each)
            total[place] += _counts(fitted.scores(tested).decide(tested, tested.labels))
    return [[int(n) for n in row] for row in total]


def _only(seen: RecordingFeatures, chosen: Mapping[str, Mask]) -> RecordingFeatures:
    """The recording with features of the chosen samples alone."""
    features = {
        unit: np.where(chosen[unit][:, None], rows, np.nan) for unit, rows in seen.features.items()
    }
    return replace(seen, features=features)


def _counts(decided: Decisions) -> npt.NDArray[np.int64]:
    """(4,) TN, FP, FN, TP of the samples that are decided."""
    counts = np.zeros(4, dtype=np.int64)
    for finger in evaluated_units(decided).values():
        known = (finger.labels != UNKNOWN) & (finger.states != UNKNOWN)
        place = 2 * (finger.labels == STABLE) + (finger.states == STABLE)
        counts += np.bincount(place[known], minlength=4)
    return counts
