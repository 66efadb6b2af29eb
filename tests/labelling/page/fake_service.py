"""A fake service of the labelling page: its recordings are in memory, and a test controls it."""

import asyncio
from importlib import resources
from pathlib import Path

import msgspec
import numpy as np
from aiohttp import web

from browser import PageService
from holdfast.labelling.server.signals import FingerSignals, Signals
from holdfast.recordings import Tactile
from holdfast.sensors import sensor

FINGERS = ("thumb", "index", "middle", "ring")
RATE = 150.0
NOW = "2026-01-02T03:04:05+00:00"


def label(start, end, state, cause=None, **fields):
    """Return a label as in the JSON of the service."""
    defaults = {"evidence": "", "confidence": 1.0, "author": ""}
    return {"start": start, "end": end, "state": state, "cause": cause, **defaults, **fields}


def made_up(seconds, fingers):
    """Return signals of fingers that grasp, are disturbed, and release."""
    times = np.arange(round(seconds * RATE)) / RATE
    phase = times / times[-1]
    press = np.clip((phase - 1 / 6) * 12, 0, 1) * (1 - np.clip((phase - 5 / 6) * 24, 0, 1))
    shake = np.exp(-(((phase - 0.5) / 0.03) ** 2)) * np.sin(40 * times)
    load = (400 * press + 40 * shake)[:, None, None] * [0.1, 0.1, 1.0]
    found = {}
    for seed, finger in enumerate(fingers):
        noise = np.random.default_rng(seed).normal(0, 2, (len(times), 5, 3))
        found[finger] = FingerSignals(Tactile(sensor("anyskin"), times, load + noise))
    return Signals(0.0, float(times[-1]), found)


class Recording:
    """A recording with its label file.

    Args:
        name: name of the recording.
        seconds: duration [s].
        fingers: names of the fingers.
        fields: fields of the reply to the page that replace the defaults.
    """

    def __init__(self, name="grasp", seconds=30.0, fingers=FINGERS, **fields):
        self.name, self.fingers = name, list(fingers)
        self.signals = made_up(seconds, fingers)
        self.end = self.signals.end
        self.changes = {
            finger: [round(part * self.end / 12, 3) for part in (2, 3, 6, 10)] for finger in fingers
        }
        self.file = {
            "labels": {finger: [] for finger in fingers}, "note": "", "author": "", "time": "",
            "origin": "none",
        }  # fmt: skip
        self.version = 0
        self.fields = {"proposals": {finger: [] for finger in fingers}, **fields}
        self.rule_proposals = {}  # reply to the next request for proposals

    def describe(self, index):
        """Return the reply to a page that opens the recording."""
        return {
            "id": index, "name": self.name, "start": 0.0, "end": self.end, "rate": RATE,
            "fingers": self.fingers, "unit": dict.fromkeys(self.fingers, "count"),
            "doubtful": [], "markers": [], "media": [], "read_only": False,
            "revision": f"r{self.version}", **self.file, **self.fields,
        }  # fmt: skip

    def entry(self, index):
        """Return the entry in the list of recordings."""
        n = sum(map(len, self.file["labels"].values()))
        return {
            "id": index, "name": self.name, "duration": self.end, "fingers": self.fingers,
            "labelled": self.file["origin"] == "file", "n_labels": n, "n_proposals": 0,
            "n_doubtful": 0, "error": None,
        }  # fmt: skip

    def save(self, labels, note="", author="eve"):
        """Write the label file, as the page or another program does."""
        self.version += 1
        self.file = {"labels": labels, "note": note, "author": author, "time": NOW,
                     "origin": "file"}  # fmt: skip
        return {"revision": f"r{self.version}", "time": NOW}


class FakeService(PageService):
    """Fake service of recordings."""

    folder = Path(str(resources.files("holdfast.labelling"))) / "page"

    def __init__(self, *recordings, port=0, media=None):
        super().__init__(port)
        self.recordings = recordings or (Recording(),)
        self.media = media  # path of the file that is sent for every video
        self.saves = []  # bodies of the save requests
        self.requests = []  # (start, end, points) of the requests for signals
        self.propose_requests = []
        self.refusal = None  # (status, text) of the reply to every save
        self.delays = []  # delays of the next replies with signals [s]

    def routes(self):
        all_of_them = "/api/v1/recordings"
        one = all_of_them + r"/{id:\d+}"
        return [
            ("GET", all_of_them, self.list), ("GET", one, self.open),
            ("GET", one + "/signals", self.signals), ("GET", one + "/changes", self.changes),
            ("PUT", one + "/labels", self.save), ("POST", one + "/propose", self.propose),
            ("GET", r"/media/{id:\d+}/{index:\d+}", self.video),
        ]  # fmt: skip

    def recording(self, request):
        return self.recordings[int(request.match_info["id"])]

    async def list(self, _):
        entries = [each.entry(index) for index, each in enumerate(self.recordings)]
        answer = {"schema": "holdfast.label/1", "author": "ada", "recordings": entries}
        return web.json_response(answer)

    async def open(self, request):
        return web.json_response(self.recording(request).describe(int(request.match_info["id"])))

    async def signals(self, request):
        start, end, points = (float(request.query[key]) for key in ("start", "end", "points"))
        self.requests.append((start, end, points))
        if self.delays:
            await asyncio.sleep(self.delays.pop(0))
        part = self.recording(request).signals.part(start, end, points)
        return web.Response(body=msgspec.json.encode(part), content_type="application/json")

    async def changes(self, request):
        return web.json_response({"fingers": self.recording(request).changes})

    async def save(self, request):
        recording, body = self.recording(request), await request.json()
        self.saves.append(body)
        if self.refusal:
            status, text = self.refusal
            return web.json_response({"error": text}, status=status)
        if body["revision"] != f"r{recording.version}":
            answer = {"error": "changed by another program", "revision": f"r{recording.version}"}
            return web.json_response(answer, status=409)
        return web.json_response(recording.save(body["labels"], body["note"], body["author"]))

    async def propose(self, request):
        self.propose_requests.append(await request.json())
        proposals = self.recording(request).rule_proposals
        answer = {"proposals": proposals} if proposals else {"error": "there are no poses"}
        return web.json_response(answer, status=200 if proposals else 422)

    async def video(self, _):
        if self.media is None:
            return web.json_response({"error": "there is no such video"}, status=404)
        return web.FileResponse(self.media)
