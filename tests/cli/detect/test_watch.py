"""The recording of a real hand that ships, and how it is shown as a live source."""

import pytest

from holdfast.cli.detect import output
from holdfast.cli.detect.output import watch
from holdfast.io import load_recording
from holdfast.recorded import BOX_SLIPS

pytestmark = pytest.mark.slow


def test_the_recording_is_small_and_has_its_licence():
    assert BOX_SLIPS.stat().st_size < 300_000
    assert "MIT License" in BOX_SLIPS.with_name("LICENSE.box-slips").read_text("utf-8")
    recording = load_recording(BOX_SLIPS)
    assert recording.complete
    assert recording.metadata["source"] == "imanlab/proactive-slip-control"


def test_the_clip_is_held_slips_and_is_lost(capsys):
    summary = watch("builtin:any", BOX_SLIPS, 0)
    out, err = capsys.readouterr()
    assert out == ""
    hand = [change["state"] for change in summary["events"] if change["finger"] == "hand"]
    assert (hand[0], hand[-1]) == ("STABLE", "NO_CONTACT")
    assert summary["hand"]["n_samples"] == load_recording(BOX_SLIPS).modules["finger1"].n_samples
    lines = err.splitlines()
    # `builtin:any` reports no slip: its UNSTABLE comes before the labelled one.
    unstable = next(line for line in lines if "UNSTABLE" in line)
    labels = load_recording(BOX_SLIPS).modules["finger1"].labels
    onset = next(label.start for label in labels if label.cause == "slip")
    assert onset - 0.3 < float(unstable.split()[0]) < onset
    assert all(len(line) <= 80 and "nan" not in line for line in lines)
    times = [float(line.split()[0]) for line in lines]
    assert times == sorted(times)


def test_of_the_hand_alone(capsys):
    watch("builtin:any", BOX_SLIPS, 0, fingers=False)
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[2:5] for line in lines] == [
        ["finger1,", "hand", state] for state in ("STABLE", "UNSTABLE", "NO_CONTACT")
    ]


def test_it_plays_at_its_speed(monkeypatch):
    asked, real = [], output.open_source
    monkeypatch.setattr(
        output, "open_source", lambda path, speed: asked.append(speed) or real(path, speed=0)
    )
    watch("builtin:any", BOX_SLIPS, 2.0)
    assert asked == [2.0]
