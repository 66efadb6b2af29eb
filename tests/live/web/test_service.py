import asyncio
from contextlib import AsyncExitStack, asynccontextmanager

import msgspec
import numpy as np
import pytest
from aiohttp import ClientSession, WSServerHandshakeError, web

from holdfast.contact import Fault
from holdfast.detection import Choice, Head, Linear, ThresholdPoint, detect
from holdfast.io import load_recording
from holdfast.live.documents import finger_document
from holdfast.live.session import Session
from holdfast.live.status import operating_points
from holdfast.live.stream_detector import StreamDetector
from holdfast.live.web import schema
from holdfast.live.web.service import (
    MAX_WEBSOCKETS_PER_ADDRESS,
    LiveService,
)
from holdfast.metrics.masks import runs
from holdfast.web.guard import Guard
from live import build, estimates

PATIENCE = 30.0


@asynccontextmanager
async def served(
    source, token=None, host="127.0.0.1", folder=None, start=True, reports=None, model=None,
):  # fmt: skip
    """Yield a client of the service of a source, and the session."""
    model = model or build.model()
    session = Session(StreamDetector(model, source))
    report = [].append if reports is None else reports.append
    service = LiveService(session, Guard(host, token), folder, report)
    runner = web.AppRunner(service.app, shutdown_timeout=0.5)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", 0).start()
    url = f"http://127.0.0.1:{runner.addresses[0][1]}"
    if start:
        session.start()
    try:
        async with ClientSession(base_url=url) as client:
            yield client, session
    finally:
        await runner.cleanup()
        if start:
            session.stop()


async def wait_for(condition):
    while not condition():  # `run` limits the time
        await asyncio.sleep(0.01)


def patient(n, recording=None):
    recording = recording or build.grasp()
    return build.Script.of(recording, build.arrivals_of(recording)[:n], patient=True)


def run(work):
    return asyncio.run(asyncio.wait_for(work, PATIENCE))


async def reply(client, method, path, **words):
    """The status and the JSON of a request."""
    async with client.request(method, f"/api/v1/{path}", **words) as answer:
        return answer.status, await answer.json()


def replies(*requests, n=10, **options):
    """The replies to requests: (method, path) or (method, path, JSON)."""

    async def work():
        async with served(patient(n), **options) as (client, _):
            return [await reply(client, *words[:2], json=[*words, None][2]) for words in requests]

    return run(work())


def talk(source, conversation, **options):
    """The result of a conversation: a function of client, session, socket and first document."""

    async def work():
        async with (
            served(source, **options) as (client, session),
            client.ws_connect("/api/v1/live") as socket,
        ):
            return await conversation(client, session, socket, await socket.receive_json())

    return run(work())


def test_the_first_document_describes_model_and_source(tmp_path):
    async def conversation(client, session, socket, hello):
        assert await reply(client, "GET", "info") == (200, hello)
        return hello

    hello = talk(patient(10), conversation, folder=tmp_path)
    assert (hello["schema"], hello["type"]) == ("holdfast.live/1", "hello")
    assert hello["model"] == "builtin:twin"
    assert hello["modules"] == dict.fromkeys(build.FINGERS, 30)
    assert list(hello["fingers"]) == list(build.FINGERS)
    thumb = hello["fingers"]["thumb"]
    assert np.shape(thumb["positions"]) == (30, 3)
    assert np.shape(thumb["rotations"]) == (30, 3, 3)
    assert hello["can_record"] is True
    msgspec.convert(hello, schema.HelloDocument)


def with_slip_rule(finger):
    """The model of the twin; one finger has a slip rule that looks at its first feature."""
    model = build.model()
    part = model.finger(finger).without_heads("slip", "slip_speed")
    first = part.stable.features[:1]
    odds, root = (Linear((0.0,), (1.0,), ((1.0,),), (intercept,)) for intercept in (-6.0, 0.5))
    fingers = dict.fromkeys(build.FINGERS, part)
    fingers[finger] = part.with_heads(
        Head(name="slip", link="logit", features=first, rule=odds, threshold=0.7, hold=0.05),
        Head(name="slip_speed", link="square", features=first, rule=root, highest=40.0),
    )
    return msgspec.structs.replace(model, fingers=fingers)


def documents_of(recording, model):
    """Return the first document of a connection, and all live documents of a recording."""

    async def conversation(client, session, socket, hello):
        session.start()
        found = []
        while not found or not found[-1]["ended"]:
            found.append(await socket.receive_json())
        found.append(await socket.receive_json())
        session.stop()
        return hello, found

    return talk(build.Script.of(recording), conversation, start=False, model=model)


def test_slips_are_in_the_documents():
    """Each when it begins and when it ends, with the distance that the estimates have."""
    recording, model = build.grasp(), with_slip_rule("thumb")
    hello, found = documents_of(recording, model)
    thresholds = {name: finger["slip_threshold"] for name, finger in hello["fingers"].items()}
    assert thresholds == {"thumb": 0.7, "index": None, "middle": None}
    trace = detect(model, recording).fingers["thumb"]
    slips = [slip for one in found for slip in one["slips"]]
    slides = trace.slip_distance > 0
    assert slides.any()
    expected = []
    for start, end in runs(slides):
        slip = {"finger": "thumb", "begin": trace.times[start]}
        begins = slip | {"end": None, "distance": trace.slip_distance[start]}
        ends = slip | {"end": trace.times[end], "distance": trace.slip_distance[end - 1]}
        expected += [begins, ends]
    assert [{key: slip[key] for key in expected[0]} for slip in slips] == expected
    series = [one["series"]["fingers"] for one in found]
    for field in ("slip_probability", "slip_speed"):
        got = [x for one in series for x in one["thumb"][field]]
        np.testing.assert_array_equal(np.array(got, dtype=float), getattr(trace, field))
        assert {x for one in series for x in one["index"][field]} == {None}
    fingers = [one["fingers"] for one in found if one["fingers"]]
    assert {finger["index"]["slip_probability"] for finger in fingers} == {None}


def test_the_errors_of_a_tuned_model_are_in_the_first_document():
    points = (ThresholdPoint(0.5, 2.0, 10.0), ThresholdPoint(0.9, 0.5, None))
    choice = Choice(1.0, 0.5, None, 0, 1.0, points=points)
    tuned = build.model().changed(lambda part: part.with_heads(part.stable.at(0.9, choice)))
    found = [msgspec.structs.astuple(one) for one in operating_points(tuned)]
    assert found == [(0.5, 2.0, 10.0), (0.9, 0.5, None)]
    assert operating_points(build.model()) == []


def test_documents_have_every_sample_once_and_the_newest_values():
    recording = build.grasp()
    _, found = documents_of(recording, None)
    for document in found:
        msgspec.convert(document, schema.LiveDocument, strict=False)
    expected = detect(build.model(), recording)
    times = [t for one in found for t in one["series"]["times"]]
    assert times == expected.times.tolist()
    for name, trace in expected.fingers.items():
        series = [one["series"]["fingers"][name] for one in found]
        states = [s for one in series for s in one["state"]]
        assert states == trace.state.tolist()
        sigma = np.array([x for one in series for x in one["instability"]], dtype=float)
        np.testing.assert_array_equal(sigma, trace.instability)
        force = np.concatenate([np.array(one["force"], dtype=float) for one in series], axis=1)
        np.testing.assert_array_equal(force.T, trace.force)
    events = [event for one in found for event in one["events"] if event["finger"] == "hand"]
    assert {event["state"] for event in events} >= {"STABLE", "UNSTABLE", "NO_CONTACT"}
    last = found[-1]
    assert last["health"]["n_packets"] == len(times)
    assert np.shape(last["fingers"]["index"]["taxels"]) == (30, 3)


def test_clients_that_do_not_read_delay_no_other():
    recording = build.grasp()
    n = 900  # fewer than a queue has, so that the last client gets all

    async def work():
        source = patient(n, recording)
        async with served(source, start=False) as (client, session), AsyncExitStack() as stack:
            for _ in range(MAX_WEBSOCKETS_PER_ADDRESS - 1):  # and never read
                await stack.enter_async_context(client.ws_connect("/api/v1/estimates"))
            good = await stack.enter_async_context(client.ws_connect("/api/v1/estimates"))
            await good.receive_json()
            session.start()
            found = [await good.receive_json() for _ in range(n)]
            session.stop()
            return found, session.latency()

    found, latency = run(work())
    assert [one["time"] for one in found] == recording.modules["thumb"].times[:n].tolist()
    states = [msgspec.convert(one, schema.EstimateDocument, strict=False).hand for one in found]
    assert [state.code for state in states] == detect(build.model(), recording).hand[:n].tolist()
    assert set(found[-1]["fingers"]) == set(build.FINGERS)
    assert latency.p50 < 1.0  # an estimate does not wait for a socket


@pytest.mark.parametrize(("n", "status"), [(60, 200), (600, 409)], ids=["open", "contact"])
def test_the_tare_is_refused_in_contact(n, status):
    async def conversation(client, session, socket, hello):
        await wait_for(lambda: session.n_packets >= n)
        return (await reply(client, "POST", "tare"))[0]

    recording = build.grasp()
    source = build.Lasting.of(recording, build.arrivals_of(recording)[:n], patient=True)
    assert talk(source, conversation) == status


def test_a_recording_with_a_marker(tmp_path):
    recording = build.grasp()
    begin = {"method": "POST", "path": "recording", "json": {"name": "mine"}}
    mark = {"method": "POST", "path": "markers", "json": {"text": "closing"}}
    end = {"method": "DELETE", "path": "recording"}
    source = patient(100, recording)

    async def conversation(client, session, socket, hello):
        await wait_for(lambda: session.n_packets == 100)
        found = [await reply(client, **one) for one in (mark, end, begin, begin)]
        source.steps.extend(build.arrivals_of(recording)[100:300])
        await wait_for(lambda: session.n_packets == 300)
        return found + [await reply(client, **one) for one in (mark, end, begin)]

    found = talk(source, conversation, folder=tmp_path)
    assert [status for status, _ in found] == [409, 409, 200, 409, 200, 200, 409]
    assert found[2][1]["path"] == found[5][1]["path"] == str(tmp_path / "mine.mcap")
    assert all("mine.mcap" in found[k][1]["error"] for k in (3, 6))
    found = load_recording(tmp_path / "mine.mcap")
    assert found.complete
    assert [text for _, text in found.markers] == ["closing"]
    for name, module in recording.modules.items():
        np.testing.assert_array_equal(found.modules[name].readings, module.readings[100:300])
        np.testing.assert_array_equal(found.modules[name].times, module.times[100:300])


def test_recordings_that_cannot_be_made(tmp_path):
    (tmp_path / "file").touch()
    inside = tmp_path / "file" / "folder"
    begin, end = ("POST", "recording", {"name": "mine"}), ("DELETE", "recording")
    for folder, requests, text in (
        (None, [begin], "--record-to FOLDER"),
        (inside, [begin], str(inside)),
        (tmp_path, [begin, end], str(tmp_path / "mine.mcap")),
    ):
        status, answer = replies(*requests, n=0, folder=folder)[-1]
        assert status == 409
        assert text in answer["error"]
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    ((status, _),) = replies(("POST", "recording", {"name": ""}), folder=tmp_path)
    assert status == 200  # its name is the date and time


def test_a_recording_that_cannot_be_written_ends_with_a_notice(tmp_path):
    async def conversation(client, session, socket, hello):
        await wait_for(lambda: session.n_packets == 100)
        assert (await reply(client, "POST", "recording", json={"name": "mine"}))[0] == 200
        (tmp_path / "mine.mcap").unlink()
        document = await next_with_notice(socket)
        (notice,) = document["notices"]
        while document["recording"] is not None:
            document = await socket.receive_json()
        return notice["text"]

    notice = talk(patient(100), conversation, folder=tmp_path)
    assert str(tmp_path / "mine.mcap") in notice


async def next_with_notice(socket):
    while not (document := await socket.receive_json())["notices"]:
        pass
    return document


def test_the_threshold_is_changed_and_noticed():
    async def conversation(client, session, socket, hello):
        assert await reply(client, "POST", "threshold", json={"value": 0.75}) == (200, {})
        changed = await next_with_notice(socket)
        assert (await reply(client, "DELETE", "threshold"))[0] == 200
        return hello, changed, await next_with_notice(socket)

    reports, recording = [], build.grasp()
    source = build.Lasting.of(recording, build.arrivals_of(recording)[:100], patient=True)
    hello, changed, restored = talk(source, conversation, reports=reports)
    own = hello["fingers"]["thumb"]["probability_threshold"]
    assert changed["thresholds"] == dict.fromkeys(build.FINGERS, 0.75)
    assert restored["thresholds"] == dict.fromkeys(build.FINGERS, own)
    texts = [document["notices"][0]["text"] for document in (changed, restored)]
    assert texts == reports
    assert "0.75" in texts[0]


REFUSED = {
    ("recording", 409): ["../up", "a/b", ".hidden", "x" * 200],
    ("recording", 400): [b"{", b"[" * 50_000, b"[]", b'{"name": 3}', b'{"nam": "a"}'],
    ("threshold", 400): [b"{}", b'{"value": 1.5}', b'{"value": null}', b'{"value": "a"}'],
}


def test_invalid_requests_are_refused_and_change_nothing(tmp_path):
    async def conversation(client, session, socket, hello):
        for (path, status), bodies in REFUSED.items():
            for body in bodies:
                data = body if status == 400 else msgspec.json.encode({"name": body})
                found, answer = await reply(client, "POST", path, data=data)
                assert (found, list(answer)) == (status, ["error"]), body[:50]
        return set(session.stream.thresholds.values())

    own = {build.model().finger("thumb").stable.threshold}
    assert talk(patient(10), conversation, folder=tmp_path) == own
    assert list(tmp_path.iterdir()) == []


def test_a_fault_that_lasts_is_a_problem_and_a_notice():
    async def conversation(client, session, socket, hello):
        session.start()
        document, notices = {"problems": []}, []
        while not document["problems"]:
            document = await socket.receive_json()
            notices += document["notices"]
        session.stop()
        return hello, document, notices

    recording = build.grasp()
    late = [x._replace(faults={"thumb": (Fault.LATE,)}) for x in build.arrivals_of(recording)]
    source = build.Script.of(recording, late[:400], patient=True)
    hello, document, notices = talk(source, conversation, start=False)
    (problem,) = document["problems"]
    assert (problem["fault"], problem["fingers"]) == ("late", ["thumb"])
    assert hello["faults"]["late"]["advice"] in problem["text"]
    assert [notice["text"] in problem["text"] for notice in notices] == [True]
    assert set(hello["faults"]) == set(map(str, Fault))
    assert hello["debounce"] == {"min_duration": 0.0, "hysteresis": 0.1, "hold": 0.1}


def test_faulty_taxels_are_numbers_from_1():
    hand = estimates.estimate()
    assert hand.fingers["thumb"].faulty_taxels == (3, 7)  # indices
    document = msgspec.to_builtins(finger_document(hand.fingers["thumb"]))
    assert document["faulty_taxels"] == (4, 8)


def test_the_service_is_guarded():
    """By what `tests/web/test_guard.py` tests: hosts, origins and the token."""

    async def work():
        found = []
        async with served(patient(10), token="long-secret") as (client, _):
            for words in (
                {},
                {"headers": {"Authorization": "Bearer long-secret"}},
                {"params": {"token": "long-secret"}},
                {"params": {"token": "long-secret"}, "headers": {"Host": "evil.example"}},
                {"params": {"token": "long-secret"}, "headers": {"Origin": "null"}},
            ):
                async with client.get("/api/v1/info", **words) as answer:
                    found.append(answer.status)
            with pytest.raises(WSServerHandshakeError):
                await client.ws_connect("/api/v1/live")
            async with client.ws_connect("/api/v1/live?token=long-secret") as socket:
                assert (await socket.receive_json())["type"] == "hello"
            async with client.get("/") as answer:
                assert answer.status == 200  # the page itself holds no secret
        return found

    assert run(work()) == [401, 200, 200, 403, 403]


@pytest.mark.parametrize(("limit", "n"), [("MAX_WEBSOCKETS", 2), ("MAX_WEBSOCKETS_PER_ADDRESS", 1)])
def test_too_many_websockets_are_refused(monkeypatch, limit, n):
    monkeypatch.setattr(f"holdfast.live.web.service.{limit}", n)

    async def work():
        async with served(patient(10)) as (client, _), AsyncExitStack() as stack:
            for _ in range(n):
                await stack.enter_async_context(client.ws_connect("/api/v1/live"))
            async with client.get("/api/v1/live") as answer:
                assert answer.status == 503
                assert (await answer.json())["error"].startswith(f"{n} WebSockets ")
            async with client.get("/api/v1/info") as answer:
                assert answer.status == 200
            await stack.aclose()
            async with client.ws_connect("/api/v1/live") as socket:
                assert (await socket.receive_json())["type"] == "hello"

    run(work())


def test_the_page_loads_nothing_from_other_servers():
    async def conversation(client, session, socket, hello):
        for path in ("/page/main.js", "/web/uplot/uPlot.iife.min.js", "/web/style.css"):
            async with client.get(path) as answer:
                assert answer.status == 200
        async with client.get("/") as answer:
            return dict(answer.headers), await answer.text()

    headers, text = talk(patient(10), conversation)
    assert "default-src 'self'" in headers["Content-Security-Policy"]
    assert "https://" not in text


def test_the_schema_is_that_of_the_documents():
    ((_, document),) = replies(("GET", "schema"))
    assert {"HelloDocument", "LiveDocument", "EstimateDocument"} <= set(document["$defs"])
    assert {"begin", "end", "distance"} < set(document["$defs"]["SlipDocument"]["required"])
