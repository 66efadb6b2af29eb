import asyncio
from contextlib import asynccontextmanager

import msgspec
import pytest
from aiohttp import ClientSession, web

from holdfast.contact import ContactState
from holdfast.io import labels_path, load_labels, load_recording, save_labels
from holdfast.labelling.server.documents import RecordingDetails
from holdfast.labelling.server.service import LabellingService
from holdfast.labelling.server.workspace import Workspace
from holdfast.recordings import Label
from holdfast.synthetic import synthetic_recording
from holdfast.web.guard import Guard

from .build import FINGERS, NOW, made

PATIENCE = 60.0
HELD = {"start": 3.0, "end": 4.0, "state": "stable"}
SLIP = {"start": 4.0, "end": 4.5, "state": "unstable", "cause": "slip", "author": "eve"}


@asynccontextmanager
async def served(paths, token=None, **words):
    """A client of a service with these recordings."""
    workspace = Workspace(paths, author="ada", clock=lambda: NOW, **words)
    service = LabellingService(workspace, Guard("127.0.0.1", token))
    runner = web.AppRunner(service.app, shutdown_timeout=0.5)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", 0).start()
    url = f"http://127.0.0.1:{runner.addresses[0][1]}"
    try:
        async with ClientSession(base_url=url) as client:
            yield client
    finally:
        await runner.cleanup()


def run(work):
    return asyncio.run(asyncio.wait_for(work, PATIENCE))


def ask(paths, *requests, **words):
    """The status and the JSON of each request: (method, path) or (method, path, body)."""

    async def work():
        found = []
        async with served(paths, **words) as client:
            for method, path, *body in requests:
                data = {"json": body[0]} if body and not isinstance(body[0], bytes) else {}
                data = {"data": body[0]} if body and isinstance(body[0], bytes) else data
                async with client.request(method, path, **data) as answer:
                    found.append((answer.status, await answer.json()))
        return found

    return run(work())


def labels(*thumb, revision="none", **words):
    given = {"labels": {"thumb": list(thumb)}, "note": "", "author": "", **words}
    return ("PUT", "/api/v1/recordings/0/labels", {**given, "revision": revision})


OPEN = ("GET", "/api/v1/recordings/0")
LIST = ("GET", "/api/v1/recordings")
PROPOSE = ("POST", "/api/v1/recordings/0/propose", {"rule": "signal", "parameters": {}})


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
def test_a_recording_is_opened(tmp_path, suffix):
    path = made(tmp_path, suffix=suffix, markers=((2.0, "closing"),))
    recording = load_recording(path)
    (_, listed), (status, reply) = ask([path], LIST, OPEN)
    (entry,) = listed["recordings"]
    assert (listed["schema"], listed["author"]) == ("holdfast.label/1", "ada")
    assert entry.pop("duration") == pytest.approx(recording.duration, rel=0.01)
    assert entry == {
        "id": 0, "name": "grasp", "fingers": ["thumb", "index"], "labelled": False,
        "n_labels": 0, "n_proposals": 0, "n_doubtful": 0, "error": None,
    }  # fmt: skip
    assert status == 200
    details = msgspec.convert(reply, RecordingDetails)
    assert (details.name, details.start, details.end) == ("grasp", 0.0, recording.end)
    assert dict(details.unit) == {"thumb": "count", "index": "count"}
    assert reply["labels"] == {"thumb": [], "index": []}
    assert reply["markers"] == [[2.0, "closing"]]
    assert (reply["origin"], reply["revision"], reply["read_only"]) == ("none", "none", False)


def test_signals_of_a_recording(tmp_path):
    path = made(tmp_path)
    part = "/api/v1/recordings/0/signals"
    whole, near, changes = ask(
        [path],
        ("GET", f"{part}?points=100"),
        ("GET", f"{part}?start=3.0&end=3.5&points=1200"),
        ("GET", "/api/v1/recordings/0/changes"),
    )
    assert [status for status, _ in (whole, near, changes)] == [200] * 3
    assert (whole[1]["exact"], near[1]["exact"]) == (False, True)
    assert set(near[1]["fingers"]["thumb"]) == {"t", "F_a", "F_x", "F_y", "F_z", "sigma"}
    for finger in FINGERS:  # closing, held, shaken, held, let go, free
        found = changes[1]["fingers"][finger]
        assert found == pytest.approx([1.5, 2.3, 5.3, 6.5, 9.5, 10.0], abs=0.06)


def test_labels_are_saved_and_returned(tmp_path):
    path = made(tmp_path)
    (status, saved), (_, reply), (_, listed) = ask(
        [path], labels(SLIP, HELD, note="good", author="bob"), OPEN, LIST
    )
    assert status == 200
    assert saved == {"revision": reply["revision"], "time": NOW}
    assert reply["labels"]["thumb"] == [
        {**HELD, "cause": None, "evidence": "", "confidence": 1.0, "author": "bob"},
        {**SLIP, "evidence": "", "confidence": 1.0},
    ]
    assert (reply["note"], reply["author"], reply["time"]) == ("good", "bob", NOW)
    assert reply["origin"] == "file"
    entry = listed["recordings"][0]
    assert (entry["labelled"], entry["n_labels"]) == (True, 2)
    file = load_labels(labels_path(path))
    assert (file.author, file.notes, file.time) == ("bob", "good", NOW)
    assert [label.author for label in load_recording(path).modules["thumb"].labels] == [
        "bob", "eve",
    ]  # fmt: skip


def test_the_last_sample_of_every_finger_can_be_labelled(tmp_path):
    whole = synthetic_recording("grasp", 0, FINGERS)
    shorter = whole.modules["index"].slice(10, -10)  # begins later and ends earlier
    path = made(tmp_path, modules={**whole.modules, "index": shorter})
    end = whole.end + 1 / whole.rate
    given = {name: [{"start": 0.0, "end": end, "state": "stable"}] for name in FINGERS}
    ((status, _),) = ask([path], labels(labels=given))
    assert status == 200
    for module in load_recording(path).modules.values():
        assert (module.label_states == ContactState.STABLE.code).all()


def test_two_pages_on_one_file(tmp_path):
    path = made(tmp_path)
    first, second, reply = ask([path], labels(HELD), labels(SLIP), OPEN)
    assert first[0] == 200
    assert (second[0], second[1]["revision"]) == (409, first[1]["revision"])
    assert "grasp.labels.json" in second[1]["error"]
    assert [each["state"] for each in reply[1]["labels"]["thumb"]] == ["stable"]


def proposal(**body):
    return (*PROPOSE[:2], body)


SIGNALS, LABELS = (f"/api/v1/recordings/0/{what}" for what in ("signals", "labels"))
REFUSED = [
    (("GET", f"{SIGNALS}?start=x"), 422, "'x'"),
    (("GET", f"{SIGNALS}?points=1"), 422, "1 given"),
    (labels(HELD, {**SLIP, "start": 3.9}), 422, "thumb: "),
    (labels({**HELD, "state": "firm"}), 422, "'firm'"),
    (labels({**HELD, "colour": "red"}), 422, "`colour`"),
    (("PUT", LABELS, {"labels": {"toe": [HELD]}, "revision": "none"}), 422, "toe"),
    (("PUT", LABELS, b"{"), 422, LABELS),
    (labels({**HELD, "end": 1e308 * 10}), 422, LABELS),
    (proposal(rule="magic"), 422, "'magic'"),
    (proposal(rule="tracking"), 422, "'grasp'"),
    (proposal(parameters={"tare": "soon"}), 422, "tare"),
    (proposal(rule="tracking", parameters={"tracking": "/etc/passwd"}), 422, "'tracking'"),
    (proposal(parameters={"delay": 1.0}), 422, "delay"),
    (proposal(rule="command", parameters={"delay": "x"}), 422, ""),
    *((proposal(parameters={"window": x}), 422, "window") for x in (1e18, 9e8, 0, [])),
    (proposal(rules="signal"), 422, "`rules`"),
    ((*PROPOSE[:2], b'{"parameters": {"delay": ' + b"[" * 100_000), 400, "/propose"),
    (("GET", "/api/v1/recordings/1"), 404, "1 given"),
    (("GET", "/media/1/0"), 404, "1 given"),
]


@pytest.mark.parametrize(("request_", "status", "text"), REFUSED)
def test_requests_that_are_refused_change_nothing(tmp_path, request_, status, text):
    path = made(tmp_path, markers=((2.0, "closing"),))
    found, (_, opened) = ask([path], request_, OPEN)
    assert found[0] == status
    assert text in found[1]["error"]
    assert "\n" not in found[1]["error"]
    assert (opened["revision"], opened["proposals"]) == ("none", {})
    assert not labels_path(path).exists()


def test_recordings_that_cannot_be_read_are_listed(tmp_path):
    good, cut, gone = made(tmp_path), tmp_path / "cut.parquet", tmp_path / "gone.mcap"
    cut.write_bytes(good.read_bytes()[:1000])
    (_, listed), opened, drawn = ask(
        [cut, gone, good], LIST, OPEN, ("GET", "/api/v1/recordings/0/signals")
    )
    errors = [each["error"] for each in listed["recordings"]]
    assert "cut.parquet" in errors[0]
    assert "gone.mcap" in errors[1]
    assert errors[2] is None
    assert (opened[0], drawn[0]) == (422, 422)
    assert opened[1]["error"] == errors[0]


def test_a_file_that_may_only_be_read(tmp_path):
    path = made(tmp_path)
    ask([path], labels(HELD))
    labels_path(path).chmod(0o444)
    (_, reply), saved = ask([path], OPEN, labels())
    assert reply["read_only"] is True
    assert saved[0] == 403


def test_proposals_are_made_kept_and_counted(tmp_path):
    path = made(tmp_path)
    (_, none), (status, reply), (_, opened), (_, listed) = ask([path], OPEN, PROPOSE, OPEN, LIST)
    assert none["proposals"] == {}
    assert status == 200
    assert reply["rule"] == "signal"
    assert opened["proposals"] == reply["proposals"]
    assert opened["doubtful"] == reply["doubtful"]
    states = {each["state"] for each in reply["proposals"]["thumb"]}
    assert states == {"stable", "unstable", "no_contact"}
    assert {each["author"] for each in reply["proposals"]["index"]} == {"rule:signal"}
    sure = [each["confidence"] for each in reply["doubtful"]]
    assert sure == sorted(sure)
    entry = listed["recordings"][0]
    assert entry["n_proposals"] == sum(map(len, reply["proposals"].values()))
    assert entry["n_doubtful"] == len(sure)


def test_proposals_that_are_labelled_are_done(tmp_path):
    path = made(tmp_path)

    async def work():
        async with served([path]) as client:
            method, url, body = PROPOSE
            async with client.request(method, url, json=body) as answer:
                reply = await answer.json()
            method, url, body = labels(*reply["proposals"]["thumb"])
            async with client.request(method, url, json=body) as answer:
                assert answer.status == 200
            async with client.get("/api/v1/recordings") as answer:
                return reply, await answer.json()

    reply, listed = run(work())
    assert listed["recordings"][0]["n_proposals"] == len(reply["proposals"]["index"])
    authors = {label.author for label in load_recording(path).modules["thumb"].labels}
    assert authors == {"rule:signal"}


def test_doubtful_labels_of_a_file_are_returned(tmp_path):
    path = made(tmp_path)
    sure, unsure = (
        Label(k, k + 1, ContactState.STABLE, confidence=c) for k, c in ((2, 0.9), (4, 0.3))
    )
    save_labels(load_recording(path).with_labels({"thumb": [sure, unsure]}), path)
    _, reply = ask([path], OPEN)[0]
    assert reply["doubtful"] == [
        {"finger": "thumb", "start": 4.0, "end": 5.0, "state": "stable", "confidence": 0.3}
    ]


def test_videos_beside_the_recording_and_nothing_else(tmp_path):
    folder = tmp_path / "inside"
    folder.mkdir()
    (tmp_path / "secret.txt").write_text("secret")
    (folder / "wrist.mp4").write_bytes(bytes(range(256)))
    (folder / "link.mp4").symlink_to(tmp_path / "secret.txt")
    names = ("wrist.mp4", "gone.mp4", "../secret.txt", str(tmp_path / "secret.txt"), "link.mp4", "")
    path = made(folder, media=tuple((name, 1.25) for name in names))

    async def work():
        async with served([path]) as client:
            async with client.get("/api/v1/recordings/0") as answer:
                media = (await answer.json())["media"]
            found = []
            for index in range(7):
                async with client.get(f"/media/0/{index}") as answer:
                    found.append((answer.status, await answer.read()))
            headers = {"Range": "bytes=10-19"}
            async with client.get("/media/0/0", headers=headers) as answer:
                return media, found, (answer.status, await answer.read())

    media, found, part = run(work())
    assert media[0] == {"index": 0, "name": "wrist.mp4", "offset": 1.25, "missing": False}
    assert [each["missing"] for each in media] == [False, True, True, True, True, True]
    assert found[0] == (200, bytes(range(256)))
    assert [status for status, _ in found[1:]] == [404] * 6
    assert all(b"secret" not in body for _, body in found)
    assert part == (206, bytes(range(10, 20)))


@pytest.mark.parametrize(
    ("path", "exists"),
    [
        ("/", True),
        ("/page/main.js", True),
        ("/web/style.css", True),
        ("/page/../service.py", False),
    ],
)
def test_the_files_of_the_page_and_no_others(tmp_path, path, exists):
    async def work():
        async with served([made(tmp_path)]) as client, client.get(path) as answer:
            return answer.status

    assert (run(work()) == 200) is exists


def test_other_origins_and_those_without_the_token_are_refused(tmp_path):
    async def work():
        async with served([made(tmp_path)], token="long-secret") as client:
            token, found = {"Authorization": "Bearer long-secret"}, []
            for headers in ({}, token, {**token, "Origin": "http://evil.example"}):
                async with client.get("/api/v1/recordings", headers=headers) as answer:
                    found.append(answer.status)
            return found

    assert run(work()) == [401, 200, 403]
