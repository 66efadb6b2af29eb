"""Training with relative features: one model from other sensors, units and rates."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.detection import ANY_FINGER, Debounce, Tare, parse_features
from holdfast.errors import TrainingError
from holdfast.sensors import sensor
from holdfast.training import Setting, train
from holdfast.training.dataset_scan import scan_dataset
from holdfast.training.model_fit import fit_recordings
from holdfast.training.splits import split_data
from holdfast.training.training_samples import SamplesPlan, gather_samples

from .build import TINY, tiny_recording

ANY = parse_features("any")
SETTING = Setting(features=ANY, trials=0, hold=0.1)
NEWTONS = replace(TINY, name="other", unit="N", rate=60.0)


@pytest.fixture(scope="module")
def mixed():
    """A slow sensor in newtons, a fast one, and a flat patch of 16 taxels in counts."""
    patch = replace(sensor("uskin-4x4"), range=None)
    return [
        tiny_recording(1, sensor=NEWTONS, rate=60.0, n=600),
        tiny_recording(2, rate=300.0, n=3000),
        tiny_recording(3, fingers=("gripper/1",), sensor=patch, rate=100.0, n=1000),
    ]


def samples_of(recordings, setting=SETTING):
    scan = scan_dataset(recordings, relative=True)
    plan = SamplesPlan(scan, setting, split_data(scan.recordings, "time", 0))
    return gather_samples(recordings, plan).stable


def test_the_model_is_for_any_sensor_rate_and_finger(mixed):
    model = train(mixed, SETTING).model
    assert (model.rate, model.sensors, model.tare) == (None, {}, "first")
    assert list(model.fingers) == [ANY_FINGER]
    part = model.fingers[ANY_FINGER]
    assert (part.sensor, part.contact_threshold, part.contact_load) == (None, None, 10.0)
    assert model.debounce == Debounce(hold=0.1)


@pytest.mark.parametrize("is_first", [True, False])
def test_a_sensor_of_one_taxel_leaves_out_what_compares_taxels(mixed, is_first):
    """It need not be the first sensor of its finger."""
    single = tiny_recording(4, fingers=("gripper/1",))
    recordings = [single, mixed[2]] if is_first else [mixed[2], single]
    warnings = []
    model = train(recordings, SETTING, warn=warnings.append).model
    kept = model.fingers[ANY_FINGER].features
    assert {spec.kind for spec in kept} == {"force_change", "shear_change", "load_to_noise"}
    (text,) = [text for text in warnings if "taxel" in text]
    assert text.startswith("residual, shear_residual, pressure_shift, moment_change left out")


def test_options_that_are_given_count(mixed):
    setting = replace(SETTING, tare=Tare.parse("none"), shared=False)
    model = fit_recordings(mixed, setting, {"C": 1.0, "class_weight": None})
    assert (set(model.fingers), model.tare) == ({"thumb", "index", "gripper/1"}, "none")
    assert {part.contact_threshold for part in model.fingers.values()} == {None}


def test_every_recording_keeps_its_rate_and_counts_alike(mixed):
    own = samples_of(mixed)[ANY_FINGER]
    seconds = [np.ptp(own.times[own.recordings == place]) for place in range(3)]
    assert seconds == pytest.approx([7.5, 7.5, 7.5], abs=0.2)  # without the empty hand
    counts = np.bincount(own.recordings) / (2, 2, 1)
    assert counts == pytest.approx([150, 150, 150], abs=3)


def test_samples_without_contact_are_left_to_the_load(mixed):
    states = [ContactState.NO_CONTACT, ContactState.STABLE, None, ContactState.UNSTABLE]
    only = samples_of([tiny_recording(4, states=states, n=400)])[ANY_FINGER]
    assert only.times.min() == pytest.approx(1.0, abs=0.06)
    assert 0.4 < only.samples.positive.mean() < 0.6


def test_units_and_gains_do_not_change_the_samples():
    """The same motion in newtons and in counts gives the same features."""
    counts = tiny_recording(5)
    scaled = {
        name: replace(m, sensor=replace(TINY, unit="N"), unit="N", readings=m.readings / 100)
        for name, m in counts.modules.items()
    }
    newtons = replace(counts, modules=scaled)
    first, second = (samples_of([each])[ANY_FINGER].samples.features for each in (counts, newtons))
    assert second == pytest.approx(first, abs=1e-6)


@pytest.mark.parametrize("rate", [20.0, 1100.0])
def test_a_rate_that_the_features_are_not_made_for(mixed, rate):
    odd = tiny_recording(6, rate=rate, n=round(10 * rate))
    with pytest.raises(TrainingError, match=f"'grasp-6' has {rate:g} Hz"):
        scan_dataset([*mixed, odd], relative=True)


def test_a_recording_without_labels_may_have_any_rate(mixed):
    bare = tiny_recording(7, rate=5.0, n=50, states=[None] * 4)
    assert len(scan_dataset([*mixed, bare], relative=True).recordings) == 4
