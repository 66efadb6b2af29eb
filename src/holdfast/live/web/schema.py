"""Documents of the web service, schema `holdfast.live/1`.

New fields may be added under this name; existing ones do not change.
"""

from typing import Literal

from msgspec import Struct

from holdfast.contact import ContactState, Fault
from holdfast.live.documents import FingerDocument, Number, Vector


class FingerInfo(Struct, frozen=True, kw_only=True):
    """Constant properties of a finger.

    Attributes:
        sensor: name of the sensor.
        unit: of the readings, count or N.
        n_taxels: number of taxels.
        positions: of the taxels in the fingertip frame [m].
        rotations: of each taxel, from its frame to the fingertip frame, row by row.
        normal: of the sensor in the fingertip frame.
        contact_threshold: F_a below which there is no contact [unit]; null if the model finds
            it from the noise.
        probability_threshold: probability from which a contact is stable, by the model.
        slip_threshold: probability of a slip from which the finger slides; null if the model has
            no slip rule for it.
    """

    sensor: str
    unit: str
    n_taxels: int
    positions: list[Vector]
    rotations: list[tuple[Vector, Vector, Vector]]
    normal: Vector
    contact_threshold: float | None
    probability_threshold: float
    slip_threshold: float | None = None


class FaultInfo(Struct, frozen=True, kw_only=True):
    """Texts about a fault: its name in a few words, and what to do."""

    words: str
    advice: str


class OperatingPoint(Struct, frozen=True, kw_only=True):
    """Errors that the validation of the model expects at a probability threshold.

    Attributes:
        threshold: probability from which a contact is stable.
        false_alarms_per_minute: per minute of stable contact.
        missed: share of events without an alarm within 0.2 s [%].
    """

    threshold: float
    false_alarms_per_minute: Number
    missed: Number


class DebounceInfo(Struct, frozen=True, kw_only=True):
    """Debouncing of state changes: see `holdfast.detection.Debounce`."""

    min_duration: float
    hysteresis: float
    hold: float


class HelloDocument(Struct, frozen=True, kw_only=True, tag_field="type", tag="hello"):
    """First document of every connection.

    Attributes:
        model: name of the model.
        source: name of the source.
        fingers: the fingers that the model uses.
        modules: number of taxels of each module of the source.
        rate: of the source [Hz]; null while it is not known.
        started: when the service started [s since 1970].
        can_record: whether the service can record.
        faults: texts about every fault.
        debounce: of the model.
        operating_points: by increasing threshold; empty if the model has none.
        advice: about the model on these fingers, such as own handling of another sensor.
    """

    model: str
    source: str
    fingers: dict[str, FingerInfo]
    modules: dict[str, int]
    rate: float | None
    started: float
    can_record: bool
    faults: dict[Fault, FaultInfo] = {}
    debounce: DebounceInfo | None = None
    operating_points: list[OperatingPoint] = []
    advice: list[str] = []
    schema: Literal["holdfast.live/1"] = "holdfast.live/1"


class EstimateSeries(Struct, frozen=True, gc=False):
    """Estimates of a finger at each of the times; null if it has no sample.

    Attributes:
        force: F_x, F_y and F_z [unit].
        instability: sigma [unit].
        stable_probability: from 0 to 1.
        state: 0 UNKNOWN, 1 NO_CONTACT, 2 UNSTABLE, 3 STABLE.
        slip_probability: from 0 to 1; null without a slip rule.
        slip_speed: of the sliding finger [mm/s], 0 while it does not slide; null without a speed
            rule.
    """

    force: tuple[list[Number], list[Number], list[Number]]
    instability: list[Number]
    stable_probability: list[Number]
    state: list[int | None]
    slip_probability: list[Number]
    slip_speed: list[Number]


class HandSeries(Struct, frozen=True, gc=False):
    """All estimates since the previous document."""

    times: list[float]
    fingers: dict[str, EstimateSeries]


class EventDocument(Struct, frozen=True, gc=False):
    """Change of a contact state; the finger is "hand" for the hand as a whole."""

    finger: str
    state: ContactState
    previous: ContactState
    time: float


class SlipDocument(Struct, frozen=True, gc=False):
    """Slip of a finger, sent when it begins and again when it has ended.

    Attributes:
        finger: name of the finger.
        begin: time of the first sample that slides [s].
        end: time of the first sample after them that does not [s]; null while it slides.
        max_probability: largest probability of a slip within that time.
        distance: slid within that time [mm]; null without a speed rule.
    """

    finger: str
    begin: float
    end: Number
    max_probability: float
    distance: Number


class Notice(Struct, frozen=True, gc=False):
    """Message for the user; time in seconds since 1970."""

    time: float
    text: str


class ProblemDocument(Struct, frozen=True, gc=False):
    """Fault that lasts; the text says what to do."""

    fault: Fault
    fingers: tuple[str, ...]
    text: str


class LatencyInfo(Struct, frozen=True, gc=False):
    """Time from packet to estimate, over the newest estimates [s]."""

    p50: Number
    p99: Number
    max: Number


class Health(Struct, frozen=True, kw_only=True, gc=False):
    """Statistics of the source.

    Attributes:
        rate: packets per second over the last second [Hz].
        n_packets: packets with samples.
        n_lost: packets that are missing by the device's own count.
        n_refused: packets that could not be decoded.
        n_dropped: samples that the recorder dropped.
        silent: whether no samples arrive.
        latency: from packet to estimate.
        delay: how much later the newest sample arrived than the quickest one [s].
    """

    rate: Number
    n_packets: int
    n_lost: int
    n_refused: int
    n_dropped: int
    silent: bool
    latency: LatencyInfo
    delay: float = 0.0


class RecordingInfo(Struct, frozen=True, kw_only=True, gc=False):
    """Progress of the recording."""

    path: str
    seconds: float
    n_bytes: int
    n_markers: int
    n_dropped: int


class LiveDocument(Struct, frozen=True, kw_only=True, tag_field="type", tag="live"):
    """Current state, and everything since the previous document.

    Attributes:
        time: of the newest estimate, on the clock of the source [s].
        hand: state of the hand.
        fingers: the newest estimate of each finger.
        series: all estimates since the previous document.
        events: changes of state since the previous document.
        notices: of the source and the service since the previous document.
        health: statistics of the source.
        recording: progress of the recording; null if none is running.
        ended: whether the source has ended.
        problems: faults that last.
        thresholds: probability from which each finger is stable now.
        slips: that began or ended since the previous document.
    """

    time: Number
    hand: ContactState
    fingers: dict[str, FingerDocument]
    series: HandSeries
    events: list[EventDocument]
    notices: list[Notice]
    health: Health
    recording: RecordingInfo | None
    ended: bool
    problems: list[ProblemDocument] = []
    thresholds: dict[str, float] = {}
    slips: list[SlipDocument] = []


class EstimateDocument(
    Struct, frozen=True, kw_only=True, tag_field="type", tag="estimate", gc=False
):
    """One estimate; sent as soon as it is made."""

    time: float
    hand: ContactState
    fingers: dict[str, FingerDocument]
