"""What counts as own handling, and its location and scale."""

import math
from dataclasses import replace

import numpy as np
import pytest

from detection.detector.build import sensor
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.errors import TrainingError
from holdfast.recordings import Label, Recording, Tactile
from holdfast.training.own_handling import (
    EDGE_SECONDS,
    MAX_HANDLING,
    MIN_SCALE,
    HandlingKey,
    OwnHandling,
    check_shear,
    grasped_samples,
    location_and_scale,
)
from training.build import PAD, handling_module, handling_recording, normalised_model

PAD_KEY = HandlingKey("*", "pad")


def codes(*runs):
    return np.repeat([code for code, _ in runs], [n for _, n in runs]).astype(np.int8)


def held_runs(*runs):
    states = codes(*runs)
    held = grasped_samples(np.arange(len(states)) / 100, states)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], held, [0]])))
    return edges.reshape(-1, 2).tolist()


def test_closing_and_opening_are_not_holding():
    runs = ((NO_CONTACT, 100), (UNSTABLE, 100), (STABLE, 300), (NO_CONTACT, 100))
    assert held_runs(*runs) == [[150, 450]]


def test_of_a_short_touch_the_middle_half_counts():
    assert held_runs((NO_CONTACT, 50), (STABLE, 60), (NO_CONTACT, 50)) == [[65, 95]]
    assert held_runs((NO_CONTACT, 50), (STABLE, 24), (NO_CONTACT, 50)) == []


def test_what_begins_or_ends_in_contact_is_held_there():
    assert held_runs((STABLE, 50)) == [[0, 50]]
    assert held_runs((UNKNOWN, 5), (STABLE, 45), (UNKNOWN, 50), (UNSTABLE, 60)) == [
        [5, 50], [100, 160]
    ]  # fmt: skip


def test_location_and_scale_of_normal_values():
    values = np.random.default_rng(0).normal([3.0, -2.0], [2.0, 0.7], size=(100_000, 2))
    location, scale = location_and_scale(values)
    assert location == pytest.approx([3.0, -2.0], abs=0.02)
    assert scale == pytest.approx([2.0, 0.7], rel=0.01)


@pytest.mark.parametrize("jump", [4.0, 10.0, 1000.0])
def test_a_tenth_of_slip_changes_them_little(jump):
    rng = np.random.default_rng(1)
    clean = rng.normal(size=(9000, 1))
    mixed = np.concatenate([clean, jump + rng.normal(size=(1000, 1))])
    location, scale = location_and_scale(mixed)
    assert 0 < location[0] < 0.3
    assert 1 < scale[0] < 1.4
    assert mixed.mean() - clean.mean() > 0.39
    assert mixed.std() > 1.5


def test_a_feature_that_does_not_change_has_the_least_scale():
    location, scale = location_and_scale(np.full((50, 2), 1.5))
    assert (location.tolist(), scale.tolist()) == ([1.5, 1.5], [MIN_SCALE, MIN_SCALE])


@pytest.mark.parametrize(("stretch", "shift"), [(4.0, 7.0), (0.5, -3.0)])
def test_they_stretch_and_shift_with_the_values(stretch, shift):
    values = 3 * np.random.default_rng(2).standard_t(3, size=(5000, 3))
    location, scale = location_and_scale(values)
    moved, stretched = location_and_scale(shift + stretch * values)
    assert moved == pytest.approx(shift + stretch * location, rel=1e-6)
    assert stretched == pytest.approx(stretch * scale, rel=1e-6)


def handling_of(*recordings):
    handling = OwnHandling(normalised_model())
    for recording in recordings:
        handling.add(recording)
    return handling


def test_the_held_time_is_that_of_each_finger():
    handling = handling_of(
        handling_recording(0, held=6.0), handling_recording(1, ("thumb",), held=4.0)
    )
    assert handling.fingers(PAD_KEY) == pytest.approx({"thumb": 11.4, "index": 6.6}, abs=0.7)
    assert handling.seconds(PAD_KEY) == handling.fingers(PAD_KEY)["thumb"]
    n, edges = len(handling.features(PAD_KEY)), 3 * 2 * EDGE_SECONDS
    assert n == pytest.approx(100 * (sum(handling.fingers(PAD_KEY).values()) - edges), abs=9)
    assert np.isfinite(handling.features(PAD_KEY)).all()


def test_the_change_of_the_load_shows_how_the_arm_moves():
    still, moving = (handling_of(handling_recording(0, sway=sway)) for sway in (0.0, 0.2))
    assert still.load_change(PAD_KEY) < 0.01
    assert moving.load_change(PAD_KEY) > 0.2


def test_the_change_of_a_load_that_is_not_known_is_not_known():
    in_newtons, in_counts = (
        replace(
            handling_recording(0, sway=0.2, sensor=replace(PAD, unit=unit)),
            metadata={"starts_loaded": True},
        )
        for unit in ("N", "count")
    )
    assert handling_of(in_newtons).load_change(PAD_KEY) > 0.2
    assert math.isnan(handling_of(in_counts).load_change(PAD_KEY))


def labelled(cause, *spans):
    """Handling that is held from 1.3 to 13.3 s by two fingers; one has labels of a cause."""
    labels = [Label(*span, "UNSTABLE", cause) for span in spans]
    return handling_recording(0, held=12.0).with_labels({"index": labels})


@pytest.mark.parametrize(
    ("cause", "span"),
    [
        ("slip", (5.0, 5.2)),  # 0.2 of 24 s
        ("slip", (0.0, 0.9)),  # the hand is open
        ("disturbance", (2.0, 9.0)),
        (None, (2.0, 9.0)),
    ],
)
def test_labels_of_what_holds_are_handling(cause, span):
    handling = handling_of(labelled(cause, span))
    handling.check()
    plain = handling_of(labelled(cause))
    np.testing.assert_array_equal(handling.features(PAD_KEY), plain.features(PAD_KEY))


def test_labels_of_slip_refuse_it():
    named = "index 5.00 to 5.20 s of handling-0, index 6.00 to 6.20 s of handling-0"
    with pytest.raises(TrainingError, match=f"1.6 % .* at most 1 % expected: {named};"):
        handling_of(labelled("slip", (5.0, 5.2), (6.0, 6.2))).check()
    many = [(start, start + 0.2) for start in (4.0, 5.0, 6.0, 7.0)]
    with pytest.raises(TrainingError, match=r"6.00 to 6.20 s of handling-0, \.\.\.;"):
        handling_of(labelled("slip", *many)).check()


def test_sensors_are_kept_apart():
    other = handling_module(3, sensor=sensor(9, "other", unit="N", limits=None))
    thumb = handling_module(4)
    handling = handling_of(Recording("two", {"thumb": thumb, "index": other}))
    assert set(handling.samples) == {PAD_KEY, HandlingKey("*", "other")}


def test_there_is_enough_at_some_time(monkeypatch):
    monkeypatch.setattr("holdfast.training.own_handling.MAX_HANDLING", 10.0)
    assert MAX_HANDLING > 60
    handling = handling_of(*(handling_recording(k) for k in range(3)))
    assert list(handling.digests) == ["handling-0"]
    assert handling.n_left_out == 2


def test_an_empty_hand_is_refused():
    handling = handling_of(handling_recording(0, force=0.0))
    with pytest.raises(TrainingError, match="nothing is held"):
        handling.check()


def test_too_little_is_refused():
    handling = handling_of(handling_recording(0, held=3.0))
    with pytest.raises(TrainingError, match="of holding"):
        handling.check()


def test_faults_are_refused():
    module = handling_module(0)
    readings = np.array(module.readings)
    readings[400:700, :, 0] = np.nan
    broken = Recording("broken", {"thumb": Tactile(PAD, module.times, readings)})
    with pytest.raises(TrainingError, match=r"thumb: .*not_finite"):
        handling_of(broken).check()


@pytest.mark.parametrize(("axes", "refused"), [((0, 1), True), ((0,), False), ((0, 1, 2), False)])
def test_a_sensor_of_normal_force_is_refused_by_name(axes, refused):
    made = handling_recording(1)
    modules = {}
    for name, module in made.modules.items():
        readings = module.readings.copy()
        readings[..., list(axes)] = 100
        modules[name] = replace(module, readings=readings)
    made = replace(made, modules=modules)
    if refused:
        with pytest.raises(TrainingError, match="normal force alone of pad in "):
            check_shear(made)
    else:
        check_shear(made)
