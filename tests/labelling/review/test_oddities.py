"""What is odd about times and labels is named, with the command, the most important first."""

from dataclasses import replace

import pytest

from holdfast.labelling.review.findings import findings_of_scan
from holdfast.labelling.review.oddities import with_oddities
from holdfast.labelling.review.scan import FindingsScan
from holdfast.synthetic import synthetic_recording

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


def found(recording, path):
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
    findings = found(recording, tmp_path / "a.mcap")
    assert [finding[:2] for finding in findings] == [one[:2] for one in expected]
    for (_, _, text), (_, _, start) in zip(findings, expected, strict=True):
        assert text.startswith(start)


def test_labels_of_one_finger_are_labels(tmp_path):
    name = next(iter(UNLABELLED.modules))
    assert found(UNLABELLED.with_labels({name: GRASP.modules[name].labels}), tmp_path) == []
