"""Requirements on every method."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.detection import Tare
from holdfast.errors import MissingExtra
from holdfast.recordings import Recording
from holdfast.synthetic import synthetic_recording
from holdfast.training.classifiers import Samples
from holdfast_lab.study.methods import HAND, METHODS, hand_signal

pytestmark = pytest.mark.slow

TARE = Tare.parse(0.5)
N_TARE = 75
"""Samples in the tare interval."""
N_FULL = 160
"""Samples that fill the longest window."""
FINGERS = ("thumb", "index")


@pytest.fixture(scope="module")
def recordings():
    """Grasps of sensors whose common readings, which these tests change, are no field."""

    def without_field(module):
        return replace(module, sensor=replace(module.sensor, magnetic=False))

    made = (synthetic_recording(f"grasp {seed}", seed, FINGERS) for seed in range(3))
    return [map_modules(recording, without_field) for recording in made]


@pytest.fixture(params=sorted(METHODS))
def method(request):
    return METHODS[request.param]


def features_of(method, recording):
    return method.features(hand_signal(recording, TARE, FINGERS))


def map_modules(recording, change):
    """Return the recording with every module changed."""
    modules = {name: change(module) for name, module in recording.modules.items()}
    return Recording(recording.name, modules, recording.metadata)


def with_other_readings(recording, rows):
    """Return the recording with the readings of some samples shuffled and shifted."""

    def change(module):
        readings = module.readings.astype(float)
        readings[rows] = readings[rows][::-1] * 0.9 + 40
        return replace(module, readings=readings)

    return map_modules(recording, change)


def without_samples(recording, rows):
    def change(module):
        kept = np.delete(np.arange(module.n_samples), rows)
        return replace(module, times=module.times[kept], readings=module.readings[kept], labels=())

    return map_modules(recording, change)


def same(one, two, rows):
    return all(np.allclose(one[k][rows], two[k][rows], equal_nan=True) for k in one)


def test_the_name_of_a_method_is_its_key(method):
    assert METHODS[method.name] is method
    assert method.title
    assert method.source


def test_one_row_for_each_sample(method, recordings):
    found = features_of(method, recordings[0])
    assert set(found) == ({HAND} if method.whole_hand else set(FINGERS))
    n_samples = recordings[0].modules["thumb"].n_samples
    shapes = {rows.shape for rows in found.values()}
    assert len(shapes) == 1
    assert shapes.pop()[0] == n_samples


def test_features_exist_once_the_tare_is_complete_and_windows_are_full(method, recordings):
    for rows in features_of(method, recordings[0]).values():
        assert np.isnan(rows[:N_TARE]).any(axis=1).all()
        known = np.isfinite(rows).all(axis=1)
        assert known[N_TARE + N_FULL :].all()
        assert (np.diff(known.astype(int)) >= 0).all()


def test_features_are_causal(method, recordings):
    k = 700
    other = with_other_readings(recordings[0], slice(k, None))
    one, two = features_of(method, recordings[0]), features_of(method, other)
    assert same(one, two, slice(0, k))
    assert not same(one, two, slice(k, None))


@pytest.mark.parametrize(
    ("name", "alone"),
    [("finger_logreg", True), ("finger_svm", True), ("logreg", True), ("holdfast", False)],
)
def test_one_finger_alone_sees_no_other(name, alone, recordings):
    modules = dict(recordings[0].modules)
    modules["index"] = with_other_readings(recordings[0], slice(N_TARE, None)).modules["index"]
    other = Recording("other", modules, recordings[0].metadata)
    one, two = (features_of(METHODS[name], grasp)["thumb"] for grasp in (recordings[0], other))
    assert np.allclose(one, two, equal_nan=True) == alone


def test_features_restart_after_a_gap(method, recordings):
    """After a gap, features depend on no sample before it but those of the tare."""
    gap = slice(600, 610)
    broken = without_samples(recordings[0], gap)
    one = features_of(method, broken)
    two = features_of(method, with_other_readings(broken, slice(N_TARE, gap.start)))
    assert not same(one, two, slice(N_TARE, gap.start))
    assert same(one, two, slice(gap.start, None))
    for rows in one.values():
        assert np.isfinite(rows[gap.start + N_FULL :]).all()


def test_a_recording_without_a_stretch_has_the_same_number_of_features(method, recordings):
    short = map_modules(recordings[0], lambda module: module.slice(0, N_TARE - 5))
    found = features_of(method, recordings[0])
    for key, rows in features_of(method, short).items():
        assert rows.shape == (N_TARE - 5, found[key].shape[1])
        assert np.isnan(rows).any(axis=1).all()


def test_the_classifier_is_fitted_and_gives_probabilities(method, recordings):
    key = HAND if method.whole_hand else "index"
    rows, stable, groups = [], [], []
    for group, recording in enumerate(recordings):
        found = features_of(method, recording)[key]
        states = recording.modules["thumb"].label_states
        known = np.flatnonzero(np.isfinite(found).all(axis=1) & (states > 0))[::5]
        rows.append(found[known])
        stable.append(states[known] == ContactState.STABLE.code)
        groups.append(np.full(len(known), group))
    samples = Samples(np.concatenate(rows), np.concatenate(stable), np.concatenate(groups))
    try:
        fitted = method.recipe.fit(samples, method.reference, 0)
    except MissingExtra as missing:
        pytest.skip(str(missing))
    probability = fitted.probability(samples.features)
    assert fitted.n_features == samples.features.shape[1]
    assert ((probability >= 0) & (probability <= 1)).all()
    assert 0 <= fitted.threshold <= 1
    assert np.isnan(fitted.probability(np.full((1, fitted.n_features), np.nan))).all()
    called = probability >= fitted.threshold
    right = (called[samples.positive].mean() + (~called[~samples.positive]).mean()) / 2
    assert right > 0.5 or method.name == "always_stable"
