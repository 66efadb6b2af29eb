import re
from dataclasses import replace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from holdfast.contact import STABLE, Cause
from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.labelling.rules import signal
from holdfast.recordings import Recording, label_states

from .build import (
    CLOSING,
    FREE,
    GRIP,
    NOISE,
    PATCH,
    PUSH,
    PUSHED,
    RELEASE,
    check,
    clock,
    drawn,
    grasp,
    module,
    profile,
)

EDGE = 0.2  # the window that changes are seen in, and a little for noise


def test_a_grasp_is_labelled_as_by_a_person():
    for labels in signal.propose(grasp()).values():
        check(labels, EDGE)
        causes = [label.cause for label in labels]
        expected = [None, Cause.CLOSING, None, Cause.DISTURBANCE, None, Cause.RELEASED, None]
        assert causes == expected


def test_labels_have_author_and_evidence():
    labels = signal.propose(grasp())["thumb"]
    assert {label.author for label in labels} == {"rule:signal"}
    assert all(re.search(r"force.* [\d.]+ times|[\d.]+ times", x.evidence) for x in labels)
    assert all(0 < label.confidence < 1 for label in labels)


def pushed(pushes):
    """A hand of which each finger feels its own push."""
    times = clock()
    modules = {
        name: module(times, GRIP * profile(times, push), seed)
        for seed, (name, push) in enumerate(zip(("thumb", "index", "ring"), pushes, strict=False))
    }
    return signal.propose(Recording("push", modules))


def of_thumb(force, times=None):
    """Labels of a finger with that force over the grip force."""
    thumb = module(clock() if times is None else times, GRIP * force)
    return signal.propose(Recording("made", {"thumb": thumb}))["thumb"]


@given(start=st.floats(-1e3, 1e9))
@settings(max_examples=5)
def test_another_start_of_the_clock_moves_the_labels(start):
    here = drawn(signal.propose(grasp())["thumb"])
    there = drawn(signal.propose(grasp(start))["thumb"])
    assert [state for state, *_ in there] == [state for state, *_ in here]
    moved = np.array([row[1:] for row in there]) - start
    assert moved == pytest.approx(np.array([row[1:] for row in here]), abs=0.011)


@given(power=st.integers(-8, 8))
@settings(max_examples=5)
def test_another_unit_of_force_changes_nothing(power):
    here = drawn(signal.propose(grasp())["thumb"])
    assert drawn(signal.propose(grasp(scale=2.0**power))["thumb"]) == here


def test_a_disturbance_of_two_fingers_applies_to_all_one_of_a_finger_to_it_alone():
    times = clock()
    codes = label_states(pushed((0.2, 0.2, 0.0))["ring"], times)
    assert (codes[(times > PUSH) & (times < PUSHED)] == 2).mean() > 0.9
    labels = pushed((0.2, 0.0))
    check(labels["thumb"], EDGE)
    assert Cause.DISTURBANCE not in [label.cause for label in labels["index"]]


def test_a_grasp_that_never_settles_is_closing_to_its_end():
    times = clock()
    wobble = 0.3 * np.sin(2 * np.pi * times) * (times > CLOSING) * (times < FREE)
    labels = of_thumb(profile(times, 0.0) + wobble[:, None] * [1, 0, 0])
    assert "STABLE" not in [label.state.value for label in labels]


def test_a_sudden_end_of_the_force_is_a_loss():
    times = clock()
    labels = of_thumb(profile(times, 0.0) * (times < RELEASE - 1)[:, None])
    assert labels[-2].cause is Cause.LOST
    assert abs(labels[-1].start - (RELEASE - 1)) < EDGE


def test_a_recording_that_begins_in_contact_is_held_until_the_force_drops_for_good():
    times = clock()
    held = GRIP * (1 + 0.2 * (profile(times) - profile(times, 0.0)))
    held[times > RELEASE] = 0
    labels = signal.propose(Recording("held", {"thumb": module(times, held)}), tare="first")
    (*_, last) = labels["thumb"]
    assert labels["thumb"][0].state == "STABLE"
    assert (last.state, last.cause) == ("NO_CONTACT", Cause.LOST)
    assert abs(last.start - RELEASE) < EDGE


@pytest.mark.parametrize("kind", ["gap", "nan"])
def test_a_gap_has_no_label(kind):
    (thumb,) = grasp(fingers=("thumb",)).modules.values()
    lost = (thumb.times > 4.0) & (thumb.times < 5.0)
    if kind == "gap":
        thumb = replace(thumb, times=thumb.times[~lost], readings=thumb.readings[~lost])
    else:
        thumb = replace(thumb, readings=np.where(lost[:, None, None], np.nan, thumb.readings))
    labels = signal.propose(Recording("gap", {"thumb": thumb}))["thumb"]
    assert (label_states(labels, np.linspace(4.05, 4.95, 50)) == 0).all()
    assert (label_states(labels, np.array([3.5, 5.5])) == 3).all()


def test_a_dead_finger_has_no_labels_and_does_not_affect_others():
    recording = grasp()
    dead = replace(
        recording.modules["index"],
        readings=np.full_like(recording.modules["index"].readings, np.nan),
    )
    labels = signal.propose(Recording("dead", {**recording.modules, "index": dead}))
    assert set(labels) == {"thumb"}
    check(labels["thumb"], EDGE)


def test_no_sample_for_the_tare():
    recording = grasp(fingers=("thumb",))
    with pytest.raises(RecordingError, match="20:21"):
        signal.propose(recording, tare=(20, 21))


def with_dead_band(recording, limit):
    """The same recording from a device that sends whole numbers, and 0 below a limit."""
    modules = {}
    for name, each in recording.modules.items():
        readings = np.rint(each.readings - 1000)
        readings[np.abs(readings) < limit] = 0
        modules[name] = replace(each, readings=readings.astype(np.int32))
    return Recording(recording.name, modules)


def test_a_tare_stretch_without_any_noise():
    recording = with_dead_band(grasp(), 5 * NOISE)
    assert not recording.modules["thumb"].readings[:100].any()
    for labels in signal.propose(recording).values():
        check(labels, EDGE)
        assert all(0 < label.confidence < 1 for label in labels)


def test_noise_that_a_dead_band_hides_in_the_tare_is_no_disturbance():
    times = clock()
    loaded = np.linalg.norm(profile(times), axis=1)[:, None, None] > 0.01
    noise = np.random.default_rng(2).normal(0, 0.02 * GRIP / PATCH.n_taxels, (len(times), 1, 3))
    noisy = grasp(fingers=("thumb",))
    (thumb,) = noisy.modules.values()
    shaken = replace(thumb, readings=thumb.readings + loaded * noise)
    recording = with_dead_band(Recording("noisy", {"thumb": shaken}), 5 * NOISE)
    check(signal.propose(recording)["thumb"], EDGE)


def test_readings_that_never_change_are_no_contact_without_evidence():
    readings = np.full((300, 16, 3), 1000)
    still = replace(module(clock()[:300], np.zeros((300, 3))), readings=readings)
    (label,) = signal.propose(Recording("still", {"thumb": still}))["thumb"]
    assert (label.state, label.confidence) == ("NO_CONTACT", 0.5)


def test_real_recordings_with_a_constant_tare_stretch(data_folder):
    for recording in import_recordings(data_folder / "gtac"):
        labels = signal.propose(recording)["finger1"]
        assert labels[0].state == "NO_CONTACT"
        assert all(0 < label.confidence < 1 for label in labels)
        if recording.name.startswith("egg"):  # held still from 2 to 14 s
            assert (label_states(labels, np.linspace(4.2, 13.8, 50)) == STABLE).all()
