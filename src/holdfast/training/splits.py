"""Splits of a dataset into samples that train and samples that test."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from holdfast.blocks import Digests
from holdfast.errors import TrainingError
from holdfast.sensors.types import Integers
from holdfast.training.classifiers.fitting import Samples
from holdfast.training.classifiers.folds import block_folds, group_folds, random_folds
from holdfast.training.dataset_scan import ScannedRecording
from holdfast.training.setting import Split

RANDOM_FOLDS = 5
"""Number of folds of the random split: 80 % train, 20 % test, as in the paper."""
TIME_FOLDS = 5
"""Number of blocks of time into which the split by time cuts every recording."""
TIME_GAP = 0.5
"""Samples nearer than this to another block are left out of the split by time [s].

It is the longest lag of the relative features; in short recordings it is a quarter of a block."""


@dataclass(frozen=True)
class DataSplit:
    """Units of a dataset that are held out together.

    A unit is a recording, an object, a fifth of the time of every recording, or a random fifth of
    all samples.

    Attributes:
        split: kind of the units.
        units: their names.
        group_of: (n_recordings,) index of the recording, or object, in the folds of a search;
            for the splits `recording` and `object` also the index of its unit.
        seed: of the random split.
        rates: (n_recordings,) samples per second of the recordings [Hz].
    """

    split: Split
    units: tuple[str, ...]
    group_of: Integers
    seed: int
    rates: npt.NDArray[np.float64]

    def units_of(self, index: int, n_samples: int) -> Integers:
        """Return the unit of each sample of a recording, the same at every call.

        Args:
            index: index of the recording in the dataset.
            n_samples: number of its samples.

        Returns:
            (n_samples,); -1 for a sample between two blocks of time.
        """
        if self.split == "time":
            # Neighbours in time are alike, so blocks have a gap between them; a quarter of a block
            # at most, or a short recording would have nothing but gaps.
            longest = n_samples // (4 * len(self.units))
            gap = min(round(TIME_GAP * self.rates[index]), longest)
            return block_folds(n_samples, len(self.units), gap)
        if self.split == "random":
            # A recording is read more than once, in any order and process: its own stream.
            generator = np.random.default_rng([self.seed, index])
            return random_folds(n_samples, len(self.units), generator)
        return np.full(n_samples, self.group_of[index])

    def recordings_without(self, left_out: Collection[int]) -> list[int]:
        """Return the indices of the recordings that have samples outside the held units."""
        if self.split in ("time", "random"):
            return list(range(len(self.group_of)))
        return [index for index, unit in enumerate(self.group_of) if unit not in left_out]


def split_data(recordings: Sequence[ScannedRecording], split: Split, seed: int) -> DataSplit:
    """Split a dataset into units.

    Args:
        recordings: of the dataset, in order.
        split: `recording`, `object`, `time` or `random`.
        seed: of the random split.

    Raises:
        TrainingError: there are fewer than two units, a recording does not name its object, or two
            units share readings.
    """
    names = [recording.object if split == "object" else recording.name for recording in recordings]
    unnamed = [
        recording.name for recording, name in zip(recordings, names, strict=True) if name is None
    ]
    if unnamed:
        raise TrainingError(
            f"recording {unnamed[0]!r} does not name its object ('object' in its metadata); "
            "the split by object needs the object of every recording"
        )
    groups = list(dict.fromkeys(str(name) for name in names))
    indices = {name: index for index, name in enumerate(groups)}
    group_of = np.array([indices[str(name)] for name in names])
    rates = np.array([recording.rate for recording in recordings])
    if split in ("time", "random"):
        n_folds = TIME_FOLDS if split == "time" else RANDOM_FOLDS
        parts = tuple(f"fifth {k + 1}" for k in range(n_folds))
        return DataSplit(split, parts, group_of, seed, rates)
    if len(groups) < 2:
        raise TrainingError(
            f"the split by {split} needs at least two, {len(groups)} given ({groups[0]}); the "
            "split by time needs one recording"
        )
    check_nothing_shared(
        [recording.name for recording in recordings],
        [recording.blocks for recording in recordings],
        group_of,
        ", or give both the same object in their metadata and use --split object",
    )
    return DataSplit(split, tuple(groups), group_of, seed, rates)


def check_nothing_shared(
    names: Sequence[str], blocks: Sequence[Digests], groups: Integers, hint: str = ""
) -> None:
    """Check that no two recordings of different groups share readings.

    Args:
        names: of the recordings.
        blocks: of each.
        groups: (n_recordings,) group that is held out together.
        hint: what can be done instead of removing one of them.

    Raises:
        TrainingError: two share a block.
    """
    owners = np.repeat(np.arange(len(blocks)), [len(blocks_of_one) for blocks_of_one in blocks])
    digests = np.concatenate(blocks)
    order = np.argsort(digests, kind="stable")
    owners, digests = owners[order], digests[order]
    first, second = owners[:-1], owners[1:]
    shared = np.flatnonzero((digests[1:] == digests[:-1]) & (groups[first] != groups[second]))
    if len(shared):
        name, other = names[first[shared[0]]], names[second[shared[0]]]
        raise TrainingError(
            f"recordings {name!r} and {other!r} share readings: one would be tested by a model "
            f"that was trained on the other; remove one of them{hint}"
        )


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
    masks = group_folds(samples.groups, n_folds, seed)
    return [m for m in masks if not samples.take(m).one_class and not samples.take(~m).one_class]
