import gc
import sys
import threading
from functools import partial

import pytest

from holdfast.detection import detect
from holdfast.errors import ModelError, SourceError, StreamError
from holdfast.live.session import SWITCH_INTERVAL, Session
from holdfast.live.stream_detector import StreamDetector

from . import build
from .build import wait_for


def session_of(source):
    return Session(StreamDetector(build.model(), source))


@pytest.fixture
def start():
    running = []

    def begin(source, *listeners):
        session = session_of(source)
        for listener in listeners:
            session.add_listener(listener)
        session.start()
        running.append(session)
        return session

    yield begin
    for session in running:
        session.stop()


def test_listeners_receive_all_updates_in_order(start):
    recording = build.grasp()
    updates = []
    session = start(build.Script.of(recording), updates.append)
    wait_for(lambda: session.ended)
    estimates = [estimate for update in updates for estimate in update.estimates]
    expected = detect(build.model(), recording)
    assert [d.estimate.state.code for d in estimates] == expected.hand.tolist()
    assert session.n_packets == len(expected.hand)
    latency = session.latency()
    assert 0 < latency.p50 <= latency.p99 <= latency.largest
    assert session.failure is None


def test_a_slow_reader_misses_the_oldest_updates(start, monkeypatch):
    monkeypatch.setattr("holdfast.live.session.MAX_KEPT_UPDATES", 20)
    updates = []
    session = start(build.Script.of(build.grasp()), updates.append)
    wait_for(lambda: session.ended)
    n = session.n_updates
    assert n == len(updates) > 40
    for n_read, n_missed in ((0, n - 20), (n - 30, 10), (n - 5, 0), (n, 0)):
        kept, end = session.updates_since(n_read)
        assert [update for _, update in kept] == updates[n_read + n_missed :]
        assert end == n


def test_the_module_with_most_samples_gives_the_number_of_packets(start):
    recording = build.grasp()
    steps = [
        one._replace(time=one.time + 1e-4 * k, samples={name: sample})
        for one in build.arrivals_of(recording)[:60]
        for k, (name, sample) in enumerate(one.samples.items())
    ]
    session = start(build.Script.of(recording, steps))
    wait_for(lambda: session.ended)
    assert session.n_packets == 60


def retare(session):
    session.change(session.stream.restart_tare, "no tare can be taken")


def set_threshold(session, value):
    change = partial(session.stream.set_threshold, value)
    session.change(change, "the threshold was not changed")


def test_a_tare_that_timed_out_is_not_taken_later(monkeypatch):
    monkeypatch.setattr("holdfast.live.session.REQUEST_TIMEOUT", 0.01)
    recording = build.grasp()
    session = session_of(build.Script.of(recording))
    taken = []
    monkeypatch.setattr(session.stream, "restart_tare", lambda: taken.append(1))
    with pytest.raises(SourceError, match="the source does not answer"):
        retare(session)
    session.start()
    wait_for(lambda: session.ended)
    session.stop()
    assert (taken, session.failure) == ([], None)


def test_the_tare_is_taken_in_the_session_and_refused_in_contact(start):
    recording = build.grasp()
    arrivals = build.arrivals_of(recording)
    source = build.Lasting.of(recording, arrivals[:200], patient=True)
    session = start(source)
    wait_for(lambda: session.n_packets >= 200)
    retare(session)
    source.steps.extend(arrivals[200:600])
    wait_for(lambda: source.last.time >= arrivals[599].time)
    with pytest.raises(StreamError, match="in contact"):
        retare(session)


def test_the_threshold_is_changed_in_the_session(start):
    recording = build.grasp()
    source = build.Lasting.of(recording, build.arrivals_of(recording)[:200], patient=True)
    session = start(source)
    set_threshold(session, 0.9)  # also before the rate is known
    assert dict(session.stream.thresholds) == dict.fromkeys(build.FINGERS, 0.9)
    wait_for(lambda: session.n_packets >= 200)
    set_threshold(session, None)
    own = build.model().finger("thumb").stable.threshold
    assert dict(session.stream.thresholds) == dict.fromkeys(build.FINGERS, own)
    with pytest.raises(ValueError, match="2 given"):
        set_threshold(session, 2)
    assert dict(session.stream.thresholds) == dict.fromkeys(build.FINGERS, own)


def test_no_tare_while_no_samples_arrive_and_no_change_after_the_end(start):
    steps = [*build.arrivals_of(build.grasp())[:200], None]
    session = start(build.Script.of(build.grasp(), steps, patient=True))
    wait_for(lambda: session.stream.silent)
    with pytest.raises(SourceError, match="no samples arrive"):
        retare(session)
    session = start(build.Script.of(build.grasp(), []))
    wait_for(lambda: session.ended)
    for change in (retare, lambda session: set_threshold(session, 0.5)):
        with pytest.raises(SourceError, match="the source has ended"):
            change(session)


def test_a_failure_is_kept_and_ends_the_session(start):
    slow = [one._replace(time=one.time * 3) for one in build.arrivals_of(build.grasp())]
    source = build.Script.of(build.grasp(), slow)
    session = Session(StreamDetector(build.model(), source, strict=True))
    session.start()
    wait_for(lambda: session.ended)
    session.stop()
    assert isinstance(session.failure, ModelError)


def test_stopping_closes_the_source_and_leaves_no_thread():
    source = build.Script.of(build.grasp(), [], patient=True)
    session = session_of(source)
    session.start()
    session.stop()
    session.stop()
    assert source.n_closed >= 1
    assert not [t for t in threading.enumerate() if t.name == "holdfast-detector"]


def test_a_removed_listener_is_not_called(start):
    recording = build.grasp()
    source = build.Script.of(recording, build.arrivals_of(recording)[:100], patient=True)
    updates = []
    session = start(source, updates.append)
    wait_for(lambda: session.n_packets == 100)
    session.remove_listener(updates.append)
    n_updates = len(updates)
    source.steps.extend(build.arrivals_of(recording)[100:200])
    wait_for(lambda: session.n_packets == 200)
    assert len(updates) == n_updates


@pytest.fixture
def own_settings():
    """Set a switch interval of the program itself, and restore the real one."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(0.002)
    yield 0.002
    sys.setswitchinterval(before)


def test_the_settings_of_python_are_those_of_before_when_the_last_session_stops(own_settings):
    n_frozen = gc.get_freeze_count()
    first, second = (session_of(build.Script.of(build.grasp(), [], patient=True)) for _ in "ab")
    first.start()
    second.start()
    assert sys.getswitchinterval() == pytest.approx(SWITCH_INTERVAL)
    assert gc.get_freeze_count() > n_frozen
    first.stop()
    first.stop()  # counts once
    assert sys.getswitchinterval() == pytest.approx(SWITCH_INTERVAL)
    assert gc.get_freeze_count() > n_frozen
    second.stop()
    assert sys.getswitchinterval() == pytest.approx(own_settings)
    assert gc.get_freeze_count() <= n_frozen
