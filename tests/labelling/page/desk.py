"""A service of the label page that is none: recordings in memory, and what a test wants of it.

By hand, to look at the page: `PYTHONPATH=tests python -m labelling.page.desk [PORT]`.
"""

import asyncio
import contextlib
import sys
import threading
from importlib import resources
from pathlib import Path

import numpy as np
from aiohttp import web

from holdfast.web.guard import SECURITY_HEADERS

PAGE = Path(str(resources.files("holdfast.labelling"))) / "page"
SHARED = Path(str(resources.files("holdfast.web"))) / "static"
SERIES = ("F_a", "F_x", "F_y", "F_z", "sigma")
FINGERS = ("thumb", "index", "middle", "ring")
RATE = 150.0
NOW = "2026-01-02T03:04:05+00:00"


def label(start, end, state, cause=None, **words):
    """A label as the contract has it."""
    own = {"evidence": "", "confidence": 1.0, "author": ""}
    return {"start": start, "end": end, "state": state, "cause": cause, **own, **words}


def signals(n, seed):
    """Times, and force and sigma: closes at a sixth of the time, is shaken half way, lets go."""
    rng = np.random.default_rng(seed)
    times = np.arange(n) / RATE
    share = times / times[-1]
    press = np.clip((share - 1 / 6) * 12, 0, 1) * (1 - np.clip((share - 5 / 6) * 24, 0, 1))
    shake = np.exp(-(((share - 0.5) / 0.03) ** 2)) * np.sin(40 * times)
    force = np.stack([300 * press + 200 * shake, 200 * press, 2000 * press + 150 * shake])
    force += rng.normal(0, 4, force.shape)
    sigma = 3 + 100 * np.abs(shake) + rng.exponential(0.5, n)
    return times, np.vstack([np.linalg.norm(force, axis=0), force, sigma])


class Recording:
    """One recording of the list, and the label file beside it.

    Args:
        name: of the recording.
        seconds: how long it is.
        fingers: their names.
        words: fields of what the page is told, to be other than usual.
    """

    def __init__(self, name="grasp", seconds=30.0, fingers=FINGERS, **words):
        self.name, self.fingers = name, list(fingers)
        n = round(seconds * RATE)
        self.signals = {finger: signals(n, seed) for seed, finger in enumerate(fingers)}
        self.end = (n - 1) / RATE
        self.changes = {
            finger: [round(part * self.end / 12, 3) for part in (2, 3, 6, 10)] for finger in fingers
        }
        self.file = {
            "labels": {finger: [] for finger in fingers}, "note": "", "author": "", "time": "",
            "origin": "none",
        }  # fmt: skip
        self.version = 0
        self.words = {"proposals": {finger: [] for finger in fingers}, **words}
        self.offered = {}  # what a rule will propose

    def told(self, place):
        """What the page is told when it opens the recording."""
        return {
            "id": place, "name": self.name, "start": 0.0, "end": self.end, "rate": RATE,
            "fingers": self.fingers, "unit": dict.fromkeys(self.fingers, "count"),
            "suspects": [], "doubtful": [], "markers": [], "media": [], "read_only": False,
            "revision": f"r{self.version}", **self.file, **self.words,
        }  # fmt: skip

    def entry(self, place):
        """The recording in the list."""
        n = sum(map(len, self.file["labels"].values()))
        return {
            "id": place, "name": self.name, "duration": self.end, "fingers": self.fingers,
            "labelled": self.file["origin"] == "file", "n_labels": n, "n_proposals": 0,
            "n_doubtful": 0, "error": None,
        }  # fmt: skip

    def save(self, labels, note="", author="eve"):
        """Writes the label file, as somebody else would."""
        self.version += 1
        self.file = {"labels": labels, "note": note, "author": author, "time": NOW,
                     "origin": "file"}  # fmt: skip
        return {"revision": f"r{self.version}", "time": NOW}

    def draw(self, start, end, points):
        """The series between two times: every sample, or the least and the most of each few."""
        exact, fingers = True, {}
        for finger, (times, values) in self.signals.items():
            first = max(0, np.searchsorted(times, start) - 1)
            part = slice(first, np.searchsorted(times, end, side="right") + 1)
            own, found = times[part], values[:, part]
            if len(own) > 2 * points:
                exact = False
                n = -(-len(own) // points)
                edges = np.arange(0, len(own), n)
                low = np.minimum.reduceat(found, edges, axis=1)
                high = np.maximum.reduceat(found, edges, axis=1)
                middles = own[np.minimum(edges + n // 2, len(own) - 1)]
                own = np.stack([own[edges], middles], axis=1).ravel()
                found = np.stack([low, high], axis=2).reshape(len(SERIES), -1)
            columns = {name: row.tolist() for name, row in zip(SERIES, found, strict=True)}
            fingers[finger] = {"t": own.tolist(), **columns}
        return {"start": start, "end": end, "exact": exact, "fingers": fingers}


class Desk:
    """The service on a port of its own, in a thread of its own."""

    def __init__(self, *recordings, port=0, media=None):
        self.recordings = recordings or (Recording(),)
        self.port = port
        self.media = media  # path of every video
        self.puts = []  # bodies that the page sent
        self.asked = []  # (start, end, points) of signals
        self.proposed = []
        self.refusal = None  # (status, text) that every save is answered with
        self.delay = []  # seconds to wait before the next answers with signals

    def __enter__(self):
        ready = threading.Event()
        self.thread = threading.Thread(target=lambda: asyncio.run(self.run(ready)))
        self.thread.start()
        if not ready.wait(20):
            raise RuntimeError("the fake service did not start")
        return self

    def __exit__(self, *_):
        self.loop.call_soon_threadsafe(self.done.set)
        self.thread.join(20)

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}/"

    async def run(self, ready):
        self.loop, self.done = asyncio.get_running_loop(), asyncio.Event()
        runner = web.AppRunner(self.app(), shutdown_timeout=0.2)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", self.port).start()
        self.port = runner.addresses[0][1]
        ready.set()
        await self.done.wait()
        await runner.cleanup()

    def app(self):
        app = web.Application(middlewares=[self.guard])
        one = r"/api/v1/recordings/{id:\d+}"
        app.router.add_static("/page", PAGE)
        app.router.add_static("/web", SHARED)
        app.router.add_get("/", self.index)
        app.router.add_get("/api/v1/recordings", self.list)
        app.router.add_get(one, self.open)
        app.router.add_get(one + "/signals", self.draw)
        app.router.add_get(one + "/changes", self.change)
        app.router.add_put(one + "/labels", self.put)
        app.router.add_post(one + "/propose", self.propose)
        app.router.add_get(r"/media/{id:\d+}/{index:\d+}", self.video)
        return app

    @web.middleware
    async def guard(self, request, handler):
        answer = await handler(request)
        if not answer.prepared:
            answer.headers.update(SECURITY_HEADERS)
        return answer

    def of(self, request):
        return self.recordings[int(request.match_info["id"])]

    async def index(self, _):
        return web.FileResponse(PAGE / "index.html")

    async def list(self, _):
        entries = [each.entry(place) for place, each in enumerate(self.recordings)]
        answer = {"schema": "holdfast.label/1", "author": "ada", "recordings": entries}
        return web.json_response(answer)

    async def open(self, request):
        return web.json_response(self.of(request).told(int(request.match_info["id"])))

    async def draw(self, request):
        start, end, points = (float(request.query[key]) for key in ("start", "end", "points"))
        self.asked.append((start, end, points))
        if self.delay:
            await asyncio.sleep(self.delay.pop(0))
        return web.json_response(self.of(request).draw(start, end, int(points)))

    async def change(self, request):
        return web.json_response({"fingers": self.of(request).changes})

    async def put(self, request):
        recording, body = self.of(request), await request.json()
        self.puts.append(body)
        if self.refusal:
            status, text = self.refusal
            return web.json_response({"error": text}, status=status)
        if body["revision"] != f"r{recording.version}":
            answer = {"error": "changed by somebody else", "revision": f"r{recording.version}"}
            return web.json_response(answer, status=409)
        return web.json_response(recording.save(body["labels"], body["note"], body["author"]))

    async def propose(self, request):
        self.proposed.append(await request.json())
        offered = self.of(request).offered
        if not offered:
            return web.json_response({"error": "there are no poses"}, status=422)
        return web.json_response({"rule": "signal", "proposals": offered, "doubtful": []})

    async def video(self, _):
        if self.media is None:
            return web.json_response({"error": "there is no such video"}, status=404)
        return web.FileResponse(self.media)


def scene():
    """A recording with something of everything, to look at."""
    shown = Recording("can-case2-1", markers=[(5.0, "closing"), (7.5, "locked")])
    for finger in FINGERS:
        shown.file["labels"][finger] = [label(0, 5, "no_contact"), label(5, 7.5, "unstable")]
        shown.words["proposals"][finger] = [
            label(7.5, 14, "stable", confidence=0.95, author="rule:signal", evidence="settled"),
            label(14, 16, "unstable", "disturbance", confidence=0.6, author="rule:signal"),
        ]
    shown.words["suspects"] = [
        {"finger": "index", "start": 2.0, "end": 3.0, "given": "no_contact",
         "expected": "unstable", "confidence": 0.93, "kind": "interval"},
    ]  # fmt: skip
    return shown


if __name__ == "__main__":
    port = int(sys.argv[1]) if sys.argv[1:] else 8766
    with Desk(scene(), Recording("can-case2-2"), port=port) as desk:
        sys.stderr.write(f"{desk.url}\n")
        with contextlib.suppress(KeyboardInterrupt):
            desk.thread.join()
