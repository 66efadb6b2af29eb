"""`serve --hand`: the grip loop behind the page."""

import json
import time
import urllib.error

import msgspec
import pytest

from cli.test_serve import MODEL, ask, refusal, run
from holdfast.io import load_recording
from holdfast.model import Model
from holdfast_grip.errors import HandError
from holdfast_grip.hands import Claim
from holdfast_grip.hands.local import LogFile
from holdfast_grip.loop import watchdog


def test_a_dry_run_shows_the_loop_and_sends_nothing(capsys, grasp, when_served, tmp_path):
    hand = tmp_path / "hand"

    def work(url):
        ask(f"{url}api/v1/recording", "POST")
        while ask(f"{url}api/v1/grip")["time"] is None:
            time.sleep(0.02)
        stopped = ask(f"{url}api/v1/grip/stop", "POST")
        while not (ask(f"{url}api/v1/state").get("recording") or {}).get("seconds"):
            time.sleep(0.02)
        return stopped, ask(f"{url}api/v1/recording", "DELETE")["path"]

    found = when_served(work)
    words = ("--port", 0, "--json", "--record-to", tmp_path / "made", "--hand", f"log:{hand}")
    assert run(capsys, MODEL, grasp, *words, "--law", "fixed")[0] == 0
    document, path = found[0]
    assert (document["hand"], document["law"]) == (f"log:{hand}", "fixed")
    assert (document["armed"], document["n_sent"]) == (False, 0)
    assert (document["state"], document["reason"]) == ("FAULT", "stopped")
    assert not hand.exists()
    texts = [text for _, text in load_recording(path).markers]
    assert texts[0] == f"grip IDLE (fixed, log:{hand}, dry run)"
    assert "grip FAULT (stopped)" in texts


def test_armed_the_stop_reaches_the_hand_and_the_end_leaves_it_open(
    capsys, grasp, when_served, tmp_path, monkeypatch
):
    # On a busy machine the loop has pauses of more than 0.1 s.
    monkeypatch.setattr(watchdog.Watchdog.__init__, "__defaults__", (300.0,))
    hand = tmp_path / "hand"

    def work(url):
        for method, what in (("POST", "tare"), ("DELETE", "threshold")):
            with pytest.raises(urllib.error.HTTPError, match="409"):
                ask(f"{url}api/v1/{what}", method)
        return ask(f"{url}api/v1/grip/stop", "POST")

    found = when_served(work)
    words = ("--port", 0, "--json", "--hand", f"log:{hand}", "--on-fault", "open", "--armed")
    assert run(capsys, MODEL, grasp, *words, "--confirm", f"log:{hand}")[0] == 0
    assert (found[0]["armed"], found[0]["released"]) == (True, True)
    sent = [json.loads(line) for line in hand.read_bytes().splitlines()]
    assert ("FAULT", "stopped", True) in {
        (one["state"], one["reason"], one["release"]) for one in sent
    }
    assert sent[-1]["release"]


def test_a_hand_that_fails_is_shown_and_is_the_exit_code(
    capsys, grasp, when_served, tmp_path, monkeypatch
):
    monkeypatch.setattr(watchdog.Watchdog.__init__, "__defaults__", (300.0,))
    hand = f"log:{tmp_path / 'hand'}"

    def fail(self, command):
        raise HandError("the hand has lost its power")

    monkeypatch.setattr(LogFile, "_send" if hasattr(LogFile, "_send") else "send", fail)

    def work(url):
        while not (document := ask(f"{url}api/v1/grip"))["failure"]:
            time.sleep(0.02)
        with pytest.raises(urllib.error.HTTPError, match="409"):
            ask(f"{url}api/v1/grip/reset", "POST")
        return document

    found = when_served(work)
    words = ("--port", 0, "--json", "--hand", hand, "--armed", "--confirm", hand)
    code, _, err = run(capsys, MODEL, grasp, *words)
    assert (found[0]["state"], found[0]["failure"]) == ("FAULT", "the hand has lost its power")
    assert code == 2
    assert err.splitlines()[-1] == "holdfast: the hand has lost its power"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--armed"], "--armed, --law and the limits are for a hand: give --hand URI too"),
        (["--hand", "log:h", "--armed"], "--armed moves the hand: confirm it with --confirm"),
        (["--hand", "magic:"], "'magic:' is no hand; there are twin:"),
        (["--hand", "twin:"], "--hand twin: needs the source twin:..."),
        (["--hand", "log:h", "--law", "magic"], "unknown law 'magic'"),
        (["--hand", "log:h", "--min-scale", "1.5"], "min_scale <= 1 <= max_scale expected"),
        (["--hand", "log:h", "--law", "pr2"], "needs forces in N and the readings are counts"),
    ],
)
def test_bad_input_is_one_line(capsys, grasp, words, message):
    assert message in refusal(capsys, MODEL, grasp, *words)


def test_a_hand_that_does_not_answer_or_is_in_use(capsys, grasp, tmp_path):
    hand = f"log:{tmp_path / 'none' / 'hand'}"
    armed = ("--hand", hand, "--armed", "--confirm", hand)
    assert "cannot write" in refusal(capsys, MODEL, grasp, *armed)
    with Claim(hand):
        text = f"{hand} has another controller already: stop that one first"
        assert refusal(capsys, MODEL, grasp, *armed) == text


def test_a_model_without_a_finger_of_the_hand(capsys, tmp_path):
    path = tmp_path / "thumb.json"
    model = Model.load(MODEL)
    msgspec.structs.replace(model, fingers={"thumb": model.fingers["*"]}).save(path)
    text = refusal(capsys, path, "twin:?object=ball", "--hand", "twin:")
    assert text.startswith(
        "twin:?object=ball also holds with index, middle, ring, of which the model gives no "
    )
