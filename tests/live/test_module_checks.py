"""Drift of a hold; copies of modules, and cross-talk between them."""

import math

import numpy as np
import pytest

from holdfast.detection import Tare
from holdfast.io import save_recording
from holdfast.labelling.review.content import content_of
from holdfast.labelling.review.findings import faulty_readings, findings_of
from holdfast.live.module_checks import HoldDrift, Likeness, ModuleComparison
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor

TIMES = np.arange(0, 9, 0.01)
GRIP = np.interp(TIMES, [1.5, 2, 7, 7.4], [0, 1, 1, 0])


def press(seed, load=900.0, noise=4.0):
    """Readings (n, 16, 3) of a press from 1.5 to 7.4 s, spread at random."""
    rng = np.random.default_rng(seed)
    pattern = rng.uniform(0.1, 1, (16, 1)) * [0.1, 0.05, 1]
    return load * GRIP[:, None, None] * pattern, rng.normal(0, noise, (len(TIMES), 16, 3))


def found(**modules):
    comparison = ModuleComparison()
    return [
        likeness
        for k, time in enumerate(TIMES)
        for likeness in comparison.update({n: x[k] for n, x in modules.items()}, time)
    ]


def findings(**modules):
    patch = sensor("uskin-4x4")
    whole = {name: Tactile(patch, TIMES, 33_000 + x) for name, x in modules.items()}
    return [(f.module, f.kind) for f in findings_of(Recording("made", whole))]


def test_a_copy():
    one = sum(press(0))
    assert found(left=one, right=one) == [Likeness("right", "left", 1)]
    assert findings(left=one, right=one) == [("right", "copy")]


@pytest.mark.parametrize("share", [0.1, 0.3, -0.2])
def test_cross_talk(share):
    (load, noise), (_, other) = press(0), press(1)
    ((module, whose, measured),) = found(left=load + noise, right=share * load + other)
    assert (module, whose) == ("right", "left")
    assert measured == pytest.approx(abs(share), rel=0.1)
    if share > 0:  # else z seems to point inwards, too
        assert findings(left=load + noise, right=share * load + other) == [("right", "cross_talk")]


def test_two_fingers_of_one_grasp_are_not_alike():
    assert found(left=sum(press(0)), right=sum(press(1, 400.0))) == []


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


def test_faulty_readings_are_findings():
    assert faulty_readings("index", 2, 1000, []) == []
    invalid, stuck = faulty_readings("index", 25, 1000, [2, 7])
    assert (invalid[:2], stuck[:2]) == (("index", "invalid"), ("index", "stuck"))
    assert "25 samples (2.5 %)" in invalid[2]
    assert "taxels 2, 7" in stuck[2]


def test_a_stuck_axis_is_found_in_a_recording(tmp_path):
    which, times = sensor("anyskin"), np.arange(1000) / 100
    readings = np.rint(np.random.default_rng(0).normal(300, 3, size=(1000, 5, 3)))
    readings[300:, 2, 1] = 301
    path = tmp_path / "axis.parquet"
    save_recording(Recording("axis", {"thumb": Tactile(which, times, readings)}), path)
    report = content_of(path, Tare.parse("0.5"))
    assert report["modules"]["thumb"]["faults"].keys() == {"stuck"}
    [text] = [each["text"] for each in report["findings"] if each["kind"] == "stuck"]
    assert "taxel 3" in text
