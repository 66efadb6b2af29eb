import threading
import time

import msgspec
import pytest

from grip.build import FINGERS, RATE, hand, holding
from grip.loop.test_grip_loop import LateBeats, Tape
from grip.loop.test_runner import update
from holdfast.contact import ContactState
from holdfast_grip import GripReason
from holdfast_grip.errors import HandError
from holdfast_grip.loop.grip_loop import GripLoop
from holdfast_grip.loop.live_grip import N_ENTRIES, EventLog, LiveGrip

PATIENCE = 60.0


class FakeSession:
    """Session whose updates a test sends."""

    def __init__(self):
        self.source, self.listeners = self, []
        self.paced, self.speed, self.lock = True, 1.0, ""

    def add_listener(self, listener):
        self.listeners.append(listener)

    def remove_listener(self, listener):
        self.listeners.remove(listener)

    def send(self, *estimates):
        for listener in self.listeners:
            listener(update(*estimates))


class Rig:
    """A loop that holds an object, beside a session."""

    def __init__(self, **limits):
        self.tape, self.session, self.log = Tape(), FakeSession(), EventLog()
        controller, self.time = holding(stale_after=1000.0, **limits)
        self.loop = GripLoop(controller, self.tape, armed=True, log=self.log)
        self.grip = LiveGrip("holdfast", self.loop, self.session, self.log)

    def send(self, n=1, **changes):
        for _ in range(n):
            self.time += 1 / RATE
            self.session.send(hand(self.time, **changes))

    def wait(self, condition):
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, "the condition never became true"
            time.sleep(0.002)


@pytest.fixture
def rig():
    return Rig()


@pytest.mark.parametrize("armed", [True, False])
def test_an_armed_loop_locks_tare_and_thresholds(rig, armed):
    rig.loop.armed = armed
    with rig.grip:
        assert bool(rig.session.lock) is armed
    assert rig.session.lock == ""


def test_the_document_says_what_the_grip_waits_for(rig):
    assert rig.grip.document().waiting == ""  # it holds
    controller = rig.loop.controller
    controller.reset()
    ring = {"state": ContactState.UNSTABLE, "normal": 9000.0}
    for _ in range(2):
        rig.time += 3.0
        controller.update(hand(rig.time, ContactState.UNSTABLE, ring=ring), rig.time)
    assert rig.grip.document().waiting == "the ring finger is not stable: 3 s"


def test_the_document_has_the_newest_command(rig):
    with rig.grip as grip:
        before = grip.document()
        assert (before.state, before.time, before.fingers) == ("IDLE", None, {})
        rig.send(5)
        rig.wait(lambda: rig.loop.n_sent > 0)
        found = grip.document()
    assert (found.hand, found.law, found.armed) == ("tape:", "holdfast", True)
    assert (found.state, found.reason, found.stopped) == ("HOLD", "", False)
    assert found.fingers.keys() == set(FINGERS)
    assert found.fingers["index"].scale == 1.0
    assert msgspec.json.decode(msgspec.json.encode(found))["limits"]["max_force"] is None


def test_the_highest_scale_of_a_finger_follows_from_the_highest_force():
    rig = Rig(max_force=1.5)  # the index began with 1 N
    with rig.grip as grip:
        rig.send(3)
        rig.wait(lambda: grip.document().fingers)
        fingers = grip.document().fingers
    assert fingers["index"].highest == pytest.approx(1.5)
    assert fingers["thumb"].highest == 1.0


def test_stop_and_reset_from_another_thread(rig):
    heard = []
    rig.grip.add_listener(lambda text, at: heard.append(text))
    with rig.grip as grip:
        rig.send(3)
        grip.stop().result(PATIENCE)
        stopped = grip.document()
        assert (stopped.state, stopped.reason, stopped.stopped) == ("FAULT", "stopped", True)
        assert rig.tape.commands[-1].reason is GripReason.STOPPED
        grip.reset().result(PATIENCE)
        rig.send(1)
        rig.wait(lambda: grip.document().state == "HOLD")
        assert not grip.document().stopped
    assert heard == ["grip FAULT (stopped)", "grip HOLD"]
    assert [entry.text for entry in rig.log.entries] == heard


def test_a_stop_before_any_sample():
    rig = Rig(on_fault="open")
    with rig.grip as grip:
        grip.stop().result(PATIENCE)
        assert grip.document().released
    assert rig.tape.commands[0].release


def test_a_hand_that_fails_ends_the_loop_and_is_reported(rig):
    with pytest.raises(HandError, match=r"^no$"), rig.grip as grip:
        rig.send(1)
        rig.wait(lambda: rig.loop.n_sent > 0)
        rig.tape.fails = True
        rig.send(1)
        rig.wait(lambda: grip.failure is not None)
        found = grip.document()
        assert (found.state, found.failure) == ("FAULT", "no")
        with pytest.raises(HandError, match="the loop has ended: no"):
            grip.stop().result(0)
    assert rig.log.entries[-1].text == "grip FAULT (hand): no"


def test_a_loop_whose_watchdog_took_over_ends_with_the_safe_command():
    """The page goes on, so the loop is left much later."""
    rig = Rig(on_fault="open")
    rig.loop._watchdog = LateBeats(before=3)
    with pytest.raises(HandError, match="taken over"), rig.grip as grip:
        rig.send(1)
        rig.wait(lambda: grip.failure is not None)
        assert rig.tape.commands[-1].release


def test_a_stop_that_timed_out_ends_no_loop(rig):
    """The time-out of the HTTP request cancels what it waited for."""
    busy, goes_on = threading.Event(), threading.Event()
    send = rig.tape._send

    def slow(command):
        busy.set()
        goes_on.wait(PATIENCE)
        send(command)

    rig.tape._send = slow
    with rig.grip as grip:
        rig.send(1)
        busy.wait(PATIENCE)
        stopped = grip.stop()
        stopped.cancel()
        goes_on.set()
        rig.wait(lambda: grip.document().reason == "stopped")
        rig.send(1)
        grip.stop().result(PATIENCE)
        assert grip.failure is None


def test_leaving_ends_the_thread(rig):
    with rig.grip:
        assert len(rig.session.listeners) == 1
    assert rig.session.listeners == []
    assert "holdfast-grip" not in {thread.name for thread in threading.enumerate()}


def test_the_log_is_bounded():
    log = EventLog()
    for k in range(3 * N_ENTRIES):
        log(f"event {k}", float(k))
    assert len(log.entries) == N_ENTRIES
    assert log.entries[-1].text == f"event {3 * N_ENTRIES - 1}"
