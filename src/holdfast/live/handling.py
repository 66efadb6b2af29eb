"""Calibrate the model of a running session by own handling, and undo it."""

import math
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from holdfast.errors import HoldfastError, SourceError, StreamError
from holdfast.live.recorder import output_path
from holdfast.live.recording_buffer import ModuleBuffer
from holdfast.live.session import Session
from holdfast.live.source_recording import EXTRA_TIME
from holdfast.live.stream_detector import TOUCHING, StreamDetector, StreamUpdate
from holdfast.live.web.schema import CalibrationDocument, CalibrationState
from holdfast.model import Model
from holdfast.model.files import encode
from holdfast.recordings import Recording, Tactile
from holdfast.training.calibration import (
    STILL_CHANGE,
    CalibratedModel,
    HandlingSummary,
    calibrate_with_report,
    check_normalised,
)
from holdfast.training.own_handling import ENOUGH_HANDLING, MIN_HANDLING

HELD_SECONDS = 60.0
"""Held time after which the handling ends by itself [s]: twice `ENOUGH_HANDLING`."""
MAX_WAITING = 300.0
"""Time after which it ends by itself, however little is held [s]."""
MAX_HANDLING_BYTES = 1 << 28
"""Size of the samples at which it ends by itself [bytes]."""
LONGEST_STEP = 0.1
"""A longer step between two estimates of a finger is not held time [s]."""
PROGRESS_STEP = 3.0
"""Held time between two lines of progress [s]."""
SAFETY_SECONDS = 0.5
"""Held time beyond the least that is wanted before it may end [s]: the calibration leaves out
samples at the edges of gaps."""


class HandlingBuffer:
    """Buffer of the samples of a session while its user handles objects.

    Args:
        stream: detector of the session.
    """

    def __init__(self, stream: StreamDetector) -> None:
        self._stream = stream
        self._modules = {name: ModuleBuffer(one) for name, one in stream.fingers.items()}
        self._metadata: Mapping[str, Any] | None = None  # of the start: the zero of the stream
        # Held time of each finger, and the time of its last estimate; `put` changes both.
        self._held = dict.fromkeys(stream.fingers, 0.0)
        self._last = dict.fromkeys(stream.fingers, math.nan)
        self._start = self._end = math.nan
        self._n_bytes = 0

    @property
    def seconds(self) -> float:
        """Held time of the finger that holds longest [s]."""
        return max(self._held.values())

    @property
    def duration(self) -> float:
        """Time from the first estimate to the last [s]; NaN without one."""
        return self._end - self._start

    @property
    def has_samples(self) -> bool:
        """Whether any sample arrived."""
        return self._n_bytes > 0

    @property
    def full(self) -> bool:
        """Whether nothing more is needed, or can be kept."""
        return (
            self.seconds >= HELD_SECONDS
            or self.duration >= MAX_WAITING
            or self._n_bytes >= MAX_HANDLING_BYTES
        )

    def put(self, update: StreamUpdate) -> None:
        """Append an update; a listener of the session."""
        if self._metadata is None:
            self._metadata = self._stream.start_metadata()
        arrival = update.arrival
        if arrival is not None:
            for name, buffer in self._modules.items():
                if name in arrival.samples:
                    buffer.append(arrival.time, arrival.samples[name])
                    self._n_bytes += arrival.samples[name].nbytes
        for estimate, updated in update.estimates:
            now = estimate.time
            self._start = now if math.isnan(self._start) else self._start
            self._end = now
            for name in updated:
                step, self._last[name] = now - self._last[name], now
                if estimate.fingers[name].state in TOUCHING and step <= LONGEST_STEP:
                    self._held[name] += step

    def recording(self) -> Recording:
        """Return the samples as a recording that begins as the stream was then.

        Raises:
            RecordingError: there are none.
        """
        modules = {}
        for name, buffer in self._modules.items():
            times, readings = buffer.pop_samples()
            if len(times):
                kept = self._stream.without_ignored(name, readings)
                modules[name] = Tactile(self._stream.fingers[name], times, kept)
        name = time.strftime("handling-%Y%m%d-%H%M%S")
        return Recording(name, modules, metadata=dict(self._metadata or {}))


def record_handling(
    stream: StreamDetector,
    seconds: float,
    speed: float,
    is_over: Callable[[], bool],
    report: Callable[[str], None],
) -> Recording:
    """Return the handling of an open source, and report how much of it is held.

    Args:
        stream: detector of the source.
        seconds: duration by the clock of the source [s].
        speed: of the source; 0 if it is not paced.
        is_over: returns whether the recording ends early.
        report: called with a line after every few seconds that are held.

    Raises:
        SourceError: no samples arrived.
    """
    buffer, shown = HandlingBuffer(stream), 0.0
    # A source that falls silent is not awaited for ever.
    end = time.monotonic() + (seconds / speed + EXTRA_TIME if speed else math.inf)
    while not (stream.source.ended or is_over() or time.monotonic() > end):
        buffer.put(stream.read())
        if buffer.seconds >= shown + PROGRESS_STEP:
            shown = buffer.seconds
            report(f"held {shown:.0f} of {ENOUGH_HANDLING:g} s")
        if buffer.duration >= seconds:
            break
    if not buffer.has_samples:
        raise SourceError(f"{stream.source.name} sent no samples: nothing was recorded")
    return buffer.recording()


class SessionCalibration:
    """Calibrate the model of a session by what its user holds, from any thread.

    The samples are collected in the thread of the session, the model is fitted in a thread of its
    own, and it is put into the running detector. `undo` puts back the model of the start.

    Args:
        session: to calibrate.
        folder: for model files; None if none may be written.

    Attributes:
        text: what the last calibration saw and changed, or why it was refused.
    """

    def __init__(self, session: Session, folder: Path | None) -> None:
        self._session, self._folder = session, folder
        self._original = session.stream.model  # each calibration begins with it, none with another
        # Requests of several clients, and the end of the handling in the session's thread, change
        # `_buffer` and `_fitting`: exactly one of them may end it.
        self._lock = Lock()
        self._buffer: HandlingBuffer | None = None
        self._fitting = False
        self._result: CalibratedModel | None = None
        self.text, self._refused = "", False

    def document(self) -> CalibrationDocument:
        """Return the progress and the result as a document."""
        if self._session.ended:
            with self._lock:
                if self._buffer is not None:
                    self._end()
                    self._refuse("the source has ended during the calibration")
        buffer, result = self._buffer, self._result
        state: CalibrationState = "idle" if buffer is None else "recording"
        if self._fitting:
            state = "fitting"
        return CalibrationDocument(
            state=state,
            seconds=0.0 if buffer is None else buffer.seconds,
            least=MIN_HANDLING + SAFETY_SECONDS,
            enough=ENOUGH_HANDLING,
            most=HELD_SECONDS,
            calibrated=result is not None,
            refused=self._refused,
            text=self.text,
            warnings=[] if result is None else list(result.warnings),
        )

    def start(self) -> None:
        """Begin to collect handling.

        Raises:
            StreamError: the session is locked, or a calibration is running.
            SourceError: the source has ended.
            ModelError: the model cannot be calibrated.
        """
        with self._lock:
            self._session.check_lock()
            check_normalised(self._original)
            if self._buffer is not None or self._fitting:
                raise StreamError("a calibration is running already")
            if self._session.ended:
                raise SourceError("the source has ended: there is nothing to calibrate with")
            self.text, self._refused = "", False
            self._buffer = HandlingBuffer(self._session.stream)
            self._session.add_listener(self._put)

    def finish(self) -> None:
        """End the handling, and fit the model in another thread.

        Raises:
            StreamError: no calibration is running, or too little was held so far.
        """
        # Without the lock: if another thread ends this buffer meanwhile, `_fit_soon` does nothing.
        buffer = self._buffer
        if buffer is None:
            raise StreamError("no calibration is running: start one, and hold an object")
        least = MIN_HANDLING + SAFETY_SECONDS
        if buffer.seconds < least:
            raise StreamError(
                f"{math.floor(10 * buffer.seconds) / 10:.1f} s held so far, at least {least:g} s "
                "expected: hold an object, or cancel"
            )
        self._fit_soon(buffer)

    def cancel(self) -> None:
        """End the handling without a result, or undo the last calibration.

        Raises:
            StreamError: nothing is running and nothing was calibrated, the model is being
                fitted, or the session is locked.
            SourceError: the source has ended or is silent.
        """
        with self._lock:
            if self._fitting:
                raise StreamError("the model is being fitted: undo it when that is done")
            # One button for both: what runs is ended first, the result before stays.
            if self._buffer is not None:
                self._end()
                return
            if self._result is None:
                raise StreamError("there is no calibration to undo")
            self._set_model(self._original)
            self._result, self.text, self._refused = None, "calibration undone", False

    def encoded_model(self) -> bytes:
        """Return the calibrated model as a model file has it.

        Raises:
            StreamError: nothing was calibrated.
        """
        return encode(self._calibrated().model)

    def save(self, name: str = "") -> Path:
        """Write the calibrated model to the folder, and return its path.

        Args:
            name: of the file, without a suffix; by default the date and time.

        Raises:
            StreamError: nothing was calibrated.
            OutputError: there is no folder, `name` is no valid file name, or the file exists or
                cannot be written.
        """
        calibrated = self._calibrated()
        stem = name or time.strftime("model-%Y%m%d-%H%M%S")
        path = output_path(self._folder, stem, ".json")
        calibrated.model.save(path)
        return path

    def _calibrated(self) -> CalibratedModel:
        if self._result is None:
            raise StreamError("there is no calibrated model: calibrate first")
        return self._result

    def _set_model(self, model: Model) -> None:
        work = partial(self._session.stream.set_model, model)
        self._session.change(work, "the model was not changed")

    def _put(self, update: StreamUpdate) -> None:
        buffer = self._buffer
        if buffer is None:
            return
        buffer.put(update)
        if buffer.full:
            self._fit_soon(buffer)

    def _end(self) -> None:
        self._session.remove_listener(self._put)
        self._buffer = None

    def _refuse(self, reason: str) -> None:
        self.text, self._refused = f"not calibrated: {reason}; nothing has changed", True

    def _fit_soon(self, buffer: HandlingBuffer) -> None:
        with self._lock:
            if self._buffer is not buffer:  # cancelled, or ended by another thread
                return
            self._end()
            self._fitting = True
        Thread(target=self._fit, args=(buffer,), name="holdfast-calibration", daemon=True).start()

    def _fit(self, buffer: HandlingBuffer) -> None:
        try:
            if buffer.seconds < MIN_HANDLING:
                raise StreamError(
                    f"{buffer.seconds:.1f} s held in {MAX_WAITING:.0f} s, at least "
                    f"{MIN_HANDLING:g} s expected"
                )
            calibrated = calibrate_with_report(self._original, [buffer.recording()])
            calibrated.check()
            self._set_model(calibrated.model)
            # Only now: if the session refuses the model, nothing has changed.
            self._result, self._refused = calibrated, False
            self.text = " ".join(described(summary) for summary in calibrated.sensors)
        except HoldfastError as refusal:
            self._refuse(str(refusal))
        except Exception as failure:  # the user gets it, and the session goes on
            self._refuse(f"{type(failure).__name__}: {failure}")
        finally:
            self._fitting = False


def described(summary: HandlingSummary) -> str:
    """Return in two sentences what a calibration saw of a sensor, and what it changes."""
    moved = "the arm moved" if summary.load_change >= STILL_CHANGE else "the arm hardly moved"
    moved += f" (the force changed by {100 * summary.load_change:.0f} % within half a second)"
    if math.isnan(summary.load_change):
        moved = "how much the arm moved is not known, as the hand has not been open"
    before, after = summary.before, summary.after
    return (
        f"{summary.sensor}: held {summary.seconds:.0f} s; {moved}. {summary.n_changed} of "
        f"{summary.n_features} features have a new scale, and {after.stable:.0f} % of this "
        f"handling is STABLE, {before.stable:.0f} % before."
    )
