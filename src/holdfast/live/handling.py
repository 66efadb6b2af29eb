"""Record the handling of a live source, from which a model is calibrated."""

import math
import time
from collections.abc import Callable

from holdfast.errors import SourceError
from holdfast.live.arrival_buffer import ModuleBuffer
from holdfast.live.recorder_setup import EXTRA_TIME
from holdfast.live.stream_detector import TOUCHING, StreamDetector, StreamUpdate
from holdfast.recordings import Recording, Tactile

LONGEST_STEP = 0.1
"""A longer step between two estimates of a finger is not held time [s]."""
PROGRESS_STEP = 10.0
"""Time between two lines of progress [s]."""


class HandlingBuffer:
    """Buffer of the samples of a source while its user handles objects.

    Args:
        stream: detector of the source.

    Attributes:
        has_samples: whether any sample arrived.
    """

    def __init__(self, stream: StreamDetector) -> None:
        self._stream = stream
        self._modules = {name: ModuleBuffer(skin) for name, skin in stream.fingers.items()}
        # Held time of each finger, and the time of its last estimate; `put` changes both.
        self._held = dict.fromkeys(stream.fingers, 0.0)
        self._last = dict.fromkeys(stream.fingers, math.nan)
        self._start = self._end = math.nan
        self.has_samples = False

    @property
    def seconds(self) -> float:
        """Held time of the finger that holds longest [s]."""
        return max(self._held.values())

    @property
    def duration(self) -> float:
        """Time from the first estimate to the last [s]; NaN without one."""
        return self._end - self._start

    def put(self, update: StreamUpdate) -> None:
        """Append an update."""
        arrival = update.arrival
        if arrival is not None:
            for name, buffer in self._modules.items():
                if name in arrival.samples:
                    buffer.append(arrival.time, arrival.samples[name])
                    self.has_samples = True
        for estimate, updated in update.estimates:
            now = estimate.time
            self._start = now if math.isnan(self._start) else self._start
            self._end = now
            for name in updated:
                step, self._last[name] = now - self._last[name], now
                if estimate.fingers[name].state in TOUCHING and step <= LONGEST_STEP:
                    self._held[name] += step

    def recording(self) -> Recording:
        """Return the samples as a recording that begins as the stream.

        Raises:
            RecordingError: there are none.
        """
        modules = {}
        for name, buffer in self._modules.items():
            times, readings = buffer.pop_samples()
            if len(times):
                modules[name] = Tactile(self._stream.fingers[name], times, readings)
        name = time.strftime("handling-%Y%m%d-%H%M%S")
        return Recording(name, modules, metadata=self._stream.start_metadata())


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
        report: called with a line every `PROGRESS_STEP`.

    Raises:
        SourceError: no samples arrived.
    """
    buffer, next_report = HandlingBuffer(stream), PROGRESS_STEP
    # A source that falls silent is not awaited for ever.
    end = time.monotonic() + (seconds / speed + EXTRA_TIME if speed else math.inf)
    while not (stream.source.ended or is_over() or time.monotonic() > end):
        buffer.put(stream.read())
        if buffer.duration >= next_report:
            next_report += PROGRESS_STEP
            report(f"{buffer.duration:.0f} of {seconds:g} s, held {buffer.seconds:.0f} s")
        if buffer.duration >= seconds:
            break
    if not buffer.has_samples:
        raise SourceError(f"{stream.source.name} sent no samples: nothing was recorded")
    return buffer.recording()
