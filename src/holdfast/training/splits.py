"""Splits of a dataset into samples that train and samples that test."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Samples
from holdfast.errors import TrainingError
from holdfast.training.dataset_scan import ScannedRecording
from holdfast.training.setting import Split

Integers = npt.NDArray[np.int64]

RANDOM_FOLDS = 5
"""Number of folds of the random split: 80 % train, 20 % test, as in the paper."""


@dataclass(frozen=True)
class DataSplit:
    """Units of a dataset that are held out together.

    A unit is a recording, an object, or a random fifth of all samples.

    Attributes:
        split: kind of the units.
        units: their names.
        group_of: (n_recordings,) index of the recording, or object, in the folds of a search;
            for the splits `recording` and `object` also the index of its unit.
        seed: of the random split.
    """

    split: Split
    units: tuple[str, ...]
    group_of: Integers
    seed: int

    def units_of(self, place: int, n_samples: int) -> Integers:
        """Return the unit of each sample of a recording, the same at every call.

        Args:
            place: index of the recording in the dataset.
            n_samples: number of its samples.
        """
        if self.split == "random":
            return np.random.default_rng([self.seed, place]).integers(
                len(self.units), size=n_samples
            )
        return np.full(n_samples, self.group_of[place])

    def recordings_without(self, held: Collection[int]) -> list[int]:
        """Return the indices of the recordings of which not all samples are in held units."""
        if self.split == "random":
            return list(range(len(self.group_of)))
        return [place for place, unit in enumerate(self.group_of) if unit not in held]


def split_data(recordings: Sequence[ScannedRecording], split: Split, seed: int) -> DataSplit:
    """Split a dataset into units.

    Args:
        recordings: of the dataset, in order.
        split: `recording`, `object` or `random`.
        seed: of the random split.

    Raises:
        TrainingError: there are fewer than two units, or a recording does not name its object.
    """
    names = [each.object if split == "object" else each.name for each in recordings]
    unnamed = [each.name for each, name in zip(recordings, names, strict=True) if name is None]
    if unnamed:
        raise TrainingError(
            f"recording {unnamed[0]!r} does not name its object ('object' in its metadata); "
            "the split by object needs the object of every recording"
        )
    groups = list(dict.fromkeys(str(name) for name in names))
    group_of = np.array([groups.index(str(name)) for name in names])
    if split == "random":
        fifths = tuple(f"fifth {k + 1}" for k in range(RANDOM_FOLDS))
        return DataSplit(split, fifths, group_of, seed)
    if len(groups) < 2:
        raise TrainingError(
            f"the split by {split} needs at least two, {len(groups)} given ({groups[0]})"
        )
    return DataSplit(split, tuple(groups), group_of, seed)


def inner_folds(samples: Samples, n_folds: int, seed: int) -> list[npt.NDArray[np.bool_]]:
    """Return which samples each fold of a search holds out.

    A fold holds out whole groups, and has both classes inside and outside.

    Args:
        samples: with the group of each.
        n_folds: maximum number of folds.
        seed: of the random order of the groups.

    Returns:
        One mask per fold. Folds in which a class is missing are left out.
    """
    groups = np.random.default_rng(seed).permutation(np.unique(samples.groups))
    masks = [np.isin(samples.groups, groups[i::n_folds]) for i in range(min(n_folds, len(groups)))]
    return [m for m in masks if not samples.take(m).one_class and not samples.take(~m).one_class]
