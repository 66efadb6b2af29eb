"""A fake service: it plays recorded messages to the page, and a test controls it.

To look at the page: `PYTHONPATH=tests python -m live.web.page.fake_service RECORDING [PORT]`.
"""

import asyncio
import contextlib
import json
import math
import sys
import threading
import time
from importlib import resources
from pathlib import Path

import numpy as np
from aiohttp import WSCloseCode, web

from holdfast.contact import ContactState, Fault, Reason
from holdfast.detector import detect
from holdfast.io import load_recording
from holdfast.live.fault_notices import FAULT_TEXTS
from holdfast.model import Model
from holdfast.sensors import sensor
from holdfast.web.guard import SECURITY_HEADERS

PAGE = Path(str(resources.files("holdfast.live.web"))) / "page"
SHARED = Path(str(resources.files("holdfast.web"))) / "static"
STATES = [state.value for state in ContactState]
FAULTS = list(Fault)

PERIOD = 0.05


class Track:
    """Values of one finger at each sample."""

    def __init__(self, layout, taxels, force, sigma, probability, state, reason, faults):
        self.layout = layout
        self.taxels, self.force, self.sigma = taxels, force, sigma
        self.probability, self.state = probability, state
        self.reason, self.faults = reason, faults


def made_up(names=("thumb", "index", "middle", "ring"), layout="uskin-curved", rate=150.0):
    """Twelve seconds of a hand that grasps an object, holds it, and is disturbed twice."""
    n = int(12 * rate)
    times = np.arange(n) / rate
    layout = sensor(layout)
    tracks = {}
    for place, name in enumerate(names):
        rng = np.random.default_rng(place)
        press = np.clip((times - 2) / 0.8, 0, 1) * (1 - np.clip((times - 11) / 0.3, 0, 1))
        shake = sum(np.exp(-(((times - t) / 0.25) ** 2)) for t in (5 + 0.05 * place, 8.5))
        state = np.where(press <= 0, 1, np.where((press < 1) | (shake > 0.3), 2, 3))
        state[times < 0.6] = 0
        centre = layout.positions[place % layout.n_taxels]
        near = np.exp(-np.sum((layout.positions - centre) ** 2, axis=1) / 1e-4)
        pull = 0.4 * shake * np.sin(60 * times)
        shares = np.stack([0.3 * press + pull, 0.2 * press, press + 0.2 * pull], axis=1)
        taxels = 900 * near[None, :, None] * shares[:, None, :] + rng.normal(
            0, 1, (n, len(near), 3)
        )
        force = np.einsum("kij,nkj->ni", layout.rotations, taxels)
        sigma = 3 + 200 * shake + rng.exponential(0.5, n)
        probability = np.where(state == 3, 0.95, 0.08) + rng.uniform(-0.04, 0.04, n)
        probability[state == 0] = np.nan
        sigma[state == 0] = np.nan
        reason = np.where(state == 0, 1, 0)
        tracks[name] = Track(layout, taxels, force, sigma, probability, state, reason, [()] * n)
    return times, tracks


def played(path, model="builtin:twin"):
    """Detect a recording with a model."""
    recording = load_recording(path)
    found = detect(Model.load(model), recording)
    tracks = {}
    for name, trace in found.fingers.items():
        module = recording.modules[name]
        taxels = module.readings.astype(float)
        taxels -= taxels[:75].mean(axis=0)
        faults = [tuple(f for bit, f in enumerate(FAULTS) if m >> bit & 1) for m in trace.faults]
        tracks[name] = Track(
            module.sensor, taxels, trace.force, trace.instability, trace.stable_probability,
            trace.state, trace.reason, faults,
        )  # fmt: skip
    return found.times, tracks


def plain(value):
    """Replace NaN by None, because JSON has no NaN."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def hand_word(states):
    for state in ("UNSTABLE", "UNKNOWN"):
        if state in states:
            return state
    return "STABLE" if states.count("STABLE") >= min(2, len(states)) else "NO_CONTACT"


class Tape:
    """Make messages from tracks, repeated without end, with increasing times."""

    def __init__(self, times, tracks, unit=None):
        self.times, self.tracks, self.unit = times, tracks, unit
        self.length = float(times[-1] - times[0] + times[1] - times[0])
        self.states = dict.fromkeys((*tracks, "hand"), "UNKNOWN")
        self.n_packets = 0
        self.points = []  # expected errors by threshold
        self.change = {}  # finger -> fields to write over its part of a message
        self.slip_threshold = None  # without a slip rule
        self.slips_now = []  # slips of the next message
        self.model = "builtin:twin"
        self.source = "twin:?object=can&seed=1"
        self.advice = []  # about the model on these fingers

    def hello(self):
        fingers = {
            name: {
                "sensor": track.layout.name,
                "unit": self.unit or track.layout.unit,
                "n_taxels": track.layout.n_taxels,
                "positions": track.layout.positions.tolist(),
                "rotations": track.layout.rotations.tolist(),
                "normal": track.layout.normal.tolist(),
                "contact_threshold": 60.0,
                "probability_threshold": 0.5,
                "slip_threshold": self.slip_threshold,
            }
            for name, track in self.tracks.items()
        }
        return {
            "schema": "holdfast.live/1", "type": "hello", "model": self.model,
            "source": self.source, "fingers": fingers,
            "modules": {name: track.layout.n_taxels for name, track in self.tracks.items()},
            "rate": 150.0, "started": time.time(), "can_record": True,
            "faults": {fault: text._asdict() for fault, text in FAULT_TEXTS.items()},
            "debounce": {"min_duration": 0.0, "hysteresis": 0.0, "hold": 0.1},
            "operating_points": self.points, "advice": self.advice,
        }  # fmt: skip

    def message(self, start, stop):
        """Message with the samples in [start, stop) [s]."""
        n = len(self.times)
        clock = (self.times - self.times[0])[None, :] + self.length * np.arange(
            start // self.length, stop // self.length + 1
        )[:, None]
        picks = np.flatnonzero((clock.ravel() >= start) & (clock.ravel() < stop))
        times, rows = clock.ravel()[picks], picks % n
        self.n_packets += len(rows)
        now = float(times[-1]) if len(times) else start
        last = int(rows[-1]) if len(rows) else int((start % self.length) / self.length * n) % n
        fingers = {name: self.finger(track, last) for name, track in self.tracks.items()}
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
        latency = {"p50": 0.00021, "p99": 0.0013, "max": 0.011}
        return {
            "type": "live", "time": now, "hand": hand, "fingers": fingers,
            "series": {"times": times.tolist(), "fingers": series},
            "events": events, "slips": slips, "notices": [],
            "health": {
                "rate": 149.9, "n_packets": self.n_packets, "n_lost": 0, "n_refused": 0,
                "n_dropped": 0, "silent": False, "latency": latency,
            },
            "recording": None, "ended": False,
        }  # fmt: skip

    def slips(self, track, rows):
        """Return a probability of a slip that is high where that of stability is low."""
        if self.slip_threshold is None:
            return [None] * len(rows)
        return plain(1 - track.probability[rows])

    def finger(self, track, k):
        return {
            "state": STATES[int(track.state[k])],
            "reason": list(Reason)[int(track.reason[k])].value,
            "stable_probability": plain(float(track.probability[k])),
            "instability": plain(float(track.sigma[k])),
            "force": plain(track.force[k]),
            "faults": [fault.value for fault in track.faults[k]],
            "faulty_taxels": [],
            "cause": None,
            "slip_probability": self.slips(track, [k])[0],
            "slip_speed": None,
            "slip_distance": None,
            "taxels": plain(np.round(track.taxels[k], 1)),
        }


class Service:
    """Fake service with its own port and thread."""

    def __init__(self, tape, token=None, speed=1.0, port=0):
        self.tape, self.token, self.speed, self.port = tape, token, speed, port
        self.refusal = None  # error of every REST call
        self.calls = []
        self.recording = None
        self.threshold = 0.5
        self.patch = {}  # fields that replace those of every message
        self.notices = []
        self.muted = False
        self.at = 0.0

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
        self.loop, self.done, self.sockets = asyncio.get_running_loop(), asyncio.Event(), set()
        runner = web.AppRunner(self.app(), shutdown_timeout=1)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", self.port).start()
        self.port = runner.addresses[0][1]
        ready.set()
        player = asyncio.create_task(self.play())
        await self.done.wait()
        player.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await player
        for socket in list(self.sockets):
            await socket.close(code=WSCloseCode.GOING_AWAY)
        await runner.cleanup()

    def app(self):
        app = web.Application(middlewares=[self.guard])
        app.router.add_get("/", self.index)
        app.router.add_static("/page", PAGE)
        app.router.add_static("/web", SHARED)
        app.router.add_get("/api/v1/live", self.live)
        app.router.add_get("/api/v1/info", self.info)
        app.router.add_post("/api/v1/tare", self.tare)
        app.router.add_post("/api/v1/threshold", self.set_threshold)
        app.router.add_delete("/api/v1/threshold", self.reset_threshold)
        app.router.add_post("/api/v1/recording", self.start_recording)
        app.router.add_delete("/api/v1/recording", self.stop_recording)
        app.router.add_post("/api/v1/markers", self.marker)
        return app

    @web.middleware
    async def guard(self, request, handler):
        given = request.headers.get("Authorization"), request.query.get("token")
        allowed = self.token is None or given in (
            (f"Bearer {self.token}", None),
            (None, self.token),
        )
        if request.path.startswith("/api") and not allowed:
            return web.json_response({"error": "token expected"}, status=401)
        if request.method != "GET":
            self.calls.append(
                (request.method, request.path.removeprefix("/api/v1/"), await request.text())
            )
            if self.refusal is not None:
                return web.json_response({"error": self.refusal}, status=409)
        answer = await handler(request)
        if not answer.prepared:
            answer.headers.update(SECURITY_HEADERS)
        return answer

    async def index(self, _):
        return web.FileResponse(PAGE / "index.html")

    async def info(self, _):
        return web.json_response(self.tape.hello())

    async def tare(self, _):
        return web.json_response({})

    async def set_threshold(self, request):
        self.threshold = (await request.json())["value"]
        return web.json_response({})

    async def reset_threshold(self, _):
        self.threshold = 0.5
        return web.json_response({})

    async def start_recording(self, _):
        self.recording = {
            "path": "grasps/2026-11-21-grasp-0007.mcap",
            "seconds": 0.0,
            "n_bytes": 0,
            "n_markers": 0,
            "n_dropped": 0,
        }
        return web.json_response({"path": self.recording["path"]})

    async def stop_recording(self, _):
        kept, self.recording = self.recording, None
        return web.json_response({"path": kept["path"], "seconds": kept["seconds"]})

    async def marker(self, _):
        return web.json_response({})

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
        while True:
            await asyncio.sleep(PERIOD)
            if self.muted:
                continue
            start, self.at = self.at, self.at + PERIOD * self.speed
            message = self.tape.message(start, self.at) | self.patch
            message["thresholds"] = dict.fromkeys(self.tape.tracks, self.threshold)
            message["notices"], self.notices = self.notices, []
            if self.recording:
                self.recording["seconds"] += PERIOD
                self.recording["n_bytes"] += 14_000
                message["recording"] = self.recording
            text = json.dumps(message)
            for socket in list(self.sockets):
                with contextlib.suppress(ConnectionError):
                    await socket.send_str(text)


if __name__ == "__main__":
    with Service(
        Tape(*played(sys.argv[1])), port=int(sys.argv[2]) if sys.argv[2:] else 8765
    ) as fake:
        sys.stderr.write(f"{fake.url}\n")
        fake.thread.join()
