"""Samples of one finger that train the head of causes, and its fit."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from holdfast.classifiers.causes import fit_causes
from holdfast.contact import CAUSES, Cause, ContactState
from holdfast.features import FeatureSpec
from holdfast.metrics.slip_truth import SLIDING, SlipTruth
from holdfast.metrics.truth_labels import LabelRule, labels_by_truth
from holdfast.model import ANY_FINGER, Head, Model
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Integers

MIN_CAUSE_SAMPLES = 50
"""A cause with fewer samples is left out."""
CAUSE_PENALTY = 1e-3
"""C of the fit: the weight of a sample against the penalty on the weights."""
ALIKE = {Cause.RELEASED: Cause.LOST}
"""Causes that look alike to a finger: it loses contact."""


@dataclass(frozen=True)
class CauseSamples:
    """Unstable samples whose cause is known, and is no slip.

    Attributes:
        features: (n, n_features) finite.
        codes: (n,) of the causes.
        units: (n,) unit of each sample, with which it is held out.
    """

    features: Array
    codes: Integers
    units: Integers

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the samples of at least one part, in order."""
        columns = zip(*((part.features, part.codes, part.units) for part in parts), strict=True)
        return cls(*map(np.concatenate, columns))

    def fit(self, held: Collection[int], features: tuple[FeatureSpec, ...]) -> list[Head]:
        """Fit the head to the samples that are not in held units.

        Args:
            held: units whose samples are left out.
            features: of the samples.

        Returns:
            The head; none with fewer than two causes of at least `MIN_CAUSE_SAMPLES`.
        """
        kept = ~np.isin(self.units, [-1, *held] if held else [])
        counts = np.bincount(self.codes[kept], minlength=len(CAUSES) + 1)
        kept &= counts[self.codes] >= MIN_CAUSE_SAMPLES
        if np.count_nonzero(counts >= MIN_CAUSE_SAMPLES) < 2:
            return []
        names = np.array([str(cause) for cause in CAUSES])[self.codes[kept] - 1]
        rule, classes = fit_causes(self.features[kept], names, CAUSE_PENALTY)
        return [Head(name="cause", link="softmax", features=features, rule=rule, classes=classes)]


def missing_causes(model: Model, samples: Mapping[str, CauseSamples]) -> Iterator[str]:
    """Yield a warning for each finger whose causes are known, but too few to tell them apart."""
    for finger, own in samples.items():
        if model.finger(finger).head("cause") is None:
            counts = np.bincount(own.codes, minlength=len(CAUSES) + 1)[1:]
            given = [f"{n} of {cause}" for cause, n in zip(CAUSES, counts, strict=True) if n]
            yield (
                f"{'all fingers' if finger == ANY_FINGER else finger}: unstable samples "
                f"{', '.join(given)} given, at least {MIN_CAUSE_SAMPLES} of each of two causes "
                "expected; the model names no cause there"
            )


def cause_samples(
    recording: Recording,
    finger: str,
    features: Array,
    units: Integers,
    truth: SlipTruth,
    step: int,
) -> CauseSamples | None:
    """Return the unstable samples of one finger of a recording whose cause is known.

    Causes are those of the truth, where the recording has one, else those of the labels. What
    slides is left out: the head of slips decides about it.

    Args:
        recording: that has the finger.
        finger: its name.
        features: (n, n_features).
        units: (n,) of the split.
        truth: of its slips.
        step: every step-th sample is kept.
    """
    module = recording.modules[finger]
    labels = labels_by_truth(recording, LabelRule(margin=0.0)).get(finger, module.labels)
    codes = np.zeros(module.n_samples, dtype=np.int64)
    for label in labels:
        if label.state is ContactState.UNSTABLE and label.cause not in (None, Cause.SLIP):
            first, last = np.searchsorted(module.times, (label.start, label.end))
            codes[first:last] = CAUSES.index(ALIKE.get(label.cause, label.cause)) + 1
    usable = np.flatnonzero(
        (codes > 0) & (truth.codes != SLIDING) & np.isfinite(features).all(axis=1)
    )[::step]
    if not len(usable):
        return None
    return CauseSamples(features[usable], codes[usable], units[usable])
