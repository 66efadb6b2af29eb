"""Blocks of readings: what recordings share, whatever was cut off, renamed or left out.

A block is 32 successive changes of one module: the readings after each change, and the number of
samples until the next. It counts if its hash is the least of 32 successive ones (winnowing). That
depends on the readings near it alone, so a cut at the start or the end moves no other block.
"""

import math
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

Digests = npt.NDArray[np.uint64]

BLOCK_CHANGES = 32
"""Number of changes of a block, a power of two. A noisy skin changes at every sample."""
BLOCK_STRIDE = 32
"""One of so many successive blocks counts: any 64 changes contain one that does."""
MIN_DIFFERENT = 16
"""Least number of different readings of a block that counts. A module at rest that toggles between
a few readings has fewer; two recordings of it may be alike by chance."""
HASHED_ROWS = 512
"""Number of samples that are hashed at a time: their arrays stay in the cache."""
PACKED_BYTES = 5
"""Bytes of a packed digest. With n of them, one of m digests of other readings is equal by chance
with a probability of n m / 2^40: 4e-6 for 1000 and 4000."""
MAX_PACKED = 64
"""Maximum number of packed digests of a recording."""

_ODD = np.uint64(0x9E3779B97F4A7C15)
_SHIFT = np.uint64(8 * (8 - PACKED_BYTES))


def module_blocks(readings: npt.NDArray[np.generic]) -> Digests:
    """Return the digests of the blocks of one module that count, in order of time.

    The number type does not count. A block that occurs twice belongs to a periodic signal, and is
    left out.

    Args:
        readings: (n, n_taxels, 3).
    """
    rows = _hash_rows(readings.reshape(len(readings), math.prod(readings.shape[1:])))
    changed = np.flatnonzero(rows[1:] != rows[:-1]) + 1
    rows = rows[changed[:-1]]
    if len(rows) < BLOCK_CHANGES + BLOCK_STRIDE - 1:
        return np.empty(0, np.uint64)
    hashes = _mix(rows + _ODD * np.diff(changed).astype(np.uint64))
    n, factor = 1, np.array([_ODD])  # an array: its product wraps around without a warning
    while n < BLOCK_CHANGES:  # of n changes, then of 2 n
        hashes = factor * hashes[:-n] + hashes[n:]
        n, factor = 2 * n, factor * factor
    hashes = _mix(hashes)
    windows = np.lib.stride_tricks.sliding_window_view(hashes, BLOCK_STRIDE)
    least = np.unique(np.arange(len(windows)) + windows.argmin(axis=1))
    inside = np.sort(rows[least[:, None] + np.arange(BLOCK_CHANGES)], axis=1)
    n_different = 1 + (inside[:, 1:] != inside[:, :-1]).sum(axis=1)
    # Mixed again: the least of 32 hashes is small, and collides more often than any hash.
    digests: Digests = _mix(hashes[least[n_different >= MIN_DIFFERENT]] + _ODD)
    _, first, counts = np.unique(digests, return_index=True, return_counts=True)
    return np.take(digests, np.sort(first[counts == 1]))


def pack(recordings: Iterable[Digests], n_each: int) -> bytes:
    """Return shortened digests of some blocks of each recording, spread over its time.

    Args:
        recordings: blocks of each, in order of time.
        n_each: number of blocks of each.
    """
    # The least of the middle of each part of the time: of any module, by chance.
    parts = [part for blocks in recordings for part in np.array_split(blocks, n_each) if len(part)]
    thirds = [(len(part) // 3, part) for part in parts]
    kept = np.array([part[n : len(part) - n].min() for n, part in thirds], np.uint64) >> _SHIFT
    return kept.astype(">u8").view(np.uint8).reshape(-1, 8)[:, -PACKED_BYTES:].tobytes()


def any_packed(packed: bytes, blocks: Digests) -> bool:
    """Return whether one of the blocks is among those that were packed."""
    padded = np.zeros((len(packed) // PACKED_BYTES, 8), np.uint8)
    padded[:, -PACKED_BYTES:] = np.frombuffer(packed, np.uint8).reshape(-1, PACKED_BYTES)
    return bool(np.isin(blocks >> _SHIFT, padded.view(">u8")[:, 0].astype(np.uint64)).any())


def _hash_rows(readings: npt.NDArray[np.generic]) -> Digests:
    """Return (n,) a hash of each sample, of readings (n, n_channels)."""
    weights = _mix(_ODD * np.arange(1, readings.shape[1] + 1, dtype=np.uint64)) | np.uint64(1)
    rows = np.empty(len(readings), np.uint64)
    for first in range(0, len(readings), HASHED_ROWS):
        # Zero is added so that -0 is 0; the product by einsum takes half the time of that by @.
        part = np.ascontiguousarray(readings[first : first + HASHED_ROWS], np.float32)
        bits = (part + np.float32(0)).view(np.uint32).astype(np.uint64)
        rows[first : first + HASHED_ROWS] = np.einsum("ij,j->i", bits, weights)
    return rows


def _mix(x: Digests) -> Digests:
    """Return a hash of each number: the finaliser of SplitMix64, a bijection."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
