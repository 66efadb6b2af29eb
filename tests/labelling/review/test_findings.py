import re
from dataclasses import replace

import numpy as np
import pytest

from holdfast.io import load_recording, save_labels, save_recording
from holdfast.labelling.review.findings import (
    findings_of,
    findings_of_scan,
    hidden_labels,
    report_hidden_labels,
    with_oddities,
)
from holdfast.labelling.review.scan import FindingsScan
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor
from holdfast.synthetic import synthetic_recording


@pytest.fixture(scope="module")
def thumb():
    return synthetic_recording("made", 0, ("thumb",)).modules["thumb"]


def found(module):
    return [tuple(each) for each in findings_of(Recording("made", {"thumb": module}))]


def with_readings(module, readings):
    return replace(module, readings=readings, labels=())


def test_a_good_recording_has_none(thumb):
    assert found(thumb) == []


def test_constant_stretches(thumb):
    readings = thumb.readings.copy()
    readings[:150] = readings[0]
    readings[1200:1290] = readings[1200]
    readings[1400:1410] = readings[1400]
    text = (
        "no reading changes for 1.59 s in all, in stretches of 0.5 s or more, the first from "
        "0.00 to 0.99 s"
    )
    more = ": the tare shows no noise; give train a --contact-threshold"
    assert found(with_readings(thumb, readings)) == [("thumb", "constant", text + more)]
    readings[:150] = thumb.readings[:150]
    ((_, _, later),) = found(with_readings(thumb, readings))
    assert later.endswith(
        "for 0.59 s in all, in stretches of 0.5 s or more, the first from 8.00 to 8.59 s"
    )


def test_a_dead_sensor_and_still_axes(thumb):
    dead = with_readings(thumb, np.full_like(thumb.readings, 7))
    assert ("thumb", "dead", "the readings never change: the sensor is dead or disconnected") in (
        found(dead)
    )
    readings = thumb.readings.astype(float)
    readings[:, :, 0] = np.nan
    readings[:, :, 1] = 0
    text = "readings along x and y never change; 3 axes are expected"
    assert ("thumb", "axes", text) in found(with_readings(thumb, readings))


def test_one_taxel_and_an_odd_rate():
    rng = np.random.default_rng(0)
    one = Sensor("one", np.zeros((1, 3)), np.eye(3)[None], np.array([0.0, 0.0, 1.0]), 20.0)
    readings = rng.normal(0, 1, (200, 1, 3))
    kinds = {kind: text for _, kind, text in found(Tactile(one, np.arange(200) / 20, readings))}
    assert kinds == {
        "rate": "20 Hz; builtin:any needs 30 to 1000 Hz",
        "one_taxel": "one taxel: taxels cannot be compared, only its force is judged",
        "no_contact": "no finger is in contact in the whole recording",
    }


@pytest.mark.parametrize(
    ("unit", "factor", "text"),
    [
        ("count", 1e-6, r"readings between -?[\d.e-]+ and [\d.e-]+ are less than one count apart"),
        ("N", 1.0, r"readings up to [\d.e+]+ N on a taxel: is their unit count\?"),
    ],
)
def test_readings_in_another_unit(thumb, unit, factor, text):
    module = Tactile(thumb.sensor, thumb.times, thumb.readings * factor, unit)
    ((_, kind, given),) = [one for one in found(module) if one[1] == "unit"]
    assert kind == "unit"
    assert re.match(text, given)


def test_a_start_in_contact(thumb):
    recording = Recording("held", {"thumb": thumb}, {"starts_loaded": True})
    (only,) = findings_of(recording)
    assert only == (
        "",
        "starts_loaded",
        "begins in contact (metadata: starts_loaded): the first samples are load "
        "(give --in-contact); or z of the sensor points inwards (docs/sensors.md)",
    )


def test_labels_of_a_rule_that_hide_others(tmp_path):
    path = tmp_path / "made.parquet"
    save_recording(synthetic_recording("made", 0, ("thumb",)), path)
    assert hidden_labels(path) is None
    recording = load_recording(path)
    n = len(recording.modules["thumb"].labels)
    save_labels(recording, path, author="ada")
    assert hidden_labels(path) is None
    save_labels(recording, path, author="rule:signal", force=True)
    assert hidden_labels(path).text == (
        f"made.labels.json has labels of rule:signal, which outrank the {n} labels that came with "
        "the recording; delete it to use those"
    )
    lines = []
    (tmp_path / "bad.parquet").write_bytes(b"")
    (tmp_path / "bad.labels.json").write_text("{}")
    report_hidden_labels([path, tmp_path / "bad.parquet"], lines.append)
    assert lines == [
        "labels of a rule outrank the labels that came with 1 of 2 recordings (made); delete "
        "their .labels.json files to use those"
    ]


def test_nothing_is_reported_without_hidden_labels(tmp_path):
    path = tmp_path / "made.parquet"
    save_recording(synthetic_recording("made", 0, ("thumb",)).with_labels({}), path)
    save_labels(load_recording(path), path, author="rule:signal")
    report_hidden_labels([path], pytest.fail)


GRASP = synthetic_recording("made", seed=0)
UNLABELLED = GRASP.with_labels({})
"""Two fingers at 150 Hz."""


def timed(change, *fingers):
    """Return the recording with other times, of all fingers or some of them."""
    modules = {
        name: replace(module, times=change(module.times))
        if name in fingers or not fingers
        else module
        for name, module in UNLABELLED.modules.items()
    }
    return replace(UNLABELLED, modules=modules)


def oddities_of(recording, path):
    scan = FindingsScan()
    scan.add(recording)
    return [
        (one.module, one.kind, one.text)
        for one in with_oddities(findings_of_scan(scan), scan, path)
    ]


def with_gap(times):
    return times + 0.25 * (times > 3) + 0.1 * (times > 4)


CASES = {
    "labelled": (GRASP, []),
    "no labels": (UNLABELLED, [("", "no_labels", "no labels: draw them with holdfast label a.")]),
    "gaps": (
        timed(with_gap, "thumb"),
        [("thumb", "gaps", "2 gaps: 0.257 s at 3.00 s, 0.107 s at 4."), ("", "no_labels", "no")],
    ),
    "a unit": (
        timed(lambda times: times * 1e3),
        [
            *((name, "unlikely_rate", "0.15 Hz where the sensor has 150: if the times have another")
              for name in UNLABELLED.modules),
            *((name, "rate", "0.15 Hz; builtin:any needs") for name in UNLABELLED.modules),
            ("", "no_labels", "no labels"),
        ],
    ),
    "clocks of two fingers": (
        timed(lambda times: times * 1.002, "index"),
        [("index", "clock_drift", "as many samples as thumb in "), ("", "no_labels", "no labels")],
    ),
    "the clock of a bag": (
        replace(UNLABELLED, metadata={"clock_drift": 0.002}),
        [
            ("", "clock_drift", "the bag's clock gains +120 ms a minute"),
            ("", "no_labels", "no labels"),
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize(("recording", "expected"), CASES.values(), ids=CASES)
def test_what_is_odd(tmp_path, recording, expected):
    findings = oddities_of(recording, tmp_path / "a.mcap")
    assert [finding[:2] for finding in findings] == [one[:2] for one in expected]
    for (_, _, text), (_, _, start) in zip(findings, expected, strict=True):
        assert text.startswith(start)


def test_labels_of_one_finger_are_labels(tmp_path):
    name = next(iter(UNLABELLED.modules))
    assert oddities_of(UNLABELLED.with_labels({name: GRASP.modules[name].labels}), tmp_path) == []
