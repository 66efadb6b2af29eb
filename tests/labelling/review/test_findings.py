import re
from dataclasses import replace

import numpy as np
import pytest

from holdfast.detection import Tare
from holdfast.io import load_recording, save_labels, save_recording
from holdfast.labelling.review.content import content_of
from holdfast.labelling.review.findings import (
    findings_of,
    findings_of_scan,
    hidden_labels,
    report_hidden_labels,
    with_oddities,
)
from holdfast.labelling.review.scan import FindingsScan
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor, flat_sensor
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
    ((finger, kind, text),) = found(with_readings(thumb, readings))
    assert (finger, kind) == ("thumb", "constant")
    assert re.search(r"1\.59 s.*0\.00 to 0\.99 s.*--contact-threshold", text)
    readings[:150] = thumb.readings[:150]
    ((_, _, later),) = found(with_readings(thumb, readings))
    assert re.search(r"0\.59 s.*8\.00 to 8\.59 s", later)


def test_a_dead_sensor_and_still_axes(thumb):
    dead = with_readings(thumb, np.full_like(thumb.readings, 7))
    assert "dead" in {kind for _, kind, _ in found(dead)}
    readings = thumb.readings.astype(float)
    readings[:, :, 0] = np.nan
    readings[:, :, 1] = 0
    texts = {kind: text for _, kind, text in found(with_readings(thumb, readings))}
    assert "x and y" in texts["axes"]


def test_one_taxel_and_an_odd_rate():
    rng = np.random.default_rng(0)
    one = Sensor("one", np.zeros((1, 3)), np.eye(3)[None], np.array([0.0, 0.0, 1.0]), 20.0)
    readings = rng.normal(0, 1, (200, 1, 3))
    kinds = [kind for _, kind, _ in found(Tactile(one, np.arange(200) / 20, readings))]
    assert sorted(kinds) == ["no_contact", "one_taxel", "rate"]


def test_more_taxels_than_a_detector_takes(tmp_path):
    skin = flat_sensor("wide", 19, 27, 0.005, 0.005)
    readings = np.random.default_rng(0).normal(0, 1, (200, 513, 3))
    wide = Recording("wide", {"skin": Tactile(skin, np.arange(200) / 100, readings)})
    save_recording(wide, tmp_path / "wide.parquet")
    content = content_of(tmp_path / "wide.parquet", Tare.parse("0.5"))
    assert content["modules"]["skin"]["faults"] == {}
    assert "many_taxels" in {finding["kind"] for finding in content["findings"]}


@pytest.mark.parametrize(("unit", "factor"), [("count", 1e-6), ("N", 1.0)])
def test_readings_in_another_unit(thumb, unit, factor):
    module = Tactile(thumb.sensor, thumb.times, thumb.readings * factor, unit)
    assert "unit" in {kind for _, kind, _ in found(module)}


def test_a_start_in_contact(thumb):
    recording = Recording("held", {"thumb": thumb}, {"starts_loaded": True})
    ((finger, kind, text),) = findings_of(recording)
    assert (finger, kind) == ("", "starts_loaded")
    assert "--in-contact" in text


def test_labels_of_a_rule_that_hide_others(tmp_path):
    path = tmp_path / "made.parquet"
    save_recording(synthetic_recording("made", 0, ("thumb",)), path)
    assert hidden_labels(path) is None
    recording = load_recording(path)
    n = len(recording.modules["thumb"].labels)
    save_labels(recording, path, author="ada")
    assert hidden_labels(path) is None
    save_labels(recording, path, author="rule:signal", force=True)
    assert re.search(rf"made\.labels\.json .*rule:signal.* {n} ", hidden_labels(path).text)
    lines = []
    (tmp_path / "bad.parquet").write_bytes(b"")
    (tmp_path / "bad.labels.json").write_text("{}")
    report_hidden_labels([path, tmp_path / "bad.parquet"], lines.append)
    (line,) = lines
    assert "1 of 2 recordings (made)" in line


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


NO_LABELS = ("", "no_labels")
CASES = {
    "labelled": (GRASP, []),
    "no labels": (UNLABELLED, [NO_LABELS]),
    "gaps": (timed(with_gap, "thumb"), [("thumb", "gaps"), NO_LABELS]),
    "a unit": (
        timed(lambda times: times * 50),
        [(n, kind) for kind in ("unlikely_rate", "rate") for n in UNLABELLED.modules] + [NO_LABELS],
    ),
    "clocks": (timed(lambda t: t * 1.002, "index"), [("index", "clock_drift"), NO_LABELS]),
    "the clock of a bag": (
        replace(UNLABELLED, metadata={"clock_drift": 0.002}),
        [("", "clock_drift"), NO_LABELS],
    ),
}


@pytest.mark.parametrize(("recording", "expected"), CASES.values(), ids=CASES)
def test_what_is_odd(tmp_path, recording, expected):
    findings = oddities_of(recording, tmp_path / "a.mcap")
    assert [finding[:2] for finding in findings] == expected


def test_gaps_are_named_with_their_times(tmp_path):
    (gaps, _) = oddities_of(timed(with_gap, "thumb"), tmp_path / "a.mcap")
    assert gaps[2].startswith("2 gaps: 0.257 s at 3.00 s, 0.107 s at 4.")
