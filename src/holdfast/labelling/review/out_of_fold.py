"""What classifiers that have not seen a recording make of it: three probabilities a sample.

Two binary classifiers of the usual kind make three states: one tells contact from none, over
all labels, the other stable from unstable, over the labels in contact:

    p(no contact) = 1 - c,    p(unstable) = c (1 - s),    p(stable) = c s

Where the labels of a finger know only one answer to a question, or only one where there are
features (not before the tare and the first window), c or s is that answer.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import overload

import numpy as np

from holdfast.contact import ContactState
from holdfast.errors import TrainingError
from holdfast.model import ANY_FINGER, Model
from holdfast.parallel import map_ordered
from holdfast.recordings import Label, Recording
from holdfast.sensors.types import Array
from holdfast.training.design import at_rate, gather
from holdfast.training.fitting import Material, fit_model
from holdfast.training.setting import Setting
from holdfast.training.splits import divide
from holdfast.training.survey import survey

N_FOLDS = 10
"""Recordings are held out in at most so many groups."""

Probabilities = dict[str, Array]
Relabel = Callable[[Label], Label | None]
Fit = Callable[[Sequence[Recording]], "_Judges"]


def out_of_fold(
    recordings: Sequence[Recording],
    setting: Setting,
    *,
    n_folds: int = N_FOLDS,
    n_jobs: int = 1,
) -> Iterator[tuple[Recording, Probabilities]]:
    """What classifiers that have not seen them say of recordings, one at a time.

    Recordings are read one at a time, and more than once.

    Args:
        recordings: labelled; a lazy dataset will do.
        setting: how to train, with the reference parameters; its split says what is held out
            together, `recording` or `object`.
        n_folds: recordings, or objects, are held out in at most so many groups.
        n_jobs: fits at a time; -1 for as many as there are processors.

    Yields:
        Each recording, and by finger (n, 3) probabilities of no contact, unstable and stable;
        NaN where there are none. A finger whose labels know one state only is left out.

    Raises:
        TrainingError: no labels, one state only, or one recording only.
        RecordingError: a recording cannot be read.
        ModelError: a finger has another sensor than where it is labelled.
        ValueError: the split is random, or there are fewer than two folds.
    """
    _check(recordings, setting, n_folds)
    seen = _states(recordings)
    fit = partial(_Judges.fitted, setting=setting, n_folds=n_folds, n_jobs=n_jobs)
    touching = fit(
        _Relabelled(recordings, _ask_contact, _knowing(seen, _CONTACT)), dict.fromkeys(seen, 1.0)
    )
    holding = fit(
        _Relabelled(recordings, _ask_stability, _knowing(seen, _STABILITY)),
        {finger: float(ContactState.STABLE in states) for finger, states in seen.items()},
    )
    asked = touching.fingers | holding.fingers
    for place, recording in enumerate(recordings):
        contact, stability = touching.judge(place, recording), holding.judge(place, recording)
        fingers = [finger for finger in recording.modules if finger in asked]
        yield recording, {f: _joined(contact[f], stability[f]) for f in fingers}


class _Relabelled(Sequence[Recording]):
    """The same recordings with the answers to one question as their labels."""

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
        answers = {
            name: [answer for label in module.labels if (answer := self._relabel(label))]
            for name, module in recording.modules.items()
            if name in self.fingers
        }
        return recording.with_labels(answers)


@dataclass(frozen=True)
class _Judges:
    """The answers to one question, by a model for each group of recordings.

    Attributes:
        fingers: those of which the labelled samples with features know both answers.
        certain: the answer, 0 or 1, of all others.
        models: of each fold; None where no finger has both classes without it.
        fold_of: the fold that each recording is held out in.
    """

    fingers: frozenset[str]
    certain: Mapping[str, float]
    models: Sequence[Model | None]
    fold_of: Sequence[int]

    @classmethod
    def fitted(
        cls,
        recordings: _Relabelled,
        certain: Mapping[str, float],
        *,
        setting: Setting,
        n_folds: int,
        n_jobs: int,
    ) -> "_Judges":
        if not recordings.fingers:
            return cls(frozenset(), certain, [None], [0] * len(recordings))
        found = survey(recordings, setting.rate)
        division = divide(found.entries, setting.split, setting.seed)
        material = Material(found, division, gather(recordings, found, setting, division))
        one_sided = _one_sided(material, recordings.fingers)
        order = np.random.default_rng(setting.seed).permutation(len(division.units))
        fold_of = (np.argsort(order) % n_folds)[division.group_of].tolist()
        parameters = {f: setting.recipe_of(f).reference for f in material.designs}
        tasks = [
            (material, setting, parameters, set(order[fold::n_folds].tolist()))
            for fold in range(min(n_folds, len(order)))
        ]
        fingers = recordings.fingers - one_sided.keys()
        models = list(map_ordered(fit_model, tasks, n_jobs))
        return cls(fingers, {**certain, **one_sided}, models, fold_of)

    def judge(self, place: int, recording: Recording) -> Probabilities:
        """(n,) of class 1 for each finger; NaN where there is none."""
        model, modules = self.models[self.fold_of[place]], recording.modules
        found = {
            f: np.full(m.n_samples, np.nan if f in self.fingers else self.certain[f])
            for f, m in modules.items()
        }
        if model is None or not (ANY_FINGER in model.fingers or set(model.fingers) & set(modules)):
            return found
        given = recording if model.rate is None else at_rate(recording, model.rate)
        for finger, probability in model.predict_proba(given).items():
            if finger in self.fingers:
                at, times = modules[finger].times, given.modules[finger].times
                latest = np.maximum(np.searchsorted(times, at, side="right") - 1, 0)
                found[finger] = probability[latest]
        return found


def _one_sided(material: Material, fingers: Collection[str]) -> dict[str, float]:
    """The answer for each finger whose labelled samples with features know only one."""
    every = material.designs.get(ANY_FINGER)
    designs = {f: material.designs.get(f, every) for f in fingers}
    return {
        f: float(design.samples.stable.any())
        for f, design in designs.items()
        if design and design.samples.one_class
    }


_CONTACT = ({ContactState.NO_CONTACT}, {ContactState.UNSTABLE, ContactState.STABLE})
_STABILITY = ({ContactState.UNSTABLE}, {ContactState.STABLE})
"""The states that answer a question with no, and with yes."""


def _ask_contact(label: Label) -> Label:
    touching = label.state is not ContactState.NO_CONTACT
    return replace(label, state=ContactState.STABLE if touching else ContactState.UNSTABLE)


def _ask_stability(label: Label) -> Label | None:
    return None if label.state is ContactState.NO_CONTACT else label


def _knowing(
    seen: Mapping[str, set[ContactState]], answers: tuple[set[ContactState], set[ContactState]]
) -> list[str]:
    """The fingers whose labels know both answers."""
    return [finger for finger, states in seen.items() if all(states & each for each in answers)]


def _states(recordings: Sequence[Recording]) -> dict[str, set[ContactState]]:
    """The states that each finger is labelled with anywhere.

    Raises:
        TrainingError: no finger with two.
    """
    seen: dict[str, set[ContactState]] = {}
    for recording in recordings:
        for finger, module in recording.modules.items():
            seen.setdefault(finger, set()).update(label.state for label in module.labels)
    if not any(seen.values()):
        raise TrainingError(f"none of the {len(recordings)} recordings has labels to audit")
    if not any(len(states) > 1 for states in seen.values()):
        known = ", ".join(f"{f} {', '.join(states)}" for f, states in seen.items() if states)
        raise TrainingError(f"two states at least are needed in a finger; labelled are {known}")
    return seen


def _check(recordings: Sequence[Recording], setting: Setting, n_folds: int) -> None:
    if setting.split == "random":
        raise ValueError(
            "an audit holds out a whole recording or object; the split random gives the "
            "classifier the neighbours of what it judges"
        )
    if n_folds < 2:
        raise ValueError(f"at least 2 folds expected, {n_folds} given")
    if len(recordings) < 2:
        raise TrainingError(
            "an audit judges the labels of a recording by those of others: at least 2 "
            f"recordings expected, {len(recordings)} given"
        )


def _joined(contact: Array, stability: Array) -> Array:
    """(n, 3) of no contact, unstable and stable."""
    columns = (1 - contact, contact * (1 - stability), contact * stability)
    return np.stack(columns, axis=1)
