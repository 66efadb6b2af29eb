"""Publish the updates of a session as documents of the web service."""

import time
from collections import deque
from collections.abc import Callable

import msgspec
import numpy as np

from holdfast.contact import ContactState, Fault, HandEstimate
from holdfast.detection import Model
from holdfast.detection.slips import SlipWatch
from holdfast.live.documents import Vector, finger_document
from holdfast.live.fault_notices import FAULT_TEXTS, FaultWatch
from holdfast.live.recorder import Recorder
from holdfast.live.session import Session
from holdfast.live.stream_detector import StreamEstimate, StreamUpdate
from holdfast.live.web import schema
from holdfast.sensors.types import Array

MAX_OWN_NOTICES = 4096
"""Maximum number of notices of the service between two documents; older ones are dropped."""
RATE_PERIOD = 1.0
"""Period over which the packet rate is measured [s]."""

_NO_FORCE = (np.nan, np.nan, np.nan)


class StatusPublisher:
    """Make documents of the updates of a session, in the thread of the service.

    Args:
        session: to publish.
        report: called with the text of each notice about a fault or by the service.
    """

    def __init__(self, session: Session, report: Callable[[str], None] = lambda _: None) -> None:
        self._session = session
        self._report = report
        self._faults = FaultWatch()
        self._slips = SlipWatch()
        self._n_read = session.n_updates  # updates of the documents so far
        self._own_notices: deque[schema.Notice] = deque(maxlen=MAX_OWN_NOTICES)
        # Kept from document to document: the newest estimate and readings for documents without
        # any, and the counts of the rate.
        self._newest: HandEstimate | None = None
        self._taxels: dict[str, list[Vector]] = {}
        self._counts: deque[tuple[float, int]] = deque([(time.monotonic(), 0)])

    def add_notice(self, text: str) -> None:
        """Add a notice of the service itself, in the service's thread."""
        self._own_notices.append(schema.Notice(time.time(), text))
        self._report(text)

    def live_document(self, recorder: Recorder | None) -> schema.LiveDocument:
        """Return everything since the last call as one document."""
        # The session's thread goes on: only what is there now belongs to this document.
        updates, self._n_read = self._session.updates_since(self._n_read)
        estimates = [estimate for _, update in updates for estimate in update.estimates]
        for estimate, _ in estimates:
            for problem in self._faults.update(estimate):
                self.add_notice(problem.text)
        service_notices = [self._own_notices.popleft() for _ in range(len(self._own_notices))]
        if estimates:
            self._newest = estimates[-1].estimate
            self._update_taxels([update for _, update in updates])
        newest = self._newest
        fingers = {} if newest is None else newest.fingers
        return schema.LiveDocument(
            time=np.nan if newest is None else newest.time,
            hand=ContactState.UNKNOWN if newest is None else newest.state,
            fingers={
                name: finger_document(finger, self._taxels.get(name))
                for name, finger in fingers.items()
            },
            series=schema.HandSeries(
                times=[estimate.time for estimate, _ in estimates],
                fingers={n: _finger_series(estimates, n) for n in self._session.stream.fingers},
            ),
            events=[schema.EventDocument(*event) for _, timed in updates for event in timed.events],
            notices=[
                *service_notices,
                *(
                    schema.Notice(when, text)
                    for when, update in updates
                    if update.arrival is not None
                    for text in update.arrival.notices
                ),
            ],
            health=self._health(recorder),
            recording=None if recorder is None else recording_info(recorder),
            ended=self._session.ended,
            problems=[
                schema.ProblemDocument(
                    problem.fault,
                    problem.fingers,
                    f"{problem.text} ({1000 * self._session.delay:.0f} ms)"
                    if problem.fault is Fault.LATE
                    else problem.text,
                )
                for problem in self._faults.current
            ],
            thresholds=dict(self._session.stream.thresholds),
            slips=[
                schema.SlipDocument(*slip)
                for estimate, updated in estimates
                for name in updated
                for slip in self._slips.update(name, [estimate.fingers[name]])
            ],
        )

    def _update_taxels(self, updates: list[StreamUpdate]) -> None:
        """Keep the newest readings of every finger, minus the tare."""
        stream = self._session.stream
        # One update may have the samples of one finger only: the last ones have those of all.
        newest: dict[str, Array] = {}
        for update in updates[-len(stream.fingers) :]:
            if update.arrival is not None:
                newest.update(update.arrival.samples)
        for name, readings in stream.subtract_tare(newest).items():
            self._taxels[name] = readings.round(4).tolist()

    def _health(self, recorder: Recorder | None) -> schema.Health:
        session, latency = self._session, self._session.latency()
        # Two counts stay at least: the newest, and the last one that is a period old.
        counts = self._counts
        counts.append((time.monotonic(), session.n_packets))
        while len(counts) > 2 and counts[-1][0] - counts[1][0] >= RATE_PERIOD:
            counts.popleft()
        (begin, before), (end, after) = counts[0], counts[-1]
        return schema.Health(
            rate=(after - before) / (end - begin) if end > begin else np.nan,
            n_packets=session.n_packets,
            n_lost=session.n_lost,
            n_refused=session.n_refused,
            n_dropped=0 if recorder is None else recorder.status.n_dropped,
            silent=session.stream.silent,
            latency=schema.LatencyInfo(latency.p50, latency.p99, latency.largest),
            delay=session.delay,
        )


def hello_document(session: Session, started: float, can_record: bool) -> schema.HelloDocument:
    """Return the first document of a connection."""
    source, stream = session.source, session.stream
    model = stream.model
    fingers = {}
    for name, sensor in stream.fingers.items():
        part = model.finger(name, sensor)
        fingers[name] = schema.FingerInfo(
            sensor=sensor.name,
            unit=sensor.unit,
            n_taxels=sensor.n_taxels,
            positions=sensor.positions.tolist(),
            rotations=sensor.rotations.tolist(),
            normal=tuple(sensor.normal.tolist()),
            contact_threshold=part.contact_threshold,
            probability_threshold=part.stable.threshold,
            slip_threshold=None if part.slip is None else part.slip.threshold,
        )
    return schema.HelloDocument(
        model=model.name or "a model without a name",
        source=source.name,
        fingers=fingers,
        modules={name: sensor.n_taxels for name, sensor in source.sensors.items()},
        rate=None if np.isnan(stream.rate) else stream.rate,
        started=started,
        can_record=can_record,
        faults={
            fault: schema.FaultInfo(words=text.words, advice=text.advice)
            for fault, text in FAULT_TEXTS.items()
        },
        debounce=schema.DebounceInfo(
            min_duration=model.debounce.min_duration,
            hysteresis=model.debounce.hysteresis,
            hold=model.debounce.hold,
        ),
        operating_points=operating_points(model),
        advice=[advice] if (advice := model.handling_advice(stream.fingers)) else [],
    )


def operating_points(model: Model) -> list[schema.OperatingPoint]:
    """Return the errors at each threshold that was tried when the model was tuned."""
    choices = [part.stable.choice for part in model.fingers.values()]
    return [
        schema.OperatingPoint(**msgspec.structs.asdict(point))
        for choice in choices[:1]  # all fingers are tuned together
        if choice is not None
        for point in choice.points
    ]


def recording_info(recorder: Recorder) -> schema.RecordingInfo:
    """Return the progress of a recorder as a document."""
    status = recorder.status
    return schema.RecordingInfo(
        path=str(recorder.path),
        seconds=status.seconds,
        n_bytes=status.n_bytes,
        n_markers=status.n_markers,
        n_dropped=status.n_dropped,
    )


def _finger_series(estimates: list[StreamEstimate], name: str) -> schema.EstimateSeries:
    rows = [estimate.fingers[name] if name in updated else None for estimate, updated in estimates]
    forces = [_NO_FORCE if row is None else row.force for row in rows]
    return schema.EstimateSeries(
        force=([f[0] for f in forces], [f[1] for f in forces], [f[2] for f in forces]),
        instability=[np.nan if row is None else row.instability for row in rows],
        stable_probability=[np.nan if row is None else row.stable_probability for row in rows],
        state=[None if row is None else row.state.code for row in rows],
        slip_probability=[None if row is None else row.slip_probability for row in rows],
        slip_speed=[None if row is None else row.slip_speed for row in rows],
    )
