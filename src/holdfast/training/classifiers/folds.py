"""Folds: which units, groups or samples are held out together."""

import numpy as np

from holdfast.sensors.types import Array, Flags, Integers


def shuffled(n_units: int, seed: int) -> Integers:
    """Return the indices of the units in a random order."""
    return np.random.default_rng(seed).permutation(n_units)


def deal_folds(n_units: int, n_folds: int, order: Integers | None = None) -> Integers:
    """Return (n_units,) the fold of each unit; units are dealt to the folds in turn.

    Args:
        n_units: number of units.
        n_folds: number of folds; with fewer units the last folds are empty.
        order: (n_units,) indices of the units in which they are dealt; by default their own.

    Example:
        >>> deal_folds(5, 2).tolist(), deal_folds(3, 2, np.array([2, 0, 1])).tolist()
        ([0, 1, 0, 1, 0], [1, 0, 0])
    """
    fold_of = np.empty(n_units, dtype=np.int64)
    fold_of[slice(None) if order is None else order] = np.arange(n_units) % n_folds
    return fold_of


def group_folds(groups: Integers, n_folds: int, seed: int | None = None) -> list[Flags]:
    """Return which samples each fold holds out. A fold holds out whole groups.

    Args:
        groups: (n,) group of each sample.
        n_folds: maximum number of folds; there are no more than groups.
        seed: of the random order in which groups are dealt; None for their own order.
    """
    names, indices = np.unique(groups, return_inverse=True)
    order = None if seed is None else shuffled(len(names), seed)
    fold_of = deal_folds(len(names), n_folds, order)[indices]
    return [fold_of == fold for fold in range(min(n_folds, len(names)))]


def random_folds(n_samples: int, n_folds: int, generator: np.random.Generator) -> Integers:
    """Return (n_samples,) a random fold for each sample."""
    return generator.integers(n_folds, size=n_samples)


def block_folds(n_samples: int, n_blocks: int, gap: int) -> Integers:
    """Return the block of each sample; -1 if it is nearer than the gap to another block.

    Example:
        >>> block_folds(10, 2, 1).tolist()
        [0, 0, 0, 0, -1, -1, 1, 1, 1, 1]
    """
    block = np.arange(n_samples) * n_blocks // max(n_samples, 1)
    for start in np.flatnonzero(np.diff(block)) + 1:
        block[max(start - gap, 0) : start + gap] = -1
    return block


def time_folds(recordings: Integers, times: Array, n_blocks: int) -> Integers:
    """Return the block of the labelled time of its recording in which each sample is.

    Args:
        recordings: (n,) index of the recording of each sample.
        times: (n,) of the samples [s].
        n_blocks: number of blocks of equal duration.
    """
    blocks = np.zeros(len(times), dtype=np.int64)
    for index in np.unique(recordings):
        chosen = recordings == index
        first, last = times[chosen].min(), times[chosen].max()
        share = (times[chosen] - first) / max(float(last - first), 1e-9)
        blocks[chosen] = np.minimum(n_blocks * share, n_blocks - 1).astype(np.int64)
    return blocks
