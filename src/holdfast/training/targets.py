"""Targets of the heads beside stability: what each is fitted to, sample by sample.

The target of a head turns a finger of a recording into values at some of its samples: whether it
slides, how fast, why it is unstable.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from holdfast.contact import CAUSES, Cause, ContactState
from holdfast.detection import HeadName
from holdfast.metrics.slip_truth import DISTANCES, SLIDING, STILL, SlipTruth, has_slip_truth
from holdfast.metrics.truth_labels import LabelRule, labels_by_truth
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Flags, Integers
from holdfast.training.finger_samples import finite_rows, outside_units

EARLY_DURATION = 0.1
"""Time after the onset of a slip whose samples train the head `slip`: later it is found [s]."""
QUIET_STEP = 10
"""Only every tenth sample of quiet hold trains `slip`, beside all that are disturbed: the head must
tell a slip from a push."""
STILL_STEP = 10
"""Every tenth sample that holds still trains `slip_speed`, with the speed 0."""
MILLIMETRES = 1e3
"""Millimetres in a metre."""
ALIKE = {Cause.RELEASED: Cause.LOST}
"""Causes that look alike to a finger: it loses contact."""


@dataclass(frozen=True)
class TargetSamples:
    """Samples of one finger that train a head.

    Attributes:
        features: (n, n_features) finite.
        values: (n,) of the target: True where it slides, its speed [mm/s], or the code of a cause.
        units: (n,) unit of each sample, with which it is held out; -1 if it is held out with
            every unit.
        recordings: (n,) index of the recording of each sample.
        n_usable: number of samples from which these were taken.
    """

    features: Array
    values: npt.NDArray[np.generic]
    units: Integers
    recordings: Integers
    n_usable: int

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the samples of at least one part, in order."""
        return cls(
            np.concatenate([part.features for part in parts]),
            np.concatenate([part.values for part in parts]),
            np.concatenate([part.units for part in parts]),
            np.concatenate([part.recordings for part in parts]),
            sum(part.n_usable for part in parts),
        )

    def kept(self, left_out: Collection[int]) -> Flags:
        """Return (n,) whether a sample is in no unit that is left out."""
        return outside_units(self.units, left_out)

    @property
    def n_positive(self) -> int:
        """Number of samples whose value is not 0."""
        return int(np.count_nonzero(self.values))


class TargetInput(NamedTuple):
    """A finger of a recording, from which the targets of its heads are made.

    Attributes:
        recording: that has the finger.
        finger: its name.
        truth: of its slips.
        units: (n,) unit of each sample in the split.
        recording_index: in the dataset.
        step: every step-th sample is kept of what there is plenty of.
        is_any: whether the model is for any hand.
    """

    recording: Recording
    finger: str
    truth: SlipTruth
    units: Integers
    recording_index: int
    step: int
    is_any: bool

    @property
    def times(self) -> Array:
        """(n,) times of the samples [s]."""
        return self.recording.modules[self.finger].times

    def samples(
        self, features: Array, values: npt.NDArray[np.generic], rows: Integers, n_usable: int
    ) -> TargetSamples:
        """Return the samples in some rows."""
        recordings = np.full(len(rows), self.recording_index)
        return TargetSamples(features[rows], values[rows], self.units[rows], recordings, n_usable)


def slip_target(target: TargetInput, features: Array) -> TargetSamples:
    """Return what slides, and some of what holds still.

    A model of one hand learns the first 0.1 s of slips, and to tell them from pushes. On real
    recordings that misled a model of any hand, so it learns all that slides and all that does not.

    Args:
        target: the finger.
        features: (n, n_features) of the head.
    """
    truth, step = target.truth, target.step
    slides = truth.codes == SLIDING
    if not target.is_any:
        slides &= _in_spans(
            [(s.onset, s.onset + EARLY_DURATION) for s in truth.slips], target.times
        )
    is_still = truth.codes == STILL
    usable = finite_rows(features, slides | is_still)
    quiet = usable[(is_still & truth.quiet)[usable]][:: step * (1 if target.is_any else QUIET_STEP)]
    disturbed = usable[(is_still & ~truth.quiet)[usable]][::step]
    # Samples that slide are not thinned: they are rare.
    rows = np.sort(np.concatenate([usable[slides[usable]], quiet, disturbed]))
    return target.samples(features, slides, rows, len(usable))


def speed_target(target: TargetInput, features: Array) -> TargetSamples | None:
    """Return what slides, of slips over 1 mm, and some of what holds still, with its speed.

    Args:
        target: the finger.
        features: (n, n_features) of the head.

    Returns:
        The samples; None if the true speed is not known.
    """
    recording, finger, truth = target.recording, target.finger, target.truth
    if recording.truth is None or not has_slip_truth(recording.truth, finger):
        return None
    slides = in_long_slips(target.times, truth)
    used = slides.copy()
    used[np.flatnonzero(truth.codes == STILL)[::STILL_STEP]] = True
    rows = finite_rows(features, used)
    speed = np.where(slides, true_speed(recording, finger, target.times), 0.0)
    return target.samples(features, speed, rows, len(rows))


def cause_target(target: TargetInput, features: Array) -> TargetSamples | None:
    """Return the unstable samples whose cause is known, as codes.

    Causes come from the truth, where the recording has one, else from the labels. What
    slides is left out: the head `slip` decides about it.

    Args:
        target: the finger.
        features: (n, n_features) of the head.

    Returns:
        The samples; None if there are none.
    """
    recording, finger = target.recording, target.finger
    labels = labels_by_truth(recording, LabelRule(margin=0.0)).get(
        finger, recording.modules[finger].labels
    )
    codes = np.zeros(len(target.times), dtype=np.int64)
    for label in labels:
        if label.state is ContactState.UNSTABLE and label.cause not in (None, Cause.SLIP):
            first, last = np.searchsorted(target.times, (label.start, label.end))
            codes[first:last] = CAUSES.index(ALIKE.get(label.cause, label.cause)) + 1
    usable = finite_rows(features, (codes > 0) & (target.truth.codes != SLIDING))
    rows = usable[:: target.step]
    return target.samples(features, codes, rows, len(usable)) if len(rows) else None


TARGETS: dict[HeadName, Callable[[TargetInput, Array], TargetSamples | None]] = {
    "slip": slip_target,
    "slip_speed": speed_target,
    "cause": cause_target,
}
"""Target of each head beside `stable`, whose target are the labels."""


def true_speed(recording: Recording, finger: str, times: Array) -> Array:
    """Return (n,) the true speed of a finger over its object at some times [mm/s].

    Args:
        recording: with a truth that has the speed of the finger.
        finger: name of the finger.
        times: (n,) [s].
    """
    if recording.truth is None:
        raise ValueError(f"recording {recording.name!r} has no truth; one with a speed expected")
    # The truth has its own clock: the latest of its samples that is not after the time.
    truth = recording.truth
    index = np.clip(np.searchsorted(truth.times, times, side="right") - 1, 0, None)
    return np.asarray(MILLIMETRES * truth.fingers[finger]["slip_speed"][index])


def in_long_slips(times: Array, truth: SlipTruth) -> Flags:
    """Return (n,) where a finger slides, in a slip over 1 mm."""
    spans = [(slip.onset, slip.end) for slip in truth.slips if slip.distance >= DISTANCES[0]]
    return np.asarray(_in_spans(spans, times) & (truth.codes == SLIDING))


def _in_spans(spans: Sequence[tuple[float, float]], times: Array) -> Flags:
    """Return (n,) where a time is in one of the spans."""
    inside = np.zeros(len(times), dtype=np.bool_)
    for span in spans:
        first, last = np.searchsorted(times, span)
        inside[first:last] = True
    return inside
