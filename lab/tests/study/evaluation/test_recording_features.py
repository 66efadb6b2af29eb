from dataclasses import replace

import pytest

from holdfast.contact import UNSTABLE
from holdfast.metrics.truth_labels import LabelRule
from holdfast.recordings import label_states
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.evaluation.recording_features import relabel
from study.example_recordings import recording_with_truth

RECORDING = synthetic_recording("grasp", 3, ("thumb", "index"))


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
