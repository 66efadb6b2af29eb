import json

import msgspec
import pytest

from grip.fakes import FakeGrip
from holdfast.io import load_recording
from holdfast_grip import panel
from holdfast_grip.documents import GripDocument
from holdfast_grip.errors import HandError
from holdfast_grip.panel import GripPanel
from live.web.test_service import patient, run, served, wait_for

pytestmark = pytest.mark.slow  # servers and sockets

STOP, RESET = "/api/v1/grip/stop", "/api/v1/grip/reset"


def panels(grip):
    return [] if grip is None else [GripPanel(grip)]


def ask(grip, *calls, token=None, reports=None, **words):
    """Answers of a service: status and document of each call (method, path)."""

    async def work():
        found = []
        options = {"panels": panels(grip), "token": token, "reports": reports}
        async with served(patient(10), **options) as (client, _):
            for method, path in calls:
                async with client.request(method, path, **words) as answer:
                    text = await answer.text()
                    found.append((answer.status, json.loads(text) if text[:1] == "{" else text))
        return found

    return run(work())


def test_the_state_has_commands_limits_and_events():
    ((status, document),) = ask(FakeGrip(), ("GET", "/api/v1/grip"))
    assert status == 200
    found = msgspec.convert(document, GripDocument)
    assert found.fingers["thumb"].scale == 1.25
    assert found.limits.max_scale == 2.0
    assert found.limits.recovery is None  # infinite
    assert [entry.text for entry in found.events] == ["grip HOLD"]


def test_stop_and_reset():
    grip, reports = FakeGrip(), []
    stopped, reset = ask(grip, ("POST", STOP), ("POST", RESET), reports=reports)
    assert grip.calls == ["stop", "reset"]
    assert (stopped[0], stopped[1]["state"], stopped[1]["stopped"]) == (200, "FAULT", True)
    assert (reset[0], reset[1]["state"], reset[1]["stopped"]) == (200, "HOLD", False)
    assert reports == [
        "emergency stop by 127.0.0.1",
        "stop or fault of the grip reset by 127.0.0.1",
    ]


def test_a_stop_that_fails_says_why():
    grip = FakeGrip()
    grip.error = HandError("the loop has ended: no")
    assert ask(grip, ("POST", STOP)) == [(409, {"error": "the loop has ended: no"})]


def test_a_loop_that_does_not_answer(monkeypatch):
    monkeypatch.setattr(panel, "ANSWER_TIMEOUT", 0.05)
    grip = FakeGrip()
    grip.answers = False
    ((status, document),) = ask(grip, ("POST", STOP))
    assert status == 409
    assert document["error"].endswith("does not answer: use the emergency stop of the hand")


def test_without_a_hand_there_are_no_routes():
    found = ask(None, ("GET", "/api/v1/grip"), ("POST", STOP), ("POST", RESET))
    assert [status for status, _ in found] == [404] * 3


def test_token_and_origin_are_checked_as_everywhere():
    grip = FakeGrip()
    calls = [("GET", "/api/v1/grip"), ("POST", STOP), ("POST", RESET)]
    assert [status for status, _ in ask(grip, *calls, token="long-secret")] == [401] * 3
    headers = {"Origin": "http://evil.example"}
    assert [status for status, _ in ask(grip, *calls, headers=headers)] == [403] * 3
    assert grip.calls == []
    headers = {"Authorization": "Bearer long-secret"}
    assert ask(grip, ("POST", STOP), token="long-secret", headers=headers)[0][0] == 200


@pytest.mark.parametrize(
    ("method", "path"), [("GET", STOP), ("DELETE", STOP), ("POST", "/api/v1/grip")]
)
def test_other_methods_are_refused(method, path):
    grip = FakeGrip()
    assert ask(grip, (method, path))[0][0] == 405
    assert grip.calls == []


def test_a_stop_waits_for_no_thread_of_another_request(monkeypatch):
    """Requests that wait for the detector use all threads; the stop needs none."""
    monkeypatch.setattr("asyncio.to_thread", None)
    assert ask(FakeGrip(), ("POST", STOP))[0][0] == 200


def test_the_state_is_in_every_live_document():
    async def work():
        async with (
            served(patient(10), panels=panels(FakeGrip())) as (client, _),
            client.ws_connect("/api/v1/live") as socket,
        ):
            await socket.receive_json()
            return (await socket.receive_json())["grip"]

    assert run(work())["state"] == "HOLD"


def test_events_are_markers_of_the_recording(tmp_path):
    grip = FakeGrip()

    async def work():
        options = {"folder": tmp_path, "panels": panels(grip), "start": False}
        async with served(patient(50), **options) as (client, session):
            grip.happen("grip IDLE", 0.0)  # before the recording
            async with client.post("/api/v1/recording", json={"name": "held"}):
                pass
            session.start()
            await wait_for(lambda: session.n_packets == 50)
            grip.happen("grip REACT: thumb rises from 1.000 (unstable)", 0.2)
            async with client.delete("/api/v1/recording") as answer:
                assert answer.status == 200, await answer.text()
            session.stop()

    run(work())
    markers = load_recording(tmp_path / "held.mcap").markers
    assert [text for _, text in markers] == [
        "grip HOLD (holdfast, log:hand, armed)",
        "grip REACT: thumb rises from 1.000 (unstable)",
    ]
    assert markers[1][0] == 0.2
