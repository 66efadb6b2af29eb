"""Training samples of recordings: rows, labels, groups and contact thresholds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.contact import STABLE, ContactState
from holdfast.detection import ANY_FINGER, Tare, fingertip_force, haar_features, parse_features
from holdfast.errors import TrainingError
from holdfast.recordings import Recording
from holdfast.training import Setting
from holdfast.training.dataset_scan import scan_dataset
from holdfast.training.finger_samples import thinning_step
from holdfast.training.splits import split_data
from holdfast.training.training_samples import SamplesPlan, gather_samples

from .build import TINY, tiny_module, tiny_recording

SETTING = Setting(window=6, features=parse_features("F_a,F_x,F_y,F_z,m,sigma", 6))


def finger_samples(recordings, setting=SETTING, split="recording"):
    found = scan_dataset(recordings)
    plan = SamplesPlan(found, setting, split_data(found.recordings, split, setting.seed))
    return gather_samples(recordings, plan).stable


def test_rows_are_the_features_of_the_labelled_samples(grasps):
    """By force and Haar window of each recording alone: windows never cross a boundary."""
    own = finger_samples(grasps)["index"]
    rows, stable, groups = [], [], []
    for place, recording in enumerate(grasps):
        module = recording.modules["index"]
        force = fingertip_force(module.readings, TINY, 0.5, module.times)
        features = haar_features(force, 6)
        usable = np.isfinite(features).all(axis=1)
        rows.append(features[usable])
        stable.append((module.label_states == STABLE)[usable])
        groups += [place] * usable.sum()
    np.testing.assert_allclose(own.samples.features, np.concatenate(rows), atol=1e-9)
    assert (own.samples.positive == np.concatenate(stable)).all()
    assert own.samples.groups.tolist() == groups == own.units.tolist()
    assert len(own.samples.positive) == 6 * (400 - 50 - 5)  # tare, then one sample short


def test_unlabelled_samples_are_left_out(grasps):
    states = (ContactState.NO_CONTACT, ContactState.STABLE, None, ContactState.UNSTABLE)
    given_recordings = [grasps[0], tiny_recording(7, states=states)]
    groups = finger_samples(given_recordings)["thumb"].samples.groups
    assert np.bincount(groups).tolist() == [345, 245]


def test_held_out_samples_are_left_out(grasps):
    own = finger_samples(grasps)["thumb"]
    left = own.without({1, 4})
    assert np.unique(left.groups).tolist() == [0, 2, 3, 5]
    assert len(left.positive) == len(own.samples.positive) * 4 // 6


@given(max_samples=st.integers(1, 3000), n=st.integers(2, 4))
@settings(max_examples=20)
def test_max_samples_bounds_rows_and_thins_evenly(max_samples, n):
    given_recordings = [tiny_recording(seed) for seed in range(n)]
    whole = finger_samples(given_recordings)["thumb"].samples
    kept = finger_samples(given_recordings, replace(SETTING, max_samples=max_samples))[
        "thumb"
    ].samples
    step = max(1, -(-400 * n // max_samples))
    assert len(kept.positive) <= max_samples
    np.testing.assert_array_equal(kept.features, whole.features[::step])
    np.testing.assert_array_equal(kept.groups, whole.groups[::step])


def rest_amplitudes(recordings, finger, seconds=0.5):
    """F_a over the tare stretches, by the definition and not by the package."""
    each = []
    for recording in recordings:
        module = recording.modules[finger]
        rest = module.readings[module.times < seconds - 1e-9]
        force = (rest - rest.mean(axis=0)).sum(axis=1)  # one taxel, whose frame is the finger's
        each.append(np.linalg.norm(force, axis=1))
    return np.concatenate(each)


def test_the_contact_threshold_is_mean_and_five_deviations_of_the_tare_stretches(grasps):
    amplitude = rest_amplitudes([grasps[k] for k in (0, 2, 3)], "index")
    found = finger_samples(grasps)["index"].contact_threshold([0, 2, 3])
    assert found == pytest.approx(amplitude.mean() + 5 * amplitude.std(), rel=1e-9)


@pytest.mark.parametrize("tare", ["first", "none", "0.1:0.4"])
def test_no_contact_threshold_where_the_tare_may_be_in_contact(grasps, tare):
    own = finger_samples(grasps, replace(SETTING, tare=Tare.parse(tare)))["index"]
    assert own.contact_threshold(range(6)) is None


def test_shared_samples_pool_the_fingers(grasps):
    apart = finger_samples(grasps)
    shared = finger_samples(grasps, replace(SETTING, shared=True))
    assert set(shared) == {ANY_FINGER}
    own = shared[ANY_FINGER]
    assert len(own.samples.positive) == sum(len(each.samples.positive) for each in apart.values())
    amplitude = np.concatenate([rest_amplitudes(grasps, f) for f in ("thumb", "index")])
    expected = amplitude.mean() + 5 * amplitude.std()
    assert own.contact_threshold(range(6)) == pytest.approx(expected, rel=1e-9)


def test_shared_samples_need_one_sensor():
    other = replace(TINY, name="other")
    modules = {"thumb": tiny_module(0), "palm": tiny_module(1, sensor=other)}
    with pytest.raises(TrainingError, match=r"thumb \(tiny\), palm \(other\)"):
        finger_samples([Recording("both", modules)], replace(SETTING, shared=True), split="random")


def test_recordings_at_another_rate_are_resampled(grasps):
    fast = tiny_recording(8, n=1200, rate=300.0)
    near = tiny_recording(9, n=440, rate=110.0)
    groups = finger_samples([*grasps, fast, near])["thumb"].samples.groups
    n = np.bincount(groups)
    assert n[6] == pytest.approx(345, abs=2)  # four seconds at 100 Hz as well
    assert n[7] == 440 - 55 - 5  # within 20 %: as it is


def test_recordings_may_lack_fingers_labels_or_finite_samples(grasps):
    """Missing, empty and dead fingers and unlabelled recordings add no samples."""
    whole = finger_samples(grasps)
    thumb_only = tiny_recording(10, fingers=("thumb",))
    dead = tiny_module(1)
    dead = replace(dead, readings=np.full_like(dead.readings, np.nan))
    half_dead = Recording("half dead", {"thumb": tiny_module(11), "index": dead})
    bare = tiny_recording(12, fingers=("ring",), states=[None] * 4)
    found = finger_samples([*grasps, thumb_only, half_dead, bare])
    assert len(found["index"].samples.positive) == len(whole["index"].samples.positive)
    assert len(found["thumb"].samples.positive) == len(whole["thumb"].samples.positive) + 2 * 345
    assert set(found) == {"thumb", "index"}
    expected = whole["index"].contact_threshold(range(6))
    assert found["index"].contact_threshold(range(9)) == pytest.approx(expected)


def test_a_module_without_samples(grasps):
    nothing = replace(tiny_module(0), times=[], readings=np.empty((0, 1, 3)), labels=())
    hollow = Recording("hollow", {"thumb": tiny_module(13), "index": nothing})
    found = finger_samples([*grasps, hollow])
    assert np.bincount(found["thumb"].samples.groups, minlength=7)[6] == 345
    assert np.bincount(found["index"].samples.groups, minlength=7)[6] == 0


@given(st.integers(0, 200), st.integers(1, 50))
def test_the_thinning_step_is_the_smallest_that_keeps_the_limit(n, n_max):
    step = thinning_step(n, n_max)
    assert len(range(0, n, step)) <= n_max
    assert step == 1 or len(range(0, n, step - 1)) > n_max
