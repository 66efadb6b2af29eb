"""What the web service says: the documents of `holdfast.live/1`."""

from typing import Literal

from msgspec import Struct

from holdfast.contact import ContactState, Fault, Reason

SCHEMA = "holdfast.live/1"
"""Fields may be added under this name; none changes its meaning or goes away."""

Vector = tuple[float, float, float]
Number = float | None
"""A number, or null where nothing is known (NaN is written as null)."""


class FingerInfo(Struct, frozen=True, kw_only=True):
    """What does not change of a finger.

    Attributes:
        sensor: its name.
        unit: of its readings, count or N.
        n_taxels: how many taxels it has.
        positions: of the taxels in the fingertip frame [m].
        rotations: of each taxel, from its frame to the fingertip frame, row by row.
        normal: of the sensor in the fingertip frame.
        contact_threshold: F_a below it is no contact [unit]; null where noise decides.
        probability_threshold: of stability.
    """

    sensor: str
    unit: str
    n_taxels: int
    positions: list[Vector]
    rotations: list[tuple[Vector, Vector, Vector]]
    normal: Vector
    contact_threshold: float | None
    probability_threshold: float


class HelloDocument(Struct, frozen=True, kw_only=True, tag_field="type", tag="hello"):
    """The first document of every connection.

    Attributes:
        model: what judges.
        source: what it judges.
        fingers: that are judged.
        modules: how many taxels each module of the source has.
        rate: of the source [Hz]; null while it is not known.
        started: when the service began [s since 1970].
        can_record: whether recordings can be made.
    """

    model: str
    source: str
    fingers: dict[str, FingerInfo]
    modules: dict[str, int]
    rate: float | None
    started: float
    can_record: bool
    schema: Literal["holdfast.live/1"] = "holdfast.live/1"


class FingerDocument(Struct, frozen=True, kw_only=True, gc=False):
    """The newest estimate of a finger: see `holdfast.ContactEstimate`.

    Attributes:
        taxels: readings without the tare, in taxel frames [unit]; null before the tare.
    """

    time: float
    state: ContactState
    reason: Reason
    stable_probability: Number
    instability: Number
    force: tuple[Number, Number, Number]
    faults: tuple[Fault, ...]
    faulty_taxels: tuple[int, ...]
    taxels: list[Vector] | None = None


class FingerSeries(Struct, frozen=True, gc=False):
    """What was said of a finger at each of the times; null where it had no sample.

    Attributes:
        force: F_x, F_y and F_z [unit].
        instability: sigma [unit].
        stable_probability: from 0 to 1.
        state: 0 UNKNOWN, 1 NO_CONTACT, 2 UNSTABLE, 3 STABLE.
    """

    force: tuple[list[Number], list[Number], list[Number]]
    instability: list[Number]
    stable_probability: list[Number]
    state: list[int | None]


class HandSeries(Struct, frozen=True, gc=False):
    """All samples since the document before."""

    times: list[float]
    fingers: dict[str, FingerSeries]


class StateChange(Struct, frozen=True, gc=False):
    """A state that changed; the finger is "hand" for the hand as a whole."""

    finger: str
    state: ContactState
    previous: ContactState
    time: float


class Notice(Struct, frozen=True, gc=False):
    """What a person should know; time in seconds since 1970."""

    time: float
    text: str


class LatencyInfo(Struct, frozen=True, gc=False):
    """From packet to decision, over the newest decisions [s]."""

    p50: Number
    p99: Number
    max: Number


class Health(Struct, frozen=True, kw_only=True, gc=False):
    """How well the source does.

    Attributes:
        rate: packets per second of late [Hz].
        n_packets: that came with samples.
        n_lost: that are missing by the device's count.
        n_refused: that made no sense.
        n_dropped: samples that the recorder could not keep up with.
        silent: whether nothing arrives.
        latency: from packet to decision.
    """

    rate: Number
    n_packets: int
    n_lost: int
    n_refused: int
    n_dropped: int
    silent: bool
    latency: LatencyInfo


class RecordingInfo(Struct, frozen=True, kw_only=True, gc=False):
    """The recording that is being made."""

    path: str
    seconds: float
    n_bytes: int
    n_markers: int
    n_dropped: int


class LiveDocument(Struct, frozen=True, kw_only=True, tag_field="type", tag="live"):
    """How things stand, and what has happened since the document before.

    Attributes:
        time: of the newest estimate, on the clock of the source [s].
        hand: its state.
        fingers: the newest estimate of each.
        series: all samples since then.
        events: changes of state since then.
        notices: of the source since then.
        health: of the source.
        recording: that is being made, or null.
        ended: whether the source is over.
    """

    time: Number
    hand: ContactState
    fingers: dict[str, FingerDocument]
    series: HandSeries
    events: list[StateChange]
    notices: list[Notice]
    health: Health
    recording: RecordingInfo | None
    ended: bool


class EstimateDocument(
    Struct, frozen=True, kw_only=True, tag_field="type", tag="estimate", gc=False
):
    """What was said at one instant: every one of them, as soon as it is said."""

    time: float
    hand: ContactState
    fingers: dict[str, FingerDocument]
