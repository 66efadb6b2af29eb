from dataclasses import replace

import numpy as np
import pytest

from holdfast.detection import Tare
from holdfast.io import import_recordings
from holdfast.labelling.rules import signal
from holdfast.labelling.rules.forces import evidence_of_contact, fitting_tare, lowest_maximum
from holdfast.recordings import Recording

from .build import GRIP, RELEASE, clock, grasp, module, profile


def held(level=0.0):
    """A recording that begins in contact, and ends at a share of the grip."""
    times = clock()
    force = GRIP * np.where(times > RELEASE, level, 1.0)[:, None] * [0.0, 0.0, 1.0]
    return Recording("held", {"thumb": module(times, force)})


def test_a_grasp_begins_without_contact():
    assert evidence_of_contact(grasp()) == ""
    assert fitting_tare(grasp()) == Tare.parse(0.5)


def test_a_force_far_below_its_first_value_was_a_load():
    assert "thumb" in evidence_of_contact(held())
    assert fitting_tare(held()) == Tare.parse("first")


def test_the_metadata_decide():
    assert evidence_of_contact(replace(held(), metadata={"starts_loaded": False})) == ""
    assert fitting_tare(replace(grasp(), metadata={"starts_loaded": True})) == Tare.parse("first")
    assert fitting_tare(replace(grasp(), metadata={"starts_loaded": "?"})) == Tare.parse(0.5)


def test_a_given_tare_is_kept():
    assert fitting_tare(held(), 0.2) == Tare.parse(0.2)
    with pytest.raises(ValueError, match="tare"):
        fitting_tare(held(), "soon")


@pytest.mark.parametrize("fall", [0.0, 0.02, 0.09])
def test_a_fall_by_creep_or_drift_is_no_load(fall):
    times = clock()
    force = GRIP * (profile(times) - fall * (times > RELEASE)[:, None] * [0.0, 0.0, 1.0])
    assert evidence_of_contact(Recording("creep", {"thumb": module(times, force)})) == ""


def test_a_module_without_finite_samples_shows_nothing():
    thumb = held().modules["thumb"]
    dead = replace(thumb, readings=np.full_like(thumb.readings, np.nan))
    empty = thumb.slice(0, 0)
    recording = Recording("two", {"thumb": thumb, "index": dead, "ring": empty})
    assert "thumb" in evidence_of_contact(recording)


def test_rules_choose_the_tare():
    assert signal.propose(held()) == signal.propose(held(), tare="first")
    assert signal.propose(held()) != signal.propose(held(), tare=0.5)


def test_real_recordings(data_folder):
    reasons = [evidence_of_contact(each) for each in import_recordings(data_folder / "gtac")]
    assert reasons == ["", "", ""]
    for recording in import_recordings(data_folder / "uskin_pick_move"):
        assert fitting_tare(recording) == Tare.parse("first")
    by_readings = evidence_of_contact(replace(recording, metadata={}))  # the last one has slip
    assert "finger1, finger2" in by_readings


@pytest.mark.parametrize("n", [1, 2, 7, 38, 300])
def test_the_lowest_maximum_equals_that_of_scipy(n):
    from scipy.ndimage import maximum_filter1d

    for seed in range(20):
        values = np.random.default_rng(seed).normal(size=1 + 9 * seed)
        assert lowest_maximum(values, n) == maximum_filter1d(values, n).min()
