"""A fake service of the live page: it plays a made-up grasp, and a test controls it."""

import asyncio
import contextlib
import json
import math
import time
from importlib import resources
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from aiohttp import WSCloseCode, web

from browser import PageService
from holdfast.contact import ContactState
from holdfast.live.fault_notices import FAULT_TEXTS
from holdfast.sensors import sensor

STATES = [state.value for state in ContactState]
FINGERS = ("thumb", "index", "middle", "ring")
PERIOD = 0.05


def made_up(names=FINGERS, layout="uskin-curved", rate=150.0):
    """Twelve seconds of a hand that grasps an object, holds it, and is disturbed twice."""
    n = int(12 * rate)
    times = np.arange(n) / rate
    layout = sensor(layout)
    tracks = {}
    for index, name in enumerate(names):
        rng = np.random.default_rng(index)
        press = np.clip((times - 2) / 0.8, 0, 1) * (1 - np.clip((times - 11) / 0.3, 0, 1))
        shake = sum(np.exp(-(((times - t) / 0.25) ** 2)) for t in (5 + 0.05 * index, 8.5))
        state = np.where(press <= 0, 1, np.where((press < 1) | (shake > 0.3), 2, 3))
        state[times < 0.6] = 0
        centre = layout.positions[index % layout.n_taxels]
        near = np.exp(-np.sum((layout.positions - centre) ** 2, axis=1) / 1e-4)
        load = 900 * (press + 0.2 * shake * np.sin(60 * times))[:, None, None] * [0.3, 0.2, 1.0]
        taxels = load * near[:, None] + rng.normal(0, 1, (n, len(near), 3))
        tracks[name] = SimpleNamespace(
            layout=layout, taxels=taxels, state=state,
            force=np.einsum("kij,nkj->ni", layout.rotations, taxels),
            sigma=np.where(state == 0, np.nan, 3 + 200 * shake + rng.exponential(0.5, n)),
            probability=np.where(state == 0, np.nan, np.where(state == 3, 0.95, 0.08)),
        )  # fmt: skip
    return times, tracks


def plain(values):
    """Replace NaN by None, because JSON has no NaN."""
    if isinstance(values, np.ndarray):
        return plain(values.tolist())
    if isinstance(values, list):
        return [plain(item) for item in values]
    return values if math.isfinite(values) else None


def hand_word(states):
    for state in ("UNSTABLE", "UNKNOWN"):
        if state in states:
            return state
    return "STABLE" if states.count("STABLE") >= min(2, len(states)) else "NO_CONTACT"


class Tape:
    """Make messages from tracks, repeated without end, with increasing times."""

    def __init__(self, times, tracks):
        self.times, self.tracks = times, tracks
        self.length = float(times[-1] + times[1])
        self.states = dict.fromkeys((*tracks, "hand"), "UNKNOWN")
        self.n_packets = 0
        self.change = {}  # finger -> fields to write over its part of a message
        self.slip_threshold = None  # without a slip rule
        self.slips_now = []  # slips of the next message
        self.hello_fields = {}  # fields that replace those of the first message

    def hello(self):
        fingers = {
            name: {
                "sensor": track.layout.name, "unit": track.layout.unit,
                "n_taxels": track.layout.n_taxels,
                "positions": track.layout.positions.tolist(),
                "rotations": track.layout.rotations.tolist(),
                "normal": track.layout.normal.tolist(),
                "contact_threshold": 60.0, "probability_threshold": 0.5,
                "slip_threshold": self.slip_threshold,
            }
            for name, track in self.tracks.items()
        }  # fmt: skip
        return {
            "schema": "holdfast.live/1", "type": "hello", "model": "builtin:twin",
            "source": "twin:?object=can&seed=1", "fingers": fingers,
            "modules": {name: track.layout.n_taxels for name, track in self.tracks.items()},
            "rate": 150.0, "started": time.time(), "can_record": True,
            "faults": {fault: text._asdict() for fault, text in FAULT_TEXTS.items()},
            "debounce": {"min_duration": 0.0, "hysteresis": 0.0, "hold": 0.1},
            "operating_points": [], "advice": [], **self.hello_fields,
        }  # fmt: skip

    def message(self, start, stop):
        """Message with the samples in [start, stop) [s]."""
        rounds = np.arange(start // self.length, stop // self.length + 1)
        clock = (self.times + self.length * rounds[:, None]).ravel()
        picks = np.flatnonzero((clock >= start) & (clock < stop))
        rows, now = picks % len(self.times), float(clock[picks[-1]])
        self.n_packets += len(rows)
        fingers = {name: self.finger(track, rows[-1]) for name, track in self.tracks.items()}
        for name, fields in self.change.items():
            fingers[name].update(fields)
        hand = hand_word([finger["state"] for finger in fingers.values()])
        series = {
            name: {
                "force": plain(track.force[rows].T),
                "instability": plain(track.sigma[rows]),
                "stable_probability": plain(track.probability[rows]),
                "state": track.state[rows].tolist(),
                "slip_probability": self.slips(track, rows),
                "slip_speed": [None] * len(rows),
            }
            for name, track in self.tracks.items()
        }
        states = {name: finger["state"] for name, finger in fingers.items()} | {"hand": hand}
        events = [
            {"finger": name, "state": state, "previous": self.states[name], "time": now}
            for name, state in states.items()
            if state != self.states[name]
        ]
        self.states, slips, self.slips_now = states, self.slips_now, []
        return {
            "type": "live", "time": now, "hand": hand, "fingers": fingers,
            "series": {"times": clock[picks].tolist(), "fingers": series},
            "events": events, "slips": slips, "notices": [],
            "health": {
                "rate": 149.9, "n_packets": self.n_packets, "n_lost": 0, "n_refused": 0,
                "n_dropped": 0, "silent": False,
                "latency": {"p50": 0.00021, "p99": 0.0013, "max": 0.011},
            },
            "recording": None, "ended": False,
        }  # fmt: skip

    def slips(self, track, rows):
        """Return a probability of a slip that is high where that of stability is low."""
        if self.slip_threshold is None:
            return [None] * len(rows)
        return plain(1 - track.probability[rows])

    def finger(self, track, k):
        state = int(track.state[k])
        return {
            "state": STATES[state], "reason": "" if state else "tare",
            "stable_probability": plain(float(track.probability[k])),
            "instability": plain(float(track.sigma[k])), "force": plain(track.force[k]),
            "faults": [], "faulty_taxels": [], "cause": None,
            "slip_probability": self.slips(track, [k])[0],
            "slip_speed": None, "slip_distance": None,
            "taxels": np.round(track.taxels[k], 1).tolist(),
        }  # fmt: skip


class Service(PageService):
    """Fake service that plays a tape."""

    folder = Path(str(resources.files("holdfast.live.web"))) / "page"

    def __init__(self, names=FINGERS, layout="uskin-curved", token=None, port=0):
        super().__init__(port)
        self.tape = Tape(*made_up(names, layout))
        self.token = token
        self.speed = 1.0
        self.at = 3.5  # time of the tape [s], when all fingers hold
        self.refusal = None  # error of every REST call
        self.calls = []  # (method, path, text) of the REST calls
        self.recording = None
        self.patch = {}  # fields that replace those of every message
        self.notices = []  # of the next message
        self.sockets = set()

    def change(self, **fields):
        """Write these fields over those of all fingers."""
        self.tape.change = dict.fromkeys(self.tape.tracks, fields)

    def routes(self):
        own = [("GET", "/api/v1/live", self.live), ("GET", "/api/v1/info", self.info)]
        return [*own, ("*", "/api/v1/{what}", self.act)]

    async def refused(self, request):
        given = request.headers.get("Authorization"), request.query.get("token")
        allowed = {(f"Bearer {self.token}", None), (None, self.token)}
        if request.path.startswith("/api") and self.token and given not in allowed:
            return web.json_response({"error": "token expected"}, status=401)
        if request.method == "GET":
            return None
        text = await request.text()
        self.calls.append((request.method, request.path.removeprefix("/api/v1/"), text))
        return self.refusal and web.json_response({"error": self.refusal}, status=409)

    async def info(self, _):
        return web.json_response(self.tape.hello())

    async def act(self, request):
        begins, what = request.method == "POST", request.match_info["what"]
        if what != "recording":
            return web.json_response({})
        kept = self.recording
        numbers = dict.fromkeys(("seconds", "n_bytes", "n_markers", "n_dropped"), 0)
        self.recording = {"path": "grasps/grasp-0007.mcap", **numbers} if begins else None
        return web.json_response(self.recording or kept)

    async def live(self, request):
        socket = web.WebSocketResponse()
        await socket.prepare(request)
        await socket.send_str(json.dumps(self.tape.hello()))
        self.sockets.add(socket)
        try:
            async for _ in socket:
                pass
        finally:
            self.sockets.discard(socket)
        return socket

    async def play(self):
        try:
            while True:
                await asyncio.sleep(PERIOD)
                await self.send()
        finally:
            for socket in list(self.sockets):
                await socket.close(code=WSCloseCode.GOING_AWAY)

    async def send(self):
        start, self.at = self.at, self.at + PERIOD * self.speed
        message = self.tape.message(start, self.at) | self.patch
        message["thresholds"] = dict.fromkeys(self.tape.tracks, 0.5)
        message["notices"], self.notices = self.notices, []
        if self.recording:
            self.recording["seconds"] += PERIOD
            self.recording["n_bytes"] += 14_000
            message["recording"] = self.recording
        for socket in list(self.sockets):
            with contextlib.suppress(ConnectionError):
                await socket.send_str(json.dumps(message))
