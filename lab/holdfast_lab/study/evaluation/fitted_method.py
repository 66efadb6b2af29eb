"""A method fitted to some recordings of a corpus, which scores other recordings."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Classifier, Samples
from holdfast.metrics.decisions import Codes
from holdfast.sensors.types import Array
from holdfast.training.finger_samples import (
    concatenate,
    contact_threshold,
    labelled_samples,
    thinning_step,
    usable_rows,
)
from holdfast_lab.study.evaluation.recording_features import RecordingFeatures
from holdfast_lab.study.evaluation.scores import RecordingScores
from holdfast_lab.study.methods import Method

MAX_FITTED_SAMPLES = 20_000
"""Maximum samples of a unit that train a classifier. All samples are evaluated."""

MIN_PROBABILITY = 1e-12
"""Minimum distance of a probability from 0 and 1, so that log odds are finite."""


@dataclass(frozen=True, eq=False)
class TrainingSamples:
    """The samples of a corpus that a method can be fitted to.

    Attributes:
        samples: of each unit. A group is the number of a recording in the corpus.
        at_rest: (n_recordings, 3) moments of F_a of each finger in the tare intervals.
        objects: of each recording; None if the recording does not name it.
    """

    samples: Mapping[str, Samples]
    at_rest: Mapping[str, Array]
    objects: tuple[str | None, ...]


def gather_training_samples(
    recordings: Sequence[RecordingFeatures], max_samples: int = MAX_FITTED_SAMPLES
) -> TrainingSamples:
    """Return the labelled samples of recordings, thinned evenly over the recordings.

    A recording without one of the fingers gives no samples to a whole-hand method.

    Args:
        recordings: features of the corpus.
        max_samples: of each unit.
    """
    most = -(-max_samples // max(len(recordings), 1))

    def choose(place: int, unit: str) -> ChosenRows:
        recording = recordings[place]
        labels = recording.unit_labels(unit)
        rows = usable_rows(recording.features[unit], labels)
        return ChosenRows(labels, rows[:: thinning_step(len(rows), most)])

    return gather_rows(recordings, choose)


class ChosenRows(NamedTuple):
    """Labels of a unit in one recording, and the places of the samples that train it."""

    labels: Codes
    rows: npt.NDArray[np.int64]


def gather_rows(
    recordings: Sequence[RecordingFeatures], choose: Callable[[int, str], ChosenRows | None]
) -> TrainingSamples:
    """Return chosen samples of recordings.

    A recording without one of the fingers gives no samples to a whole-hand method.

    Args:
        recordings: features of the corpus.
        choose: function from the place of a recording and the name of a unit to the samples
            that train it; None for none.
    """
    n_features = _n_features(recordings)
    parts: dict[str, list[Samples]] = {}
    fingers = dict.fromkeys(finger for recording in recordings for finger in recording.at_rest)
    at_rest = {finger: np.zeros((len(recordings), 3)) for finger in fingers}
    for place, recording in enumerate(recordings):
        for unit, features in recording.features.items():
            chosen = choose(place, unit) if features.shape[1] == n_features[unit] else None
            if chosen is not None:
                samples = labelled_samples(features, chosen.labels, chosen.rows, place)
                parts.setdefault(unit, []).append(samples)
        for finger, moments in recording.at_rest.items():
            at_rest[finger][place] = moments
    gathered = {unit: concatenate(each) for unit, each in parts.items()}
    return TrainingSamples(gathered, at_rest, tuple(each.object for each in recordings))


def _n_features(recordings: Sequence[RecordingFeatures]) -> dict[str, int]:
    """Return the number of features of each unit: the largest of all recordings."""
    widths: dict[str, int] = {}
    for recording in recordings:
        for unit, features in recording.features.items():
            widths[unit] = max(widths.get(unit, 0), features.shape[1])
    return widths


@dataclass(frozen=True, eq=False)
class FittedMethod:
    """A method fitted to some recordings.

    Attributes:
        classifiers: of each unit whose training samples had both classes.
        contact_thresholds: F_a of each finger below which there is no contact; None if unknown.
    """

    classifiers: Mapping[str, Classifier]
    contact_thresholds: Mapping[str, float | None]

    @classmethod
    def fit(
        cls, method: Method, training: TrainingSamples, recordings: Collection[int], seed: int
    ) -> "FittedMethod":
        """Fit a method to some of the recordings of the training samples, given by number."""
        places = sorted(recordings)
        classifiers = {}
        for unit, samples in training.samples.items():
            own = samples.take(np.isin(samples.groups, places))
            if not own.one_class:
                classifiers[unit] = method.recipe.fit(own, method.reference, seed)
        contact = {f: contact_threshold(rows[places]) for f, rows in training.at_rest.items()}
        return cls(classifiers, contact)

    def scores(self, recording: RecordingFeatures) -> RecordingScores:
        """Return the scores of a recording; NaN for a unit without a matching classifier."""
        scored = {u: rows for u, rows in recording.features.items() if self._can_score(u, rows)}
        thresholds = {u: float(_log_odds(self.classifiers[u].threshold)) for u in scored}
        margins = {
            unit: _log_odds(self.classifiers[unit].probability(rows)) - thresholds[unit]
            for unit, rows in scored.items()
        }
        for unit, rows in recording.features.items():
            margins.setdefault(unit, np.full(len(rows), np.nan))
            thresholds.setdefault(unit, 0.0)
        with np.errstate(invalid="ignore"):
            in_contact = {
                name: ~(amplitude < (self.contact_thresholds.get(name) or 0.0))
                for name, amplitude in recording.amplitude.items()
            }
        return RecordingScores(margins, thresholds, in_contact)

    def _can_score(self, unit: str, rows: Array) -> bool:
        classifier = self.classifiers.get(unit)
        return classifier is not None and classifier.n_features == rows.shape[1]


def _log_odds(probability: npt.ArrayLike) -> Any:  # noqa: ANN401 (an array or a number, as given)
    p = np.clip(probability, MIN_PROBABILITY, 1 - MIN_PROBABILITY)
    return np.log(p / (1 - p))
