"""A long recording is labelled by its forces; here every recording is long."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.detection.features import tared_force
from holdfast.io import load_recording, save_recording
from holdfast.labelling.server import long_recordings, workspace
from holdfast.labelling.server.long_recordings import load_for_labelling, without_force
from holdfast.labelling.server.signals import SERIES
from holdfast.recordings import Label, Recording
from holdfast.synthetic import synthetic_recording

FINGERS = ("thumb", "index")


@pytest.fixture
def path(tmp_path, monkeypatch):
    made = synthetic_recording("grasp", 3, FINGERS)
    path = tmp_path / "grasp.parquet"
    save_recording(replace(made, markers=((1.0, "closed"),)), path)
    monkeypatch.setattr(long_recordings, "MAX_READINGS", 0)
    return path


def opened(path, tare=None):
    return workspace.Workspace([path], author="me", clock=lambda: "2026-01-01T00:00:00Z", tare=tare)


def test_it_has_the_forces_and_all_else_of_the_recording(path):
    whole, (long, has_readings) = load_recording(path), load_for_labelling(path)
    assert not has_readings
    for name, module in whole.modules.items():
        own = long.modules[name]
        assert own.readings.shape == (module.n_samples, 1, 3)
        np.testing.assert_array_equal(own.times, module.times)
        assert own.labels == module.labels
        for tare in (0.5, "first", "none", (1.0, 1.5)):
            ours, theirs = (tared_force(one, tare).force for one in (own, module))
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-6)
    assert (long.name, long.digest, long.markers) == (whole.name, whole.digest, whole.markers)
    assert (long.start, long.end, long.metadata) == (whole.start, whole.end, whole.metadata)


def test_a_short_recording_has_its_readings(path, monkeypatch):
    monkeypatch.undo()
    recording, has_readings = load_for_labelling(path)
    assert has_readings
    assert recording.digest == load_recording(path).digest
    assert recording.modules["thumb"].readings.shape[1:] == (30, 3)


def test_a_reading_that_is_not_finite_has_no_force(path):
    whole = load_recording(path)
    readings = whole.modules["thumb"].readings.astype(float)
    readings[[10, 200], 5, 1] = np.nan, np.inf
    modules = {**whole.modules, "thumb": replace(whole.modules["thumb"], readings=readings)}
    save_recording(Recording("grasp", modules), path, force=True)
    force = load_for_labelling(path)[0].modules["thumb"].readings[:, 0]
    assert np.flatnonzero(np.isnan(force).all(axis=1)).tolist() == [10, 200]
    assert np.isfinite(np.delete(force, [10, 200], axis=0)).all()


def test_the_page_is_that_of_all_readings(path, monkeypatch):
    long = opened(path)
    shown = long.signals(0).part(0.0, 5.0, 1000)
    changes = long.changes(0)
    proposed = long.propose(0, "signal", {})
    monkeypatch.undo()
    short = opened(path)
    assert long.open(0).tare == short.open(0).tare
    for finger, series in short.signals(0).part(0.0, 5.0, 1000).fingers.items():
        assert shown.fingers[finger]["t"] == series["t"]
        for name in SERIES:
            ours, theirs = (np.array(one[name], float) for one in (shown.fingers[finger], series))
            np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=1e-5)
    assert changes == short.changes(0)
    assert proposed == short.propose(0, "signal", {})


def test_labels_are_saved_for_the_recording_of_the_file(path):
    space = opened(path)
    space.signals(0)  # from here on without forces
    assert np.isnan(space.open(0).recording.modules["thumb"].readings).all()
    label = Label(1.0, 2.0, ContactState.STABLE)
    space.save(0, {"thumb": [label]}, revision=space.stored(0).revision, author="", note="")
    assert [one.start for one in load_recording(path).modules["thumb"].labels] == [1.0]
    assert space.stored(0).origin == "file"


def test_a_finger_that_cannot_be_plotted_is_an_error_each_time(path):
    whole = load_recording(path)
    last = list(whole.modules)[-1]
    readings = whole.modules[last].readings.astype(float)
    readings[100:200] = np.nan
    modules = {**whole.modules, last: replace(whole.modules[last], readings=readings)}
    save_recording(Recording("grasp", modules), path, force=True)
    space = opened(path, tare=(0.8, 1.0))
    for _ in range(2):
        with pytest.raises(ValueError, match="no finite sample"):
            space.signals(0)


def test_without_its_force_a_finger_needs_no_memory_for_it(path):
    recording, _ = load_for_labelling(path)
    empty = without_force(recording, "thumb")
    assert empty.digest == recording.digest
    assert empty.modules["thumb"].readings.strides == (0, 0, 0)
    np.testing.assert_array_equal(empty.modules["thumb"].times, recording.modules["thumb"].times)
