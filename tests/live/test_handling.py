"""Calibration of a running session by own handling."""

import time
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.detector import Detector, detect
from holdfast.errors import ModelError, OutputError, SourceError, StreamError
from holdfast.live.handling import SessionCalibration
from holdfast.live.session import Session
from holdfast.live.stream_detector import StreamDetector
from holdfast.model import Model
from holdfast.training import calibrate
from live import build
from training.build import handling_recording, normalised_model

pytestmark = pytest.mark.slow

PATIENCE = 60.0
OPEN = 2.0  # time before and after the handling [s]


def handled(seed=1, held=20.0, **options):
    return handling_recording(seed, held=held, open_for=OPEN, **options)


def part_of(recording, start, stop):
    modules = {
        name: module.slice(*np.searchsorted(module.times, (start, stop)))
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules)


class Stepped:
    """A session that reads its source only when it is told to, in the thread of the test."""

    def __init__(self, recording, model=None, *, folder=None, **options):
        self.source = build.Script.of(recording, patient=True)
        self.stream = StreamDetector(model or normalised_model(), self.source, **options)
        self.session = Session(self.stream)
        self._append = self.session._requests.append
        self.session._requests.append = self._carry_out
        self.calibration = SessionCalibration(self.session, folder)
        self.estimates = []
        self.session.add_listener(self.keep)

    def _carry_out(self, work):
        future = self._append(work)
        self.session._requests.carry_out()
        return future

    def keep(self, update):
        self.estimates += [estimate for estimate, _ in update.estimates]

    def play(self, until=np.inf):
        while self.source.steps and self.source.steps[0].time < until:
            self.session._step()

    def fitted(self):
        """Wait for the end of the fit, and return the document."""
        end = time.monotonic() + PATIENCE
        while self.calibration.document().state == "fitting":
            if time.monotonic() > end:
                pytest.fail("the model was never fitted")
            time.sleep(0.01)
        return self.calibration.document()


def held_until_finish(recording, **options):
    hand = Stepped(recording, **options)
    hand.play(1.0)
    hand.calibration.start()
    hand.play()
    hand.calibration.finish()
    return hand, hand.fitted()


def test_the_model_is_that_of_the_same_recording(tmp_path):
    recording = handled()
    hand, document = held_until_finish(recording, folder=tmp_path)
    assert (document.state, document.calibrated, document.refused) == ("idle", True, False)
    expected = calibrate(normalised_model(), [part_of(recording, 1.0, np.inf)])
    own, known = (m.fingers["*"].handling["pad"] for m in (hand.stream.model, expected))
    assert own.location == pytest.approx(known.location, abs=0.15)
    assert own.scale == pytest.approx(known.scale, rel=0.15)
    assert own.seconds == pytest.approx(known.seconds, abs=0.3)
    path = hand.calibration.save("mine")
    assert path == tmp_path / "mine.json"
    assert Model.load(path) == hand.stream.model
    downloaded = tmp_path / "downloaded.json"
    downloaded.write_bytes(hand.calibration.encoded_model())
    assert Model.load(downloaded) == hand.stream.model
    with pytest.raises(OutputError, match="exists"):
        hand.calibration.save("mine")


def test_the_text_says_what_was_seen_and_what_changes():
    _, document = held_until_finish(handled())
    assert document.text.startswith("pad: held 21 s; the arm moved (the force changed by ")
    assert " of 31 features have a new scale, and 9" in document.text
    assert document.warnings == ["pad: 21 s of holding; 30 s or more are better"]
    _, document = held_until_finish(handled(sway=0.001))
    assert (document.calibrated, document.refused) == (False, True)
    assert document.text == (
        "not calibrated: pad: the arm hardly moved; move the arm as it will move later; nothing "
        "has changed"
    )


def test_pressed_while_the_object_is_held():
    """The zero is that of the stream: what the hand holds at the press is load."""
    hand = Stepped(handled())
    hand.play(8.0)
    hand.calibration.start()
    hand.play(18.0)
    assert hand.calibration.document().seconds == pytest.approx(10.0, abs=0.2)
    hand.calibration.finish()
    assert hand.fitted().calibrated
    assert hand.stream.model.fingers["*"].handling["pad"].seconds == pytest.approx(9.8, abs=0.3)


@pytest.mark.parametrize("pressed", [0.0, 6.0])
def test_a_stream_that_begins_in_contact(pressed):
    begun = part_of(handled(), 4.0, 20.0)
    hand = Stepped(begun, in_contact=True)
    hand.play(4.0 + pressed)
    hand.calibration.start()
    hand.play()
    hand.calibration.finish()
    assert hand.fitted().calibrated
    seconds = hand.stream.model.fingers["*"].handling["pad"].seconds
    assert seconds == pytest.approx(16.0 - pressed, abs=0.5)
    assert "the arm moved (the force changed by " in hand.calibration.text  # newtons have a zero


def test_counts_that_begin_in_contact_have_no_load():
    counts = handled()
    skin = replace(next(iter(counts.modules.values())).sensor, unit="count")
    modules = {
        name: replace(module, sensor=skin, unit="count", readings=1000 * module.readings)
        for name, module in part_of(counts, 4.0, 20.0).modules.items()
    }
    hand = Stepped(replace(counts, modules=modules), in_contact=True)
    hand.play(6.0)
    hand.calibration.start()
    hand.play()
    hand.calibration.finish()
    assert hand.fitted().calibrated
    assert "how much the arm moved is not known, as the hand has not been open" in (
        hand.calibration.text
    )


def test_states_continue_without_a_new_warm_up():
    """From the sample after, the probability is that of the calibrated model from the start."""
    recording = handled(held=40.0)
    hand = Stepped(recording)
    hand.play(1.0)
    hand.calibration.start()
    hand.play(20.0)
    hand.calibration.finish()
    assert hand.fitted().calibrated
    hand.play()
    after = [e for e in hand.estimates if e.time > 20.5]
    trace = detect(hand.stream.model, recording).fingers["thumb"]
    expected = dict(zip(trace.times.tolist(), trace.stable_probability.tolist(), strict=True))
    found = [e.fingers["thumb"].stable_probability for e in after]
    assert found == pytest.approx([expected[e.time] for e in after], abs=1e-3)
    known = [e for e in hand.estimates if 3.0 < e.time < 40.0]
    assert all(e.fingers["thumb"].state is not ContactState.UNKNOWN for e in known)
    thresholds = {hand.stream.model.fingers["*"].handling["pad"].thresholds["stable"]}
    assert set(hand.stream.thresholds.values()) == thresholds != {0.95}


def test_undo_puts_back_the_model_of_the_start():
    recording = handled(held=40.0)
    hand = Stepped(recording)
    hand.play(1.0)
    hand.calibration.start()
    hand.play(20.0)
    hand.calibration.finish()
    assert hand.fitted().calibrated
    hand.calibration.cancel()
    document = hand.calibration.document()
    assert (document.calibrated, document.text) == (False, "calibration undone")
    assert hand.stream.model == normalised_model()
    hand.play()
    trace = detect(normalised_model(), recording).fingers["thumb"]
    expected = dict(zip(trace.times.tolist(), trace.stable_probability.tolist(), strict=True))
    after = [e for e in hand.estimates if e.time > 20.5]
    found = [e.fingers["thumb"].stable_probability for e in after]
    assert found == pytest.approx([expected[e.time] for e in after], abs=1e-3)
    assert set(hand.stream.thresholds.values()) == {0.95}
    with pytest.raises(StreamError, match=r"^there is no calibration to undo$"):
        hand.calibration.cancel()


def test_it_ends_by_itself_after_a_minute_of_holding(monkeypatch):
    monkeypatch.setattr("holdfast.live.handling.HELD_SECONDS", 8.0)
    hand = Stepped(handled())
    hand.calibration.start()
    hand.play(8.0)
    assert hand.calibration.document().state == "recording"
    hand.play()
    assert hand.fitted().calibrated


def refused(document, *words):
    assert (document.calibrated, document.refused) == (False, True)
    assert document.text.startswith("not calibrated: ")
    assert document.text.endswith("; nothing has changed")
    assert "\n" not in document.text
    for word in words:
        assert word in document.text


def test_mostly_slip_is_refused():
    hand, document = held_until_finish(handled(held=10.0, slip=0.95))
    refused(document, "looks like slip")
    assert hand.stream.model == normalised_model()


def test_an_empty_hand_is_refused(monkeypatch):
    hand = Stepped(handled(force=0.0))
    hand.calibration.start()
    hand.play()
    with pytest.raises(StreamError, match=r"^0\.\d s held so far, at least 5\.5 s expected"):
        hand.calibration.finish()
    assert hand.calibration.document().state == "recording"
    hand.calibration.cancel()
    assert hand.calibration.document().state == "idle"
    monkeypatch.setattr("holdfast.live.handling.MAX_WAITING", 10.0)
    hand = Stepped(handled(force=0.0))
    hand.calibration.start()
    hand.play()
    refused(hand.fitted(), " s held in 10 s, at least 5 s expected")


def test_a_source_that_ends_meanwhile():
    hand = Stepped(handled())
    hand.calibration.start()
    hand.play(8.0)
    hand.session.ended = True
    refused(hand.calibration.document(), "the source has ended")
    with pytest.raises(SourceError, match="the source has ended"):
        hand.calibration.start()


def test_an_armed_hand_refuses_everything_that_changes_the_model():
    hand, document = held_until_finish(handled())
    assert document.calibrated
    hand.session.lock = "the hand is armed"
    for work in (hand.calibration.start, hand.calibration.cancel):
        with pytest.raises(StreamError, match=r"^the hand is armed$"):
            work()
    assert hand.calibration.document().calibrated


def test_one_at_a_time_and_only_after_a_start(tmp_path):
    hand = Stepped(handled(), folder=tmp_path)
    for work in (hand.calibration.encoded_model, hand.calibration.save):
        with pytest.raises(StreamError, match=r"^there is no calibrated model: calibrate first$"):
            work()
    with pytest.raises(StreamError, match=r"^no calibration is running"):
        hand.calibration.finish()
    hand.calibration.start()
    with pytest.raises(StreamError, match=r"^a calibration is running already$"):
        hand.calibration.start()


def test_a_model_that_is_not_normalised_is_refused():
    hand = Stepped(build.grasp(), Model.load("builtin:twin"))
    with pytest.raises(ModelError, match=r"builtin:any can$"):
        hand.calibration.start()


def test_ignored_taxels_cause_no_fault():
    recording = handled(held=12.0)
    thumb = recording.modules["thumb"]
    readings = np.array(thumb.readings)
    readings[:, 2] = np.nan
    modules = {**recording.modules, "thumb": replace(thumb, readings=readings)}
    ignoring = {"ignore": {"thumb": (2,)}}
    _, document = held_until_finish(replace(recording, modules=modules), **ignoring)
    assert document.calibrated


def test_samples_that_are_kept_are_bounded(monkeypatch):
    monkeypatch.setattr("holdfast.live.handling.MAX_HANDLING_BYTES", 300_000)
    hand = Stepped(handled(held=40.0))
    hand.calibration.start()
    hand.play()
    assert hand.fitted().state == "idle"


def test_a_detector_refuses_a_model_of_another_kind():
    recording = handled(held=8.0)
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    detector = Detector(normalised_model(), sensors, 100.0)
    with pytest.raises(ModelError, match="has other features than the model of the detector"):
        detector.set_model(Model.load("builtin:noise-floor"))
    model = normalised_model()
    longer = msgspec.structs.replace(model.debounce, hold=1.0)
    with pytest.raises(ModelError, match="decides by another rule"):
        detector.set_model(msgspec.structs.replace(model, debounce=longer))
