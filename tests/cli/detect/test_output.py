import pytest

from holdfast.cli.detect.output import json_lines, watch
from holdfast.contact import ContactEstimate, ContactState, Fault, Reason
from holdfast.demo_data import BOX_SLIPS
from holdfast.detection import Detector, Model, detect
from holdfast.io import load_recording
from holdfast.live.estimate_chunks import (
    ChangeLines,
    DetectionSummary,
    EstimateChunk,
    chunk_from_detection,
    chunk_from_stream,
)
from holdfast.live.stream_detector import StreamEstimate
from holdfast.synthetic import synthetic_recording


@pytest.fixture(scope="module")
def model():
    return Model.load("builtin:noise-floor")


@pytest.fixture(scope="module")
def recording():
    return synthetic_recording("grasp", 1, ("thumb", "index"))


@pytest.fixture(scope="module")
def live_estimates(model, recording):
    """Return the estimates of a detector that is fed with the recording, sample by sample."""
    detector = Detector.for_recording(model, recording)
    modules = recording.modules
    times = modules["thumb"].times.tolist()
    estimates = []
    for k, time in enumerate(times):
        samples = {name: module.readings[k] for name, module in modules.items()}
        estimates.append(StreamEstimate(detector.update(samples, time), tuple(samples)))
    return estimates


def test_live_and_recorded_estimates_give_the_same_output(model, recording, live_estimates):
    recorded = chunk_from_detection(detect(model, recording))
    live = chunk_from_stream("grasp", live_estimates)
    assert "".join(json_lines(live)) == "".join(json_lines(recorded))
    summaries = []
    for chunk in (recorded, live):
        summary = DetectionSummary()
        summary.add(chunk)
        summaries.append(summary.to_dict())
    assert summaries[0] == summaries[1]
    assert summaries[0]["events"]


def test_a_finger_that_is_not_updated_has_no_line(live_estimates):
    one = live_estimates[200]._replace(updated_fingers=("index",))
    (text,) = json_lines(chunk_from_stream("grasp", [one]))
    assert text.count("\n") == 1
    assert '"finger":"index"' in text


def chunk(*states, hand=None, **fields):
    """Return a chunk of two fingers at 100 Hz; each state is one of both, for half a second."""
    rows = [(k, state) for k, state in enumerate(state for state in states for _ in range(50))]

    def finger(pick):
        return [
            ContactEstimate(k / 100, pick(state), fields.get("reason", Reason.NONE), 0.75,
                            float("nan"), (1, 0, 0), fields.get("faults", ()))
            for k, state in rows
        ]  # fmt: skip

    fingers = {"index": finger(lambda pair: pair[0]), "thumb": finger(lambda pair: pair[1])}
    least = min if hand is None else hand
    return EstimateChunk("made", fingers, [(k / 100, least(pair)) for k, pair in rows])


def lines(*states, hand_only=False, **fields):
    return ChangeLines(from_first=False, hand_only=hand_only).add(chunk(*states, **fields))


UNSTABLE, STABLE = ContactState.UNSTABLE, ContactState.STABLE


def worse(pair):
    return UNSTABLE if UNSTABLE in pair else STABLE


def test_a_change_of_the_hand_is_in_the_line_of_the_finger_that_changed_it():
    states = (STABLE, STABLE), (STABLE, UNSTABLE), (UNSTABLE, UNSTABLE), (STABLE, STABLE)
    assert lines(*states, hand=worse) == [
        "    0.000 s  index, hand     STABLE       stable 75 %",
        "    0.000 s  thumb           STABLE       stable 75 %",
        "    0.500 s  thumb, hand     UNSTABLE     stable 75 %",
        "    1.000 s  index           UNSTABLE     stable 75 %",
        "    1.500 s  index, hand     STABLE       stable 75 %",
        "    1.500 s  thumb           STABLE       stable 75 %",
    ]
    assert len(lines(*states, hand=worse, hand_only=True)) == 3
    alone = lines(*states[:2], hand=lambda pair: ContactState.NO_CONTACT)
    assert alone[-2] == "    0.000 s  hand            NO_CONTACT"


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"reason": Reason.LOAD}, "stable 75 %, load changes"),
        ({"reason": Reason.HOLD}, "stable 75 %, hold time"),
        ({"faults": (Fault.STUCK,)}, "stable 75 %, stuck"),
    ],
)
def test_unstable_beside_a_high_probability_says_why(fields, reason):
    (line, _) = lines((UNSTABLE, UNSTABLE), hand=worse, **fields)
    assert line.split("UNSTABLE")[1].strip() == reason
    assert len(line) <= 80


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
