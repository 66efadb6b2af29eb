"""Live view of a hand in a running Rerun viewer."""

import socket
from collections import defaultdict, deque
from collections.abc import Mapping
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING, Any

import numpy as np
import rerun as rr

from holdfast.contact import ContactState
from holdfast.errors import SourceError
from holdfast.openable import Openable
from holdfast.recordings import Recording, Tactile
from holdfast.sensors.types import Array
from holdfast_interop.rerun.view import (
    ARROW_RADIUS,
    EVENT_LOG,
    STATE_LANES,
    TIMELINE,
    blueprint,
    draw_hand,
    entity,
    long_enough,
    name_states,
    time_column,
)
from holdfast_interop.scene.hand_frames import frames_of
from holdfast_interop.scene.taxel_arrows import LONGEST_ARROW, SCENE_RATE
from holdfast_interop.scene.tracks import ARROW_COLOURS

if TYPE_CHECKING:
    from holdfast.live.stream_detector import StreamDetector, StreamEstimate, StreamUpdate

VIEWER_PORT = 9876
"""Port on which the viewer of Rerun listens on this machine."""
CONNECT_TIMEOUT = 1.0
"""Maximum time to wait for the viewer [s]."""
MAX_QUEUED_UPDATES = 4096
"""Maximum number of updates that wait for Rerun; the oldest is dropped first."""
QUANTITIES = ("instability", "stable_probability", "slip_probability", "slip_speed")
TOUCHED = (ContactState.UNSTABLE, ContactState.STABLE)
"""States in which the arrows of a finger are drawn."""


class RerunPublisher(Openable):
    """Send estimates to a Rerun viewer in a separate thread; it never delays the caller.

    The plots have every estimate; the arrows are drawn `SCENE_RATE` times a second. The longest
    arrow so far has a fixed length, since the largest reading to come is not known.

    Args:
        stream: whose estimates are sent.
        port: of the viewer on this machine.

    Attributes:
        n_dropped: updates that were dropped because Rerun was too slow.
        n_failed: estimates that Rerun refused.
    """

    def __init__(self, stream: "StreamDetector", port: int = VIEWER_PORT) -> None:
        self._stream = stream
        self._port = port
        self._queue: deque[StreamUpdate] = deque()
        self._lock = Lock()
        self._closing = Event()
        self._thread: Thread | None = None
        self._start: float | None = None
        self._states: dict[str, ContactState] = {}
        self._largest = 0.0
        self.n_dropped = self.n_failed = 0

    def open(self) -> None:
        """Connect to the viewer, draw the hand, and start the thread.

        Raises:
            SourceError: no viewer listens.
        """
        # The connection of Rerun retries for ever without a word.
        try:
            socket.create_connection(("127.0.0.1", self._port), CONNECT_TIMEOUT).close()
        except OSError:
            raise SourceError(
                f"no Rerun viewer listens on port {self._port} of this machine: start it by "
                "`rerun --bind 127.0.0.1`"
            ) from None
        self._view = rr.RecordingStream("holdfast")
        modules = {
            name: Tactile(sensor, np.zeros(1), np.zeros((1, sensor.n_taxels, 3)))
            for name, sensor in self._stream.fingers.items()
        }
        recording = Recording("live", modules)
        frames = frames_of(recording)
        layout = blueprint(("force", *QUANTITIES), frames)
        url = f"rerun+http://127.0.0.1:{self._port}/proxy"
        self._view.connect_grpc(url, default_blueprint=layout)
        self._paths = draw_hand(self._view, recording, frames)
        name_states(self._view, [entity(STATE_LANES, name) for name in (*modules, "hand")])
        self._closing.clear()
        self._thread = Thread(target=self._run, name="holdfast-rerun", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Send what is in the queue, and disconnect; a second call does nothing."""
        self._closing.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()
            self._view.disconnect()

    def put(self, update: "StreamUpdate") -> None:
        """Append an update to the queue; a listener of a session."""
        with self._lock:
            if len(self._queue) == MAX_QUEUED_UPDATES:
                self._queue.popleft()
                self.n_dropped += 1
            self._queue.append(update)

    def _run(self) -> None:
        while True:
            is_last = self._closing.wait(1 / SCENE_RATE)
            with self._lock:
                updates = list(self._queue)
                self._queue.clear()
            try:
                self._send(updates)
            except Exception:  # of any kind; the next ones may succeed
                self.n_failed += sum(len(update.estimates) for update in updates)
            if is_last:
                return

    def _send(self, updates: "list[StreamUpdate]") -> None:
        """Send all estimates, the changes of state, the notices and the newest arrows."""
        estimates = [pair for update in updates for pair in update.estimates]
        if not estimates:
            return
        newest = estimates[-1].estimate.time
        if self._start is None:
            self._start = estimates[0].estimate.time
        for estimate, fingers in estimates:
            states = {"hand": estimate.state, **{f: estimate.fingers[f].state for f in fingers}}
            for name, state in states.items():
                if self._states.get(name) is not state:
                    self._states[name] = state
                    self._at(estimate.time)
                    self._view.log(entity(STATE_LANES, name), rr.StateChange(state=state.value))
        self._send_series(estimates, self._start)
        samples: dict[str, Any] = {}
        for update in updates:
            for event in update.events:
                self._log(event.time, f"{event.finger}: {event.state}, was {event.previous}")
            if update.arrival is not None:
                samples |= update.arrival.samples
                for notice in update.arrival.notices:
                    self._log(newest, notice, "WARN")
        self._at(newest)
        self._draw(self._stream.subtract_tare(samples))

    def _send_series(self, estimates: "list[StreamEstimate]", start: float) -> None:
        series: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
        for estimate, fingers in estimates:
            for name in fingers:
                finger = estimate.fingers[name]
                values = {quantity: getattr(finger, quantity) for quantity in QUANTITIES}
                values["force"] = float(np.linalg.norm(finger.force))
                for quantity, value in values.items():
                    if value is not None:
                        series[quantity, name].append((estimate.time, value))
        for (quantity, name), pairs in series.items():
            times, numbers = np.array(pairs).T
            columns = rr.Scalars.columns(scalars=numbers)
            self._view.send_columns(entity(quantity, name), [time_column(times, start)], columns)

    def _draw(self, readings: Mapping[str, Array]) -> None:
        for name, taxels in readings.items():
            state = self._states.get(name, ContactState.UNKNOWN)
            positions = self._stream.fingers[name].positions
            forces = np.einsum("nij,nj->ni", self._stream.fingers[name].rotations, taxels)
            forces = np.nan_to_num(forces, nan=0.0, posinf=0.0, neginf=0.0)
            if state in TOUCHED:
                self._largest = max(self._largest, float(np.linalg.norm(forces, axis=1).max()))
            vectors = forces * (LONGEST_ARROW / self._largest if self._largest > 0 else 0.0)
            shown = long_enough(vectors) & (state in TOUCHED)
            arrows = rr.Arrows3D(
                vectors=vectors[shown], origins=positions[shown], radii=ARROW_RADIUS,
                colors=ARROW_COLOURS[state],
            )  # fmt: skip
            self._view.log(f"{self._paths[name]}/arrows", arrows)

    def _at(self, instant: float) -> None:
        self._view.set_time(TIMELINE, duration=instant - (self._start or 0.0))

    def _log(self, instant: float, text: str, level: str = "INFO") -> None:
        self._at(instant)
        self._view.log(EVENT_LOG, rr.TextLog(text, level=level))
