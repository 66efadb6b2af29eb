"""A method fitted to some recordings of a corpus, asked for its scores of others."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Classifier, Samples
from holdfast.sensors.types import Array
from holdfast.study.evaluation.recording_features import RecordingFeatures
from holdfast.study.evaluation.scores import RecordingScores
from holdfast.study.methods import Method
from holdfast.training.design import (
    concatenate,
    contact_threshold,
    labelled_samples,
    thinning_step,
    usable_rows,
)

MAX_ROWS = 20_000
"""Samples of a finger that a classifier is fitted to, evenly spread; judged is every sample."""

SURE = 1e-12
"""Probabilities are kept so far from 0 and 1."""


@dataclass(frozen=True, eq=False)
class TrainingSamples:
    """What a method can be fitted to.

    Attributes:
        samples: of each unit; groups are places of recordings in the corpus.
        at_rest: of each finger, (n_recordings, 3) moments of F_a in the tare stretches.
        objects: of each recording; None where it does not say.
    """

    samples: Mapping[str, Samples]
    at_rest: Mapping[str, Array]
    objects: tuple[str | None, ...]


def gather_training_samples(
    recordings: Sequence[RecordingFeatures], max_rows: int = MAX_ROWS
) -> TrainingSamples:
    """What can be learned from those recordings: a bounded number of their samples.

    A hand that lacks a finger gives a method for whole hands nothing to learn.

    Args:
        recordings: to learn from.
        max_rows: samples of a unit.
    """
    widths = _widths(recordings)
    piles: dict[str, list[Samples]] = {unit: [] for unit in widths}
    fingers = dict.fromkeys(finger for seen in recordings for finger in seen.at_rest)
    at_rest = {finger: np.zeros((len(recordings), 3)) for finger in fingers}
    n_rows = -(-max_rows // max(len(recordings), 1))
    for place, seen in enumerate(recordings):
        for unit, features in seen.features.items():
            if features.shape[1] == widths[unit]:
                states = seen.unit_labels(unit)
                rows = usable_rows(features, states)
                rows = rows[:: thinning_step(len(rows), n_rows)]
                piles[unit].append(labelled_samples(features, states, rows, place))
        for finger, moments in seen.at_rest.items():
            at_rest[finger][place] = moments
    samples = {unit: concatenate(pile) for unit, pile in piles.items()}
    return TrainingSamples(samples, at_rest, tuple(seen.object for seen in recordings))


def _widths(recordings: Sequence[RecordingFeatures]) -> dict[str, int]:
    """How many features each unit has: the most that a recording gives."""
    widths: dict[str, int] = {}
    for seen in recordings:
        for unit, features in seen.features.items():
            widths[unit] = max(widths.get(unit, 0), features.shape[1])
    return widths


@dataclass(frozen=True, eq=False)
class FittedMethod:
    """A method fitted to some recordings.

    Attributes:
        classifiers: of each unit that had both classes.
        contact: of each finger, F_a below which there is no contact; None for none.
    """

    classifiers: Mapping[str, Classifier]
    contact: Mapping[str, float | None]

    @classmethod
    def fit(
        cls, method: Method, material: TrainingSamples, recordings: Collection[int], seed: int
    ) -> "FittedMethod":
        """The fitted that those recordings make."""
        places = sorted(recordings)
        classifiers = {}
        for unit, samples in material.samples.items():
            own = samples.take(np.isin(samples.groups, places))
            if not own.one_class:
                classifiers[unit] = method.recipe.fit(own, method.reference, seed)
        contact = {f: contact_threshold(rows[places]) for f, rows in material.at_rest.items()}
        return cls(classifiers, contact)

    def scores(self, seen: RecordingFeatures) -> RecordingScores:
        """What it thinks of a recording; nothing of a unit that it has no classifier for."""
        known = {unit: rows for unit, rows in seen.features.items() if self._fits(unit, rows)}
        own = {unit: float(_log_odds(self.classifiers[unit].threshold)) for unit in known}
        margins = {
            unit: _log_odds(self.classifiers[unit].probability(rows)) - own[unit]
            for unit, rows in known.items()
        }
        for unit, rows in seen.features.items():
            margins.setdefault(unit, np.full(len(rows), np.nan))
            own.setdefault(unit, 0.0)
        with np.errstate(invalid="ignore"):
            touching = {
                name: ~(amplitude < (self.contact.get(name) or 0.0))
                for name, amplitude in seen.amplitude.items()
            }
        return RecordingScores(margins, own, touching)

    def _fits(self, unit: str, rows: Array) -> bool:
        classifier = self.classifiers.get(unit)
        return classifier is not None and classifier.n_features == rows.shape[1]


def _log_odds(probability: npt.ArrayLike) -> Any:  # noqa: ANN401 (an array or a number, as given)
    p = np.clip(probability, SURE, 1 - SURE)
    return np.log(p / (1 - p))
