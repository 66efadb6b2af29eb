"""Scores of the slip of each finger by a method, sample by sample, beside the truth.

The score of a sample is the log odds of slip, smoothed and started again at each contact as by
the slip rule of a model. Only its order counts: it is turned into its rank among samples that
are known to be still, so that the same thresholds serve every method.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics.decisions import Codes
from holdfast.metrics.masks import Mask, runs
from holdfast.metrics.slip_thresholds import SLIP_THRESHOLD_LOG_ODDS, slip_curve
from holdfast.metrics.slip_truth import (
    NOT_HELD,
    SLIDING,
    STILL,
    SlipDecisions,
    SlipTruth,
    slip_truth,
)
from holdfast.metrics.slips import SlipCurve
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Integers
from holdfast.training.finger_samples import thinning_step, usable_rows
from holdfast.training.head_fits import SLIP_HOLD_TIME, SLIP_SMOOTHING
from holdfast_lab.study.evaluation.fitted_method import (
    ChosenRows,
    FittedMethod,
    TrainingSamples,
    gather_rows,
)
from holdfast_lab.study.evaluation.recording_features import (
    RecordingFeatures,
    prepared_recordings,
    recording_features,
)
from holdfast_lab.study.evaluation.scores import RecordingScores, probability_of
from holdfast_lab.study.methods import HAND, Method
from holdfast_lab.study.plan import Corpus


@dataclass(frozen=True, eq=False)
class SlipRecording:
    """Features of one recording, and the truth of the slips of its fingers.

    Attributes:
        features: of the recording.
        truth: of each finger whose slips are known. Samples at which not all compared methods
            can have an estimate count as not held, and slips that begin there are left out.
    """

    features: RecordingFeatures
    truth: Mapping[str, SlipTruth]

    def codes(self, unit: str) -> Codes:
        """Return the codes of a unit; the hand slides if one of its fingers slides."""
        if unit != HAND:
            return self.truth[unit].codes
        times = next(iter(self.features.times.values()))
        return np.asarray(np.max([self._codes_at(finger, times) for finger in self.truth], axis=0))

    def _codes_at(self, finger: str, times: Array) -> Codes:
        """Return the latest code of a finger at each time."""
        place = _latest(self.features.times[finger], times)
        return np.where(place >= 0, self.truth[finger].codes[place], NOT_HELD).astype(np.int8)


def slip_recordings(method: Method, corpus: Corpus, warm_up: float = 0.0) -> list[SlipRecording]:
    """Return the recordings of a corpus in which the slips of a finger are known.

    Args:
        method: computes the features.
        corpus: the recordings.
        warm_up: time at the start of every unbroken stretch that is not scored [s].
    """
    made = []
    for prepared in prepared_recordings(corpus):
        features = recording_features(method, prepared, warm_up=warm_up)
        if truth := _truth(prepared.recording, features):
            made.append(SlipRecording(features, truth))
    return made


def _truth(recording: Recording, features: RecordingFeatures) -> dict[str, SlipTruth]:
    truth = {}
    for finger, times in features.times.items():
        quiet = features.exact_labels[finger] == STABLE
        known = slip_truth(recording, finger, times, quiet)
        if known is not None:
            truth[finger] = _restricted(known, times, features.compared[finger])
    return truth


def _restricted(truth: SlipTruth, times: Array, compared: Mask) -> SlipTruth:
    """Return the truth at some samples only."""
    onsets = [_latest(times, np.array([slip.onset + 1e-6]))[0] for slip in truth.slips]
    return replace(
        truth,
        codes=np.where(compared, truth.codes, NOT_HELD).astype(np.int8),
        quiet=truth.quiet & compared,
        slips=tuple(
            slip
            for slip, place in zip(truth.slips, onsets, strict=True)
            if place >= 0 and compared[place]
        ),
    )


def _latest(times: Array, at: Array) -> Integers:
    """Return the place of the last of `times` that is not later; -1 before the first."""
    return np.asarray(np.searchsorted(times, at, side="right") - 1)


def gather_sliding_samples(
    recordings: Sequence[SlipRecording], max_samples: int
) -> TrainingSamples:
    """Return the training samples of slip: class 1 is still, class 0 slides.

    All samples that slide are kept; those that are still are thinned evenly.

    Args:
        recordings: of one corpus.
        max_samples: of each unit, that are still.
    """
    most = -(-max_samples // max(len(recordings), 1))

    def choose(place: int, unit: str) -> ChosenRows | None:
        recording = recordings[place]
        if unit != HAND and unit not in recording.truth:
            return None
        labels = _training_labels(recording.codes(unit))
        usable = usable_rows(recording.features.features[unit], labels)
        still = usable[labels[usable] == STABLE]
        still = still[:: thinning_step(len(still), most)]
        kept = np.concatenate([usable[labels[usable] == UNSTABLE], still])
        return ChosenRows(labels, np.sort(kept))

    return gather_rows([recording.features for recording in recordings], choose)


def _training_labels(codes: Codes) -> Codes:
    labels = np.full(len(codes), UNKNOWN, dtype=np.int8)
    labels[codes == STILL], labels[codes == SLIDING] = STABLE, UNSTABLE
    return labels


@dataclass(frozen=True, eq=False)
class SlipScores:
    """Scores of the slip of one finger in one recording.

    Attributes:
        times: (n,) [s].
        score: (n,) smoothed log odds of slip; NaN without an estimate, minus infinity without
            contact.
        truth: of the same samples.
    """

    times: Array
    score: Array
    truth: SlipTruth

    @property
    def still(self) -> Array:
        """Scores of the samples that are known to be still, in contact."""
        return np.asarray(self.score[np.isfinite(self.score) & (self.truth.codes == STILL)])

    def curve(self, ranks: Array) -> SlipCurve:
        """Return the counts of slips at each threshold.

        Args:
            ranks: sorted scores of samples that are still, see `log_odds_of`.
        """
        probability = np.where(
            self.score == -np.inf, 0.0, probability_of(log_odds_of(self.score, ranks))
        )
        raised = np.zeros(len(self.times), dtype=np.bool_)
        return slip_curve(
            SlipDecisions(self.times, probability, raised, SLIP_HOLD_TIME, self.truth)
        )


def score_slips(fitted: FittedMethod, recording: SlipRecording) -> dict[str, SlipScores]:
    """Return the scores of the fingers of a recording; every finger has those of its hand.

    Args:
        fitted: to other recordings.
        recording: to be scored.
    """
    scores = fitted.scores(recording.features)
    made = {}
    for finger, truth in recording.truth.items():
        times = recording.features.times[finger]
        margins = _margins(scores, recording.features, finger)
        score = smoothed(times, -np.where(scores.in_contact[finger], margins, np.nan))
        without = ~scores.in_contact[finger] & ~np.isnan(margins)
        made[finger] = SlipScores(times, np.where(without, -np.inf, score), truth)
    return made


def _margins(scores: RecordingScores, features: RecordingFeatures, finger: str) -> Array:
    """Return the margins of a finger, or those of its hand; NaN without a classifier."""
    times = features.times[finger]
    if HAND not in scores.margins:
        return scores.margins.get(finger, np.full(len(times), np.nan))
    place = _latest(next(iter(features.times.values())), times)
    return np.where(place >= 0, scores.margins[HAND][place], np.nan)


def smoothed(times: Array, log_odds: Array) -> Array:
    """Return the log odds as the slip rule of a model smooths them; NaN starts anew.

    Example:
        >>> smoothed(np.arange(3) / 100, np.array([np.nan, 1.0, 1.0])).tolist()
        [nan, 1.0, 1.0]
    """
    gain = _gain(times)
    out = np.full(len(log_odds), np.nan)
    for start, end in runs(~np.isnan(log_odds)):
        values = log_odds[start:end]
        before = [(1.0 - gain) * values[0]]
        out[start:end], _ = lfilter([gain], [1.0, gain - 1.0], values, zi=before)
    return out


def _gain(times: Array) -> float:
    if len(times) < 2:
        return 1.0
    rate = 1.0 / float(np.median(np.diff(times)))
    return float(-np.expm1(-1.0 / (rate * SLIP_SMOOTHING)))


def log_odds_of(score: Array, ranks: Array) -> Array:
    """Return the log odds by which the thresholds of slip see a score.

    With t the share of the m still samples that have at least this score,

        z = z_0 + (z_1 - z_0) log(1 / t) / log(m + 1)

    where z_0 and z_1 are the log odds of the lowest and the highest threshold: each step of the
    threshold leaves out the same share of the still samples that are left.

    Args:
        score: (n,); NaN stays NaN.
        ranks: (m,) sorted scores of the still samples.
    """
    lowest, highest = SLIP_THRESHOLD_LOG_ODDS[0], SLIP_THRESHOLD_LOG_ODDS[-1]
    m = len(ranks)
    above = m - np.searchsorted(ranks, score, side="left")
    depth = -np.log((above + 0.5) / (m + 1)) / np.log(m + 1)
    return np.asarray(np.where(np.isnan(score), np.nan, lowest + (highest - lowest) * depth))


def still_ranks(scores: Iterable[Mapping[str, SlipScores]]) -> Array:
    """Return the sorted scores of all still samples of some recordings."""
    return np.sort(np.concatenate([np.empty(0), *_still_parts(scores)]))


def _still_parts(scores: Iterable[Mapping[str, SlipScores]]) -> Iterator[Array]:
    for fingers in scores:
        for finger in fingers.values():
            yield finger.still
