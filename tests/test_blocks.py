"""Laws of blocks: a part has some of the whole's, and no other recording has any."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.blocks import BLOCK_CHANGES, BLOCK_STRIDE, any_packed, module_blocks, pack
from holdfast.recordings import Recording
from holdfast.synthetic import synthetic_recording

WHOLE = synthetic_recording("whole", 0)
READINGS = WHOLE.modules["index"].readings
N = len(READINGS)
SURE = BLOCK_CHANGES + BLOCK_STRIDE + 1
"""Number of changing samples that contain a block for certain: the first shows no change."""


def toggling(n, n_readings):
    """Readings at rest: of one sample after another, one of a few at random."""
    rng = np.random.default_rng(0)
    return rng.normal(size=(n_readings, 16, 3))[rng.integers(n_readings, size=n)]


@given(st.data())
def test_a_slice_has_blocks_of_the_whole_and_no_others(data):
    first = data.draw(st.integers(0, N - SURE))
    found = module_blocks(READINGS[first : data.draw(st.integers(first + SURE, N))])
    assert len(found) > 0
    assert set(found) <= set(module_blocks(READINGS))


@given(st.integers(0, N // 2), st.permutations(list(WHOLE.modules)), st.integers(1, 3))
def test_a_half_of_any_fingers_in_any_order_is_found_by_few_packed_blocks(first, names, n):
    cut = {
        new: WHOLE.modules[old].slice(first, first + N // 2)
        for new, old in list(zip(WHOLE.modules, names, strict=True))[:n]
    }
    assert any_packed(pack([WHOLE.blocks], 64), Recording("part", cut).blocks)
    if n == 3:  # three of each recording are enough for a half of all its fingers
        assert any_packed(pack([WHOLE.blocks], 3), Recording("part", cut).blocks)


@given(st.integers(1, 2**32))
def test_other_seeds_have_no_block_in_common(seed):
    other = synthetic_recording("other", seed, ("thumb",))
    assert not np.isin(other.blocks, WHOLE.blocks).any()
    assert not any_packed(pack([WHOLE.blocks], 64), other.blocks)


@pytest.mark.parametrize("kind", [np.uint16, np.int32, np.float32, np.float64])
def test_the_number_type_does_not_count(kind):
    np.testing.assert_array_equal(module_blocks(READINGS.astype(kind)), module_blocks(READINGS))


def test_zero_has_no_sign():
    readings = np.where(READINGS % 3 == 0, 0.0, READINGS)
    np.testing.assert_array_equal(
        module_blocks(readings), module_blocks(np.where(readings == 0, -0.0, readings))
    )


def test_samples_that_repeat_are_found_in_any_cut():
    held = np.repeat(READINGS, np.random.default_rng(1).integers(1, 5, size=N), axis=0)
    whole = module_blocks(held)
    for first in range(8):
        found = module_blocks(held[first:2000])
        assert len(found) > 10
        assert set(found) <= set(whole)


@given(st.integers(1, 700))
def test_periodic_readings_have_no_blocks(period):
    rng = np.random.default_rng(period)
    ring = rng.normal(size=(period, 4, 3))
    readings = ring[np.arange(2 * period + 3 * BLOCK_CHANGES) % period]
    assert len(module_blocks(readings)) == 0


@pytest.mark.parametrize("n_readings", [1, 2, 8])
def test_readings_at_rest_have_no_blocks(n_readings):
    assert len(module_blocks(toggling(5000, n_readings))) == 0


def test_what_is_too_short_has_no_blocks():
    for n in (0, 1, 2, SURE - 1):
        assert len(module_blocks(READINGS[:n])) == 0
    module = replace(WHOLE.modules["thumb"], times=[], readings=READINGS[:0], labels=())
    mixed = Recording("mixed", {"thumb": module, "index": WHOLE.modules["index"]})
    assert set(mixed.blocks) == set(module_blocks(READINGS))


def test_a_packed_digest_is_that_of_one_block():
    packed = pack([WHOLE.blocks, WHOLE.blocks[:0]], 10**6)
    assert len(packed) == 5 * len(WHOLE.blocks)
    assert all(any_packed(packed, WHOLE.blocks[k : k + 1]) for k in range(len(WHOLE.blocks)))
    assert not any_packed(packed, WHOLE.blocks + np.uint64(2**30))
    assert not any_packed(b"", WHOLE.blocks)
