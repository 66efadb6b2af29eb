from itertools import pairwise

import numpy as np
import pytest
import pywt
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.detection import FEATURE_NAMES, FeatureSpec, Tare, haar_features
from holdfast.detection.features import extract
from holdfast.detection.plan import StreamPlan
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor

from . import naive_features as naive

WINDOWS = range(2, 65, 2)
KINDS = [
    np.float64,
    *(pytest.param(kind, marks=pytest.mark.slow) for kind in (np.float32, np.int64, np.int16)),
]
BAR = 1e-9
"""Of the largest F_a in the window."""


def walk(n, seed=0, scale=100.0):
    return np.cumsum(np.random.default_rng(seed).normal(scale=scale, size=(n, 3)), axis=0)


def by_pywt(force, window):
    """(n, 6) with the Haar transform of PyWavelets; windows that fit only."""
    amplitude = np.linalg.norm(np.asarray(force, dtype=np.float64), axis=1)
    rows = np.full((len(force), 6), np.nan)
    for k in range(window - 1, len(force)):
        approximations, details = pywt.dwt(amplitude[k - window + 1 : k + 1], "haar")
        sigma = np.sqrt(((details - details.mean()) ** 2).sum() / window)
        rows[k] = [amplitude[k], *force[k], approximations.sum() / window, sigma]
    return rows


def worst(found, expected, force, window):
    """The largest difference, as a share of the largest F_a in its window."""
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    amplitude = np.linalg.norm(np.asarray(force, dtype=np.float64), axis=1)
    held = np.lib.stride_tricks.sliding_window_view(amplitude, window).max(axis=1)
    share = np.abs(found - expected)[window - 1 :].max(axis=1) / np.where(held > 0, held, 1)
    return np.nanmax(share)


def test_names():
    assert FEATURE_NAMES == naive.NAMES


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("kind", KINDS)
def test_equals_pywavelets_in_every_window_at_both_parities(window, kind):
    force = walk(window + 71, seed=window).astype(kind)
    assert worst(haar_features(force, window), by_pywt(force, window), force, window) < BAR


def test_one_pair_has_no_spread():
    assert (haar_features(walk(20), 2)[1:, 5] == 0).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("place", [0, 5, 30, 39, 40, 599])
def test_exactly_the_windows_that_hold_it_are_nan(bad, axis, place):
    force = walk(600)
    clean = haar_features(force, 14)
    force[place, axis] = bad
    found = haar_features(force, 14)
    hit = (np.arange(600) < 13) | ((np.arange(600) >= place) & (np.arange(600) < place + 14))
    assert np.isnan(found[hit]).all()
    assert np.array_equal(found[~hit], clean[~hit])


@pytest.mark.parametrize("n", [0, 1, 13])
def test_a_window_longer_than_the_data_gives_nan(n):
    found = haar_features(walk(n), 14)
    assert found.shape == (n, 6)
    assert found.dtype == np.float64
    assert np.isnan(found).all()


def test_a_window_as_long_as_the_data():
    assert np.isfinite(haar_features(walk(14), 14)).all(axis=1).tolist() == [False] * 13 + [True]


@pytest.mark.parametrize("window", [-2, 0, 1, 3, 13, 14.5])
def test_refuses_windows_that_are_no_pairs(window):
    with pytest.raises(ValueError, match=f"{window} given"):
        haar_features(walk(20), window)


@pytest.mark.parametrize("shape", [(20,), (20, 2), (20, 4), (2, 10, 3)])
def test_refuses_other_shapes(shape):
    with pytest.raises(ValueError, match="force"):
        haar_features(np.zeros(shape), 14)


@pytest.mark.slow
@given(
    n=st.integers(0, 1500),
    half=st.integers(1, 32),
    cuts=st.lists(st.integers(0, 1500), max_size=6),
    seed=st.integers(0, 9),
)
@settings(max_examples=60)
def test_any_chunking_gives_the_same_bits(n, half, cuts, seed):
    force, window = walk(n, seed), 2 * half
    bounds = sorted({0, n, *(cut for cut in cuts if cut < n)})
    pieces = [np.empty((0, 6))]
    for start, stop in pairwise(bounds):
        origin = max(start - window + 1, 0)
        pieces.append(haar_features(force[origin:stop], window)[start - origin :])
    assert np.array_equal(np.concatenate(pieces), haar_features(force, window), equal_nan=True)


@pytest.mark.parametrize("longest", [2, 14, 34, 64])
def test_a_stream_gives_the_same_bits_in_every_window(longest):
    """Also where the memory is longer than the window."""
    force, windows = walk(3 * longest), range(2, longest + 1, 2)
    specs = tuple(FeatureSpec(kind, w) for w in windows for kind in ("m", "sigma"))
    given = Sensor("one", np.zeros((1, 3)), np.eye(3)[None], np.array([0.0, 0.0, 1.0]), 100.0, "N")
    plan = StreamPlan({"f": given}, {"f": specs}, 2, Tare.parse("none"), 100.0)
    module = Tactile(given, np.arange(len(force)) / 100, force[:, None])
    found = extract(plan, Recording("made", {"f": module}))["f"].features[longest - 1 :]
    for place, window in enumerate(windows):
        expected = haar_features(force, window)[longest - 1 :, 4:]
        assert np.array_equal(found[:, 2 * place : 2 * place + 2], expected)


forces = st.builds(walk, st.integers(30, 80), st.integers(0, 99), st.sampled_from([0.01, 1, 1e4]))


@given(force=forces, seed=st.integers(0, 99))
def test_rotation_changes_the_components_only(force, seed):
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    turned, plain = haar_features(force @ turn.T), haar_features(force)
    largest = np.linalg.norm(force, axis=1).max()
    expected = np.column_stack([plain[:, 0], plain[:, 1:4] @ turn.T, plain[:, 4:]])
    assert np.nanmax(np.abs(turned - expected)) < BAR * largest


@given(force=forces, shift=st.integers(0, 20), half=st.integers(1, 7))
def test_a_later_start_changes_nothing_else(force, shift, half):
    window = 2 * half
    found = haar_features(force[shift:], window)[window - 1 :]
    assert np.array_equal(found, haar_features(force, window)[shift + window - 1 :])


@given(force=forces, k=st.integers(20, 79))
def test_the_future_changes_nothing(force, k):
    later = force.copy()
    later[k:] += 1e3
    assert np.array_equal(haar_features(later)[:k], haar_features(force)[:k], equal_nan=True)
