"""Probabilities of three states, from classifiers that have not seen the recording.

Two binary classifiers give three probabilities. One separates contact from no contact (c, the
probability of contact), over all labels. The other separates stable from unstable (s), over the
labels in contact:

    p(no contact) = 1 - c,    p(unstable) = c (1 - s),    p(stable) = c s

If the labels of a finger have only one class of c or s, or only one among the samples with
features (after the tare and the first window), c or s is 0 or 1.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import overload

import numpy as np

from holdfast.classifiers.folds import deal_folds, shuffled
from holdfast.contact import ContactState
from holdfast.errors import TrainingError
from holdfast.model import ANY_FINGER, Model
from holdfast.parallel import Engine
from holdfast.recordings import Label, Recording
from holdfast.resampling import at_rate
from holdfast.sensors.types import Array
from holdfast.training.model_fit import TrainingData, fit_model
from holdfast.training.setting import Setting

MAX_AUDIT_FOLDS = 10
"""Largest number of groups of recordings that are held out in turn."""

Probabilities = dict[str, Array]
Relabel = Callable[[Label], Label | None]
Classes = tuple[set[ContactState], set[ContactState]]

_CONTACT_CLASSES: Classes = (
    {ContactState.NO_CONTACT},
    {ContactState.UNSTABLE, ContactState.STABLE},
)
_STABILITY_CLASSES: Classes = ({ContactState.UNSTABLE}, {ContactState.STABLE})
"""States of class 0 and of class 1 of each binary classifier."""


def out_of_fold(
    recordings: Sequence[Recording],
    setting: Setting,
    *,
    n_folds: int = MAX_AUDIT_FOLDS,
    n_jobs: int = 1,
) -> Iterator[tuple[Recording, Probabilities]]:
    """Yield recordings with probabilities from classifiers that are trained on other recordings.

    Args:
        recordings: labelled; may be a lazy dataset. Each is read more than once, one at a time.
        setting: how to train; the reference parameters are used. Its split, `recording` or
            `object`, defines what is held out together.
        n_folds: largest number of groups of recordings or objects that are held out in turn.
        n_jobs: number of parallel fits; -1 for the number of processors.

    Yields:
        Each recording, and by finger (n, 3) probabilities of no contact, unstable and stable; NaN
        if they are unknown. Fingers with labels of only one state are left out.

    Raises:
        TrainingError: there are no labels, only one state, or only one recording.
        RecordingError: a recording cannot be read.
        ModelError: a finger has different sensors in different recordings.
        ValueError: the split is random, or there are fewer than two folds.
    """
    if setting.split == "random":
        raise ValueError(
            "split recording or object expected for an audit, random given: it trains on "
            "neighbours of the samples that are audited"
        )
    if n_folds < 2:
        raise ValueError(f"at least 2 folds expected, {n_folds} given")
    if len(recordings) < 2:
        raise TrainingError(
            "an audit compares the labels of a recording with those of others: at least 2 "
            f"recordings expected, {len(recordings)} given"
        )
    states = _states(recordings)
    fit = partial(_FoldModels.fit, setting=setting, n_folds=n_folds, n_jobs=n_jobs)

    def as_contact(label: Label) -> Label:
        touching = label.state is not ContactState.NO_CONTACT
        return replace(label, state=ContactState.STABLE if touching else ContactState.UNSTABLE)

    def as_stability(label: Label) -> Label | None:
        return None if label.state is ContactState.NO_CONTACT else label

    def with_both(classes: Classes) -> list[str]:
        return [finger for finger, own in states.items() if all(own & each for each in classes)]

    contact_models = fit(
        _Relabelled(recordings, as_contact, with_both(_CONTACT_CLASSES)),
        dict.fromkeys(states, 1.0),
    )
    stability_models = fit(
        _Relabelled(recordings, as_stability, with_both(_STABILITY_CLASSES)),
        {finger: float(ContactState.STABLE in own) for finger, own in states.items()},
    )
    learnt = contact_models.fingers | stability_models.fingers
    for index, recording in enumerate(recordings):
        contact = contact_models.predict(index, recording)
        stability = stability_models.predict(index, recording)
        yield (
            recording,
            {
                f: np.stack(
                    (1 - contact[f], contact[f] * (1 - stability[f]), contact[f] * stability[f]),
                    axis=1,
                )
                for f in recording.modules
                if f in learnt
            },
        )


class _Relabelled(Sequence[Recording]):
    """Recordings with the classes of a binary classifier as labels: stable is class 1.

    Args:
        recordings: the recordings.
        relabel: returns the new label, or None to leave the label out.
        fingers: that keep labels.
    """

    def __init__(
        self, recordings: Sequence[Recording], relabel: Relabel, fingers: Collection[str]
    ) -> None:
        self._recordings, self._relabel, self.fingers = recordings, relabel, frozenset(fingers)

    def __len__(self) -> int:
        return len(self._recordings)

    @overload
    def __getitem__(self, index: int) -> Recording: ...
    @overload
    def __getitem__(self, index: slice) -> "_Relabelled": ...
    def __getitem__(self, index: int | slice) -> "Recording | _Relabelled":
        if isinstance(index, slice):
            return _Relabelled(self._recordings[index], self._relabel, self.fingers)
        recording = self._recordings[index]
        labels = {
            name: [new for label in module.labels if (new := self._relabel(label))]
            for name, module in recording.modules.items()
            if name in self.fingers
        }
        return recording.with_labels(labels)


@dataclass(frozen=True)
class _FoldModels:
    """A binary classifier, with a model for each group of held-out recordings.

    Attributes:
        fingers: with both classes among the labelled samples with features.
        constant: probability of class 1 of all other fingers, 0 or 1.
        models: of each fold; None if no finger has both classes outside the fold.
        fold_of: fold of each recording.
    """

    fingers: frozenset[str]
    constant: Mapping[str, float]
    models: Sequence[Model | None]
    fold_of: Sequence[int]

    @classmethod
    def fit(
        cls,
        recordings: _Relabelled,
        constant: Mapping[str, float],
        *,
        setting: Setting,
        n_folds: int,
        n_jobs: int,
    ) -> "_FoldModels":
        if not recordings.fingers:
            return cls(frozenset(), constant, [None], [0] * len(recordings))
        data = TrainingData.of(recordings, setting)
        data_split = data.data_split
        # Its samples with features may have one class, though its labels have both: the other
        # lies in the tare or the first window.
        shared = data.fingers.get(ANY_FINGER)
        samples_of = {f: data.fingers.get(f, shared) for f in recordings.fingers}
        one_class = {
            f: float(own.samples.positive.any())
            for f, own in samples_of.items()
            if own and own.samples.one_class
        }
        n_units = len(data_split.units)
        unit_folds = deal_folds(n_units, n_folds, shuffled(n_units, setting.seed))
        parameters = {f: setting.recipe_of(f).reference for f in data.fingers}
        tasks = [
            (data, setting, parameters, set(np.flatnonzero(unit_folds == fold).tolist()))
            for fold in range(min(n_folds, n_units))
        ]
        fingers = recordings.fingers - one_class.keys()
        models = list(Engine(n_jobs).map_ordered(fit_model, tasks))
        return cls(
            fingers, {**constant, **one_class}, models, unit_folds[data_split.group_of].tolist()
        )

    def predict(self, index: int, recording: Recording) -> Probabilities:
        """Return (n,) probabilities of class 1 for each finger; NaN if they are unknown."""
        model, modules = self.models[self.fold_of[index]], recording.modules
        found = {
            f: np.full(m.n_samples, np.nan if f in self.fingers else self.constant[f])
            for f, m in modules.items()
        }
        if model is None or not (ANY_FINGER in model.fingers or set(model.fingers) & set(modules)):
            return found
        given = recording if model.rate is None else at_rate(recording, model.rate)
        for finger, probability in model.predict_proba(given).items():
            if finger in self.fingers:
                own_times, times = modules[finger].times, given.modules[finger].times
                latest = np.maximum(np.searchsorted(times, own_times, side="right") - 1, 0)
                found[finger] = probability[latest]
        return found


def _states(recordings: Sequence[Recording]) -> dict[str, set[ContactState]]:
    """Return the labelled states of each finger over all recordings.

    Raises:
        TrainingError: no finger has two.
    """
    found: dict[str, set[ContactState]] = {}
    for recording in recordings:
        for finger, module in recording.modules.items():
            found.setdefault(finger, set()).update(label.state for label in module.labels)
    if not any(found.values()):
        raise TrainingError(f"none of the {len(recordings)} recordings has labels to audit")
    if not any(len(states) > 1 for states in found.values()):
        known = ", ".join(f"{f} {', '.join(states)}" for f, states in found.items() if states)
        raise TrainingError(f"a finger with at least two labelled states expected, {known} given")
    return found
