"""Samples of one finger that train the heads of a slip: what slides, and what holds still."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics.slip_truth import SLIDING, STILL, SlipTruth
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Flags, Integers
from holdfast.training.finger_samples import (
    FingerSamples,
    join_samples,
    labelled_samples,
    usable_rows,
)
from holdfast.training.slip_speed import SpeedSamples, speed_samples

EARLY_DURATION = 0.1
"""Time after the onset of a slip whose samples train the rule: later it is found already [s]."""
QUIET_STEP = 10
"""Only every tenth sample of quiet hold trains, beside all that are disturbed: the rule must tell
a slip from a push."""


@dataclass(frozen=True)
class SlipSamples:
    """Training samples of the heads of a slip.

    Attributes:
        own: of the finger; class 1 slides. All that slide are kept, and some that hold still.
        speeds: samples of the speed; None if no speed is known.
    """

    own: FingerSamples
    speeds: SpeedSamples | None = None

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the samples of at least one part, in order."""
        speeds = [part.speeds for part in parts if part.speeds is not None]
        own = join_samples([part.own for part in parts], np.zeros((1, 3)))
        return cls(own, SpeedSamples.joined(speeds) if speeds else None)

    @property
    def n_sliding(self) -> int:
        """Number of samples that slide."""
        return int(self.own.samples.stable.sum())

    @property
    def n_still(self) -> int:
        """Number of samples that hold still, before thinning."""
        return self.own.n_usable - self.n_sliding


def slip_samples(
    recording: Recording,
    finger: str,
    features: Array,
    truth: SlipTruth,
    units: Integers,
    group_and_index: tuple[int, int],
    *,
    step: int,
    is_any: bool,
) -> SlipSamples:
    """Return the samples of one finger of a recording; class 1 slides.

    A model of one hand learns the first 0.1 s of slips, and to tell them from pushes. On real
    recordings that misled a model of any hand, so it learns all that slides and all that does not.

    Args:
        recording: that has the finger.
        finger: its name.
        features: (n, n_features) of the heads of a slip.
        truth: of its slips.
        units: (n,) of the split.
        group_and_index: group of the recording in the split, and its index.
        step: every step-th sample that holds still is kept.
        is_any: whether the model is for any hand.
    """
    module, (group, index) = recording.modules[finger], group_and_index
    states = np.full(module.n_samples, UNKNOWN, dtype=np.int8)
    slides = truth.codes == SLIDING if is_any else _is_early(truth, module.times)
    states[slides], states[truth.codes == STILL] = STABLE, UNSTABLE
    usable = usable_rows(features, states)
    is_still, is_quiet = states[usable] == UNSTABLE, truth.quiet[usable]
    quiet = usable[is_still & is_quiet][:: step * (1 if is_any else QUIET_STEP)]
    disturbed = usable[is_still & ~is_quiet][::step]
    kept = np.sort(np.concatenate([usable[~is_still], quiet, disturbed]))
    own = FingerSamples(
        None if is_any else module.sensor,
        labelled_samples(features, states, kept, group),
        units[kept],
        np.full(len(kept), index),
        module.times[kept] - recording.start,
        np.zeros((1, 3)),
        len(usable),
    )
    return SlipSamples(own, speed_samples(recording, finger, features, truth, units))


def _is_early(truth: SlipTruth, times: Array) -> Flags:
    """Return where a slip has begun less than `EARLY_DURATION` ago, and slides."""
    early = np.zeros(len(times), dtype=bool)
    for slip in truth.slips:
        first, last = np.searchsorted(times, (slip.onset, slip.onset + EARLY_DURATION))
        early[first:last] = True
    return np.asarray(early & (truth.codes == SLIDING))
