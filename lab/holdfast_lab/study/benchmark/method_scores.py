"""Submissions of the methods of the study: fitted to a folder of recordings, scored on splits."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from holdfast.errors import TrainingError
from holdfast.io import load_dataset
from holdfast.sensors.types import Array
from holdfast.training.finger_samples import contact_threshold
from holdfast_lab.study.benchmark.submission import COLUMN_TYPES, FingerScores
from holdfast_lab.study.evaluation.evaluate_slips import score_slips
from holdfast_lab.study.evaluation.fitted_method import FittedMethod, MethodTraining, probability_of
from holdfast_lab.study.evaluation.recording_features import RecordingFeatures, corpus_features
from holdfast_lab.study.methods import Method
from holdfast_lab.study.plan import Corpus

SCHEMA = pa.schema(list(COLUMN_TYPES.items()))


class BothTargets(NamedTuple):
    """A method fitted twice: to the labels of stability, and to true sliding.

    Attributes:
        stable: fitted to the labels of stability.
        slip: fitted to true sliding.
        own_rest: take the contact threshold of each finger from the tare interval of the
            recording, not from training: for hands whose units and noise differ.
    """

    stable: FittedMethod
    slip: FittedMethod
    own_rest: bool = False

    @classmethod
    def fit(
        cls,
        method: Method,
        recordings: Sequence[RecordingFeatures],
        seed: int = 0,
        *,
        own_rest: bool = False,
    ) -> Self:
        """Fit a method to recordings, as the study does.

        Args:
            method: to fit.
            recordings: to fit it to.
            seed: of the fit.
            own_rest: see the class.

        Raises:
            TrainingError: no finger has samples of both classes.
        """
        stable = MethodTraining.of(method, recordings, seed=seed).fit()
        slip = MethodTraining.of(method, recordings, seed=seed, sliding=True).fit()
        if not (stable.classifiers and slip.classifiers):
            raise TrainingError(f"{method.name}: no finger with samples of both classes given")
        return cls(stable, slip, own_rest)

    def scores(self, recording: RecordingFeatures) -> dict[str, FingerScores]:
        """Return the scores of each finger of a recording, 0 where there is no estimate.

        A score of 0.5 is the method's own threshold. A finger that did not slide in training has
        no estimate of slip.

        Raises:
            ValueError: a finger has no estimate at all: the method does not fit the sensor.
        """
        stable = self._for(self.stable, recording).scores(recording).fingers
        slips = score_slips(self._for(self.slip, recording).scores(recording))
        scored = {}
        for finger in recording.slips:
            own = stable[finger]
            if not own.known.any():
                raise ValueError(f"no estimate of {finger} in {recording.name}")
            margins = np.where(own.known, own.margin, np.nan)
            margins = np.where(own.grasped, margins, -np.inf)
            scored[finger] = FingerScores(_known(margins), _known(slips[finger].score))
        return scored

    def _for(self, fitted: FittedMethod, recording: RecordingFeatures) -> FittedMethod:
        """Return a fitted method with the contact thresholds that apply to a recording."""
        if not self.own_rest:
            return fitted
        at_rest = recording.at_rest
        thresholds = {
            finger: contact_threshold(np.array([moments])) for finger, moments in at_rest.items()
        }
        return replace(fitted, contact_thresholds=thresholds)


def load_features(method: Method, folder: Path) -> list[RecordingFeatures]:
    """Return the features and the truth of all recordings of a folder.

    Args:
        method: computes the features.
        folder: of recordings of the twin.
    """
    dataset = load_dataset(folder)
    fingers = dict.fromkeys(name for recording in dataset for name in recording.modules)
    corpus = Corpus(folder.name, str(folder), dataset.names, "", tuple(fingers), dataset[0].rate)
    return [recording for recording in corpus_features(method, corpus) if recording.slips]


def write_submission(
    path: Path, fitted: BothTargets, splits: Mapping[str, Iterable[RecordingFeatures]]
) -> None:
    """Write the scores of a fitted method for some splits, as Parquet.

    Raises:
        ValueError: the method does not fit the sensor of a recording; nothing is written.
    """
    tables = [
        table
        for split, recordings in splits.items()
        for recording in recordings
        for table in _tables(f"{split}/{recording.name}", fitted.scores(recording))
    ]
    pq.write_table(pa.concat_tables(tables), path, compression="zstd")


def _tables(name: str, fingers: Mapping[str, FingerScores]) -> Iterator[pa.Table]:
    for finger, scores in fingers.items():
        n = len(scores.stable)
        columns = [[name] * n, [finger] * n, np.arange(n), scores.stable, scores.slip]
        yield pa.table(columns, schema=SCHEMA)


def _known(log_odds: Array) -> Array:
    """Return probabilities; 0 where the log odds are not known."""
    return np.nan_to_num(probability_of(log_odds), nan=0.0)
