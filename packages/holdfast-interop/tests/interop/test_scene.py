"""What Rerun shows of a recording: arrows, frames, series and events."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.detection import Model, detect
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording
from holdfast_interop.scene.hand_frames import frames_of
from holdfast_interop.scene.taxel_arrows import (
    LONGEST_ARROW,
    arrow_scale,
    module_forces,
    scene_instants,
)
from holdfast_interop.scene.tracks import series, state_codes


@pytest.fixture(scope="module")
def grasp():
    recording = synthetic_recording("grasp", 0, ("thumb", "index"))
    return replace(recording, markers=((2.5, "grasped"),))


@pytest.fixture(scope="module")
def traces(grasp):
    return detect(Model.load("builtin:noise-floor"), grasp).fingers


def pressed(force, n=100):
    """A recording of a sensor of 5 taxels; from 1 s on, the first reads `force`."""
    readings = np.full((n, 5, 3), 1000.0)
    readings[50:, 0] += force
    return Recording(
        "pressed", {"finger1": Tactile(sensor("anyskin"), np.arange(n) / 50, readings)}
    )


def arrows_of(recording):
    """The arrows of `finger1` at each instant, (n, n_taxels, 3) [m]."""
    arrows = module_forces(recording, scene_instants(recording))
    rows = [arrows["finger1"].sample_at(t, 1 / 30) for t in scene_instants(recording).tolist()]
    return arrow_scale(arrows) * arrows["finger1"].forces[rows]


def test_series_are_those_of_the_detector(grasp, traces):
    found = series(grasp, traces)
    assert list(found) == ["force", "instability", "stable_probability"]
    for finger, trace in traces.items():
        assert found["instability"][finger] == (trace.times, trace.instability)
        force = np.linalg.norm(trace.force, axis=1)
        np.testing.assert_array_equal(found["force"][finger][1], force)


def test_arrows_have_the_states_of_estimates_or_else_of_labels(grasp, traces):
    for name, module in grasp.modules.items():
        found = [state_codes(grasp, given)[name][1] for given in (traces, {})]
        for codes, expected in zip(found, (traces[name].state, module.label_states), strict=True):
            np.testing.assert_array_equal(codes, expected)


def test_an_arrow_points_along_the_reading():
    force = np.array([30.0, -40.0, 120.0])
    arrows = arrows_of(pressed(force))
    assert not arrows[10].any()
    assert not arrows[-1, 1:].any()
    along = sensor("anyskin").rotations[0] @ force / 130.0
    assert arrows[-1, 0] == pytest.approx(LONGEST_ARROW * along)


def test_frames_move_with_the_measured_tips():
    recording = pressed([0, 0, 50.0])
    times = recording.modules["finger1"].times
    pose = np.column_stack([times, 0 * times, 0 * times, 0 * times + 1, *[0 * times] * 3])
    truth = Truth(
        times, {"object_pose": pose}, {"finger1": {"tip_pose": pose, "slip_speed": 0.001 * times}}
    )
    recording = replace(recording, truth=truth)
    frames = frames_of(recording)
    assert [(frame.name, frame.parent) for frame in frames] == [
        ("module/finger1", "world"), ("object", "world"),
    ]  # fmt: skip
    assert frames[0].at(1.5)[0] == pytest.approx(1.5)
    times, speeds = series(recording, {})["true_slip_speed"]["finger1"]
    assert speeds == pytest.approx(times)  # mm/s
