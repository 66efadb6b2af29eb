"""How data are divided into what trains and what tests."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Samples
from holdfast.errors import TrainingError
from holdfast.training.setting import Split
from holdfast.training.survey import Entry

Integers = npt.NDArray[np.int64]

RANDOM_FOLDS = 5
"""Folds of the random split: 80 % train, 20 % test, as in the paper."""


@dataclass(frozen=True)
class Division:
    """What is held out together: a unit is a recording, an object, or a random fifth of samples.

    Attributes:
        split: which of them.
        units: their names.
        group_of: (n_recordings,) the recording, or object, that each recording counts as in the
            folds of a search; for `recording` and `object` also its unit.
        seed: of the random split.
    """

    split: Split
    units: tuple[str, ...]
    group_of: Integers
    seed: int

    def units_of(self, place: int, n_samples: int) -> Integers:
        """The unit of each sample of a recording: the same whenever it is asked for."""
        if self.split == "random":
            return np.random.default_rng([self.seed, place]).integers(
                len(self.units), size=n_samples
            )
        return np.full(n_samples, self.group_of[place])

    def recordings_without(self, held: Collection[int]) -> list[int]:
        """Recordings that are not held out whole."""
        if self.split == "random":
            return list(range(len(self.group_of)))
        return [place for place, unit in enumerate(self.group_of) if unit not in held]


def divide(entries: Sequence[Entry], split: Split, seed: int) -> Division:
    """The units of a dataset.

    Args:
        entries: of the recordings.
        split: `recording`, `object` or `random`.
        seed: of the random split.

    Raises:
        TrainingError: fewer than two units, or a recording does not say its object.
    """
    names = [entry.object if split == "object" else entry.name for entry in entries]
    unnamed = [entry.name for entry, name in zip(entries, names, strict=True) if name is None]
    if unnamed:
        raise TrainingError(
            f"recording {unnamed[0]!r} does not say its object ('object' in its metadata); "
            "the split by object needs it of every recording"
        )
    groups = list(dict.fromkeys(str(name) for name in names))
    group_of = np.array([groups.index(str(name)) for name in names])
    if split == "random":
        return Division(split, tuple(f"fifth {k + 1}" for k in range(RANDOM_FOLDS)), group_of, seed)
    if len(groups) < 2:
        raise TrainingError(
            f"the split by {split} needs at least two, {len(groups)} given ({groups[0]})"
        )
    return Division(split, tuple(groups), group_of, seed)


def inner_folds(samples: Samples, n_folds: int, seed: int) -> list[npt.NDArray[np.bool_]]:
    """Which samples each fold of a search holds out: whole groups, both classes on both sides.

    Args:
        samples: with the group of each.
        n_folds: at most.
        seed: of the order in which groups are dealt out.

    Returns:
        One mask a fold; folds in which a class is missing are left out.
    """
    groups = np.random.default_rng(seed).permutation(np.unique(samples.groups))
    masks = [np.isin(samples.groups, groups[i::n_folds]) for i in range(min(n_folds, len(groups)))]
    return [m for m in masks if not samples.take(m).one_class and not samples.take(~m).one_class]
