import math
from dataclasses import replace

import numpy as np
import pytest

from holdfast import Model
from holdfast.devices.sources import Arrival
from holdfast.live.readings_monitor import MISSING_AXES, PULLED, HoldDrift, ReadingsMonitor
from holdfast.live.stream_detector import StreamDetector
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording

from . import build

PATCH = sensor("uskin-4x4")
TIMES = np.arange(0, 12, 0.01)


def grasp(noise=2.0):
    """Readings (n, 16, 3) that are pressed from 2 to 9 s."""
    press = np.interp(TIMES, [2, 2.5, 9, 9.3], [0, 300, 300, 0])
    force = np.stack([0.1 * press, 0.05 * press, press], axis=1)
    return 1000 + force[:, None] + np.random.default_rng(0).normal(0, noise, (len(TIMES), 16, 3))


def notices(readings, times=TIMES, **options):
    monitor = ReadingsMonitor({"index": PATCH}, **options)
    return [
        (notice, time)
        for sample, time in zip(readings, times, strict=True)
        for notice in monitor.update({"index": sample}, time)
    ]


def half_missing():
    readings = grasp()
    readings[::2] = np.nan
    return readings


@pytest.mark.parametrize(
    "readings", [grasp(), np.rint(grasp(0.0)), half_missing()], ids=["noisy", "dead band", "NaN"]
)
def test_a_grasp_gives_no_notice(readings):
    assert notices(readings) == []


def test_what_never_changes():
    readings = grasp()
    readings[:, :, :2] = 1000
    ((text, time),) = notices(readings)
    assert text == "index: " + MISSING_AXES.format("x and y")
    assert time < 3
    assert notices(np.full((len(TIMES), 16, 3), 1000)) == []  # the fault `dead`


@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_z_that_points_inwards(noise):
    ((text, time),) = notices(grasp(noise) * [1, -1, -1])
    assert text == f"index: {PULLED}"
    assert 2 < time < 3


def test_a_grip_at_the_start_that_ends():
    ((text, time),) = notices(grasp()[400:], TIMES[400:])
    assert text == f"index: {PULLED}"
    assert 9 < time < 10
    assert notices(grasp()[400:], TIMES[400:], finds_pull=False) == []


def test_a_long_hold_that_drifts():
    times = np.arange(0, 80, 0.05)
    force = np.interp(times, [2, 3], [0, 300]) + 0.5 * times
    readings = force[:, None, None] * [0, 0, 1] + np.random.default_rng(0).normal(
        0, 2, (len(times), 16, 3)
    )
    ((text, time),) = notices(readings, times)
    assert text.startswith("index: the force of this hold drifts by ")
    assert time > 60


def parts_of(readings, *names):
    module = Tactile(PATCH, TIMES, readings)
    return [
        Recording("part", dict.fromkeys(names, module.slice(k, k + 300)))
        for k in range(0, 1200, 300)
    ]


def test_a_recording_in_parts_gives_the_same():
    monitor = ReadingsMonitor({"index": PATCH, "thumb": PATCH})
    parts = parts_of(grasp() * [1, -1, -1], "index")
    found = [notice for part in parts for notice in monitor.update_recording(part)]
    assert found == [f"index: {PULLED}"]


@pytest.mark.parametrize(
    ("name", "expected"), [("builtin:any", 1), ("builtin:noise-floor", 0)], ids=["first", "seconds"]
)
def test_the_live_detector_passes_notices_on(name, expected):
    recording = synthetic_recording("grasp", seed=0)
    thumb = recording.modules["thumb"]
    turned = replace(thumb, readings=-thumb.readings)
    detector = StreamDetector(Model.load(name), build.Script({"thumb": thumb.sensor}))
    passed = []
    for time, sample in zip(turned.times.tolist(), turned.readings, strict=True):
        arrival = Arrival(time=time, samples={"thumb": sample}, received=time)
        passed += detector.update(arrival).arrival.notices
    assert passed == [f"thumb: {PULLED}"] * expected


def drift_of(amplitude, times):
    drift = HoldDrift()
    for time, value in zip(times, amplitude, strict=True):
        drift.update(np.array([0.0, 0.0, value]), time)
    return drift


def test_the_drift_of_the_longest_hold():
    times = np.arange(0, 60, 0.05)
    drift = drift_of(np.where(times < 15, 400.0, 900 - 0.5 * times), times)
    assert drift.per_minute == pytest.approx(-30, rel=1e-3)
    assert (drift.seconds, drift.load) == (44.0, pytest.approx(892, abs=1))


@pytest.mark.parametrize(
    "amplitude",
    [lambda t: 100 + 0 * t[:150], lambda t: 100 * (1 + np.sin(t))],
    ids=["short", "moved"],
)
def test_without_a_hold_there_is_no_drift(amplitude):
    times = np.arange(0, 30, 0.05)
    values = amplitude(times)
    assert math.isnan(drift_of(values, times[: len(values)]).per_minute)
