from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import UNSTABLE
from holdfast.metrics.truth_labels import LabelRule, relabel
from holdfast.recordings import label_states
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.evaluation.recording_features import Variation
from study.example_recordings import recording_with_truth

RECORDING = synthetic_recording("grasp", 3, ("thumb", "index"))


def readings(recording, finger="thumb"):
    return np.asarray(recording.modules[finger].readings, dtype=float)


def test_the_default_changes_nothing():
    assert Variation().apply(RECORDING) is RECORDING


def test_noise_has_its_size_keeps_counts_integers_and_is_reproducible():
    added = readings(Variation(noise=4.0).apply(RECORDING)) - readings(RECORDING)
    assert added.std() == pytest.approx(np.sqrt(4.0**2 + 1 / 12), rel=0.01)
    assert abs(added.mean()) < 0.05
    assert (added == np.rint(added)).all()
    assert (added == readings(Variation(noise=4.0).apply(RECORDING)) - readings(RECORDING)).all()


def test_noise_of_two_modules_is_uncorrelated():
    changed = Variation(noise=4.0).apply(RECORDING)
    first, second = (readings(changed, f) - readings(RECORDING, f) for f in ("thumb", "index"))
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.02


def test_every_third_sample_is_a_slower_sensor():
    changed = Variation(every=3).apply(RECORDING)
    thumb = changed.modules["thumb"]
    assert (readings(changed) == readings(RECORDING)[::3]).all()
    assert (thumb.times == RECORDING.modules["thumb"].times[::3]).all()
    assert changed.rate == pytest.approx(50.0, rel=1e-3)
    assert thumb.sensor.rate == pytest.approx(RECORDING.modules["thumb"].sensor.rate / 3)


def test_a_margin_extends_disturbances_if_the_truth_is_known():
    recording = recording_with_truth("grasp", 3)
    n = {}
    for margin in (0.0, 0.1, 0.2):
        module = relabel(recording, LabelRule(margin=margin)).modules["index"]
        states = label_states(module.labels, module.times)
        shaken = (states == UNSTABLE) & (module.times > 4) & (module.times < 8)
        n[margin] = int(shaken.sum())
    assert n == pytest.approx({0.0: 180, 0.1: 210, 0.2: 240}, abs=1)
    assert relabel(RECORDING, LabelRule()) is RECORDING


def test_labels_from_the_truth_are_cut_to_a_sensor_that_starts_late():
    recording = recording_with_truth("grasp", 3)
    late = recording.modules["index"].slice(300, 900)
    modules = {**recording.modules, "index": late}
    index = relabel(replace(recording, modules=modules), LabelRule(margin=0.0)).modules["index"]
    whole = relabel(recording, LabelRule(margin=0.0)).modules["index"]
    assert index.labels[0].start == late.times[0]
    assert (index.label_states == whole.label_states[300:900]).all()
