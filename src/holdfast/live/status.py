"""What a session says, gathered for the documents of the web service."""

import time
from collections import deque

import numpy as np

from holdfast.contact import ContactEstimate, ContactState, HandEstimate
from holdfast.live.recorder import Recorder
from holdfast.live.session import Session
from holdfast.live.stream_detector import StreamUpdate
from holdfast.live.web import schema
from holdfast.model import Model
from holdfast.sensors import Sensor

MOST = 4096
"""So many arrivals are kept for a reader that does not come; then the oldest go."""
RATE_OVER = 1.0
"""The rate is that of the packets in so long [s]."""

UNKNOWN = (np.nan, np.nan, np.nan)


class StatusPublisher:
    """Gathers what a session says until it is asked for it.

    `put` is called in the session's thread, `live` in another; between them stands a queue that
    forgets the oldest.

    Args:
        session: that is listened to.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._said: deque[tuple[float, StreamUpdate]] = deque(maxlen=MOST)
        self._notes: deque[schema.Notice] = deque(maxlen=MOST)
        self._newest: HandEstimate | None = None
        self._taxels: dict[str, list[schema.Vector]] = {}
        self._counts: deque[tuple[float, int]] = deque([(time.monotonic(), 0)])

    def put(self, said: StreamUpdate) -> None:
        """Takes what the session says."""
        self._said.append((time.time(), said))

    def note(self, text: str) -> None:
        """Tells readers something that no source says; for the thread of `live`."""
        self._notes.append(schema.Notice(time.time(), text))

    def live(self, recorder: Recorder | None) -> schema.LiveDocument:
        """All that was said since the last call."""
        said = [self._said.popleft() for _ in range(len(self._said))]
        notes = [self._notes.popleft() for _ in range(len(self._notes))]
        estimates = [(d.estimate, d.updated_fingers) for _, one in said for d in one.estimates]
        if estimates:
            self._newest = estimates[-1][0]
            self._look_at_taxels([one for _, one in said])
        newest = self._newest
        fingers = {} if newest is None else newest.fingers
        return schema.LiveDocument(
            time=np.nan if newest is None else newest.time,
            hand=ContactState.UNKNOWN if newest is None else newest.state,
            fingers={
                name: finger_of(finger, self._taxels.get(name)) for name, finger in fingers.items()
            },
            series=_series(estimates, list(self._session.stream.fingers)),
            events=[schema.StateChange(*event) for _, one in said for event in one.events],
            notices=notes + _notices(said),
            health=self._health(recorder),
            recording=None if recorder is None else recording_info(recorder),
            ended=self._session.ended,
        )

    def _look_at_taxels(self, said: list[StreamUpdate]) -> None:
        """The newest readings of every finger, without the tare."""
        for one in said[-len(self._session.stream.fingers) :]:
            if one.arrival is not None:
                for name, readings in self._session.stream.subtract_tare(
                    one.arrival.samples
                ).items():
                    self._taxels[name] = readings.round(4).tolist()

    def _health(self, recorder: Recorder | None) -> schema.Health:
        session, latency = self._session, self._session.latency()
        return schema.Health(
            rate=self._rate(),
            n_packets=session.n_packets,
            n_lost=session.n_lost,
            n_refused=session.n_refused,
            n_dropped=0 if recorder is None else recorder.status.n_dropped,
            silent=session.stream.silent,
            latency=schema.LatencyInfo(latency.p50, latency.p99, latency.largest),
        )

    def _rate(self) -> float:
        """Packets per second, over the last second."""
        self._counts.append((time.monotonic(), self._session.n_packets))
        while len(self._counts) > 2 and self._counts[-1][0] - self._counts[1][0] >= RATE_OVER:
            self._counts.popleft()
        (begin, before), (end, after) = self._counts[0], self._counts[-1]
        return (after - before) / (end - begin) if end > begin else np.nan


def _notices(said: list[tuple[float, StreamUpdate]]) -> list[schema.Notice]:
    """What the source says to people."""
    return [
        schema.Notice(when, text)
        for when, one in said
        if one.arrival is not None
        for text in one.arrival.notices
    ]


def hello(model: Model, session: Session, started: float, can_record: bool) -> schema.HelloDocument:
    """What a reader must know first."""
    source, stream = session.source, session.stream
    return schema.HelloDocument(
        model=model.name or "a model without a name",
        source=source.name,
        fingers={name: _info(model, name, sensor) for name, sensor in stream.fingers.items()},
        modules={name: sensor.n_taxels for name, sensor in source.sensors.items()},
        rate=None if np.isnan(stream.rate) else stream.rate,
        started=started,
        can_record=can_record,
    )


def finger_of(
    estimate: ContactEstimate, taxels: list[schema.Vector] | None = None
) -> schema.FingerDocument:
    """An estimate as the service tells it."""
    return schema.FingerDocument(
        time=estimate.time,
        state=estimate.state,
        reason=estimate.reason,
        stable_probability=estimate.stable_probability,
        instability=estimate.instability,
        force=estimate.force,
        faults=estimate.faults,
        faulty_taxels=estimate.faulty_taxels,
        taxels=taxels,
    )


def recording_info(recorder: Recorder) -> schema.RecordingInfo:
    """How far a recorder is."""
    status = recorder.status
    return schema.RecordingInfo(
        path=str(recorder.path),
        seconds=status.seconds,
        n_bytes=status.n_bytes,
        n_markers=status.n_markers,
        n_dropped=status.n_dropped,
    )


def _info(model: Model, name: str, sensor: Sensor) -> schema.FingerInfo:
    part = model.finger(name)
    return schema.FingerInfo(
        sensor=sensor.name,
        unit=sensor.unit,
        n_taxels=sensor.n_taxels,
        positions=sensor.positions.tolist(),
        rotations=sensor.rotations.tolist(),
        normal=tuple(sensor.normal.tolist()),
        contact_threshold=part.contact_threshold,
        probability_threshold=part.classifier.threshold,
    )


def _series(
    estimates: list[tuple[HandEstimate, tuple[str, ...]]], fingers: list[str]
) -> schema.HandSeries:
    return schema.HandSeries(
        times=[estimate.time for estimate, _ in estimates],
        fingers={name: _finger_series(estimates, name) for name in fingers},
    )


def _finger_series(
    estimates: list[tuple[HandEstimate, tuple[str, ...]]], name: str
) -> schema.FingerSeries:
    rows = [estimate.fingers[name] if name in fresh else None for estimate, fresh in estimates]
    forces = [UNKNOWN if row is None else row.force for row in rows]
    return schema.FingerSeries(
        force=([f[0] for f in forces], [f[1] for f in forces], [f[2] for f in forces]),
        instability=[np.nan if row is None else row.instability for row in rows],
        stable_probability=[np.nan if row is None else row.stable_probability for row in rows],
        state=[None if row is None else row.state.code for row in rows],
    )
