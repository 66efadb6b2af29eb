"""JSON documents that the labelling page and its server exchange."""

from typing import Any, Literal

import msgspec

from holdfast.io.header import LabelData
from holdfast.labelling.review.spans import State
from holdfast.labelling.server.store import LabelInput, Origin

SCHEMA = "holdfast.label/1"


class RecordingEntry(msgspec.Struct, frozen=True):
    """A recording in the list.

    Attributes:
        id: index in the list.
        name: of the recording.
        duration: approximate [s]; None if the recording cannot be read.
        fingers: names of the modules.
        labelled: whether there is a label file.
        n_labels: labels in the label file, or else in the recording itself.
        n_proposals: proposals that are not labelled yet.
        n_doubtful: labels and proposals of low confidence.
        error: why the recording cannot be labelled, in one line.
    """

    id: int
    name: str
    duration: float | None = None
    fingers: list[str] = []
    labelled: bool = False
    n_labels: int = 0
    n_proposals: int = 0
    n_doubtful: int = 0
    error: str | None = None


class RecordingList(msgspec.Struct, frozen=True):
    """All recordings, and the default author of labels."""

    author: str
    recordings: list[RecordingEntry]
    schema: str = SCHEMA


class DoubtfulLabel(msgspec.Struct, frozen=True):
    """A label or proposal of low confidence."""

    finger: str
    start: float
    end: float
    state: State
    confidence: float


class SuspectLabel(msgspec.Struct, frozen=True):
    """A label that an audit contradicts; fields as in `holdfast.labelling.review.audit.Suspect`."""

    finger: str
    start: float
    end: float
    given: State
    expected: State
    confidence: float
    kind: Literal["interval", "edge"]


class Video(msgspec.Struct, frozen=True):
    """A video of the recording.

    Attributes:
        index: in the list of the recording.
        name: of the file.
        offset: start of the video on the clock of the recording [s].
        missing: whether there is no such file beside the recording.
    """

    index: int
    name: str
    offset: float
    missing: bool


class RecordingDetails(msgspec.Struct, frozen=True, kw_only=True):
    """All that the page shows of a recording but its signals; times on its clock [s].

    Attributes:
        id: index in the list.
        name: of the recording.
        start: of the first sample [s].
        end: of the last sample [s].
        fingers: names of the modules.
        unit: of the readings, by finger.
        rate: samples per second [Hz].
        labels: by finger.
        proposals: by finger.
        suspects: results of an audit.
        doubtful: labels of low confidence, lowest first.
        markers: times [s] and texts.
        media: videos.
        note: on the recording.
        author: of the last save.
        time: of the last save, as ISO 8601 text.
        revision: of the label file.
        read_only: whether labels cannot be saved.
        origin: where the labels are stored.
    """

    id: int
    name: str
    start: float
    end: float
    fingers: list[str]
    unit: dict[str, str]
    rate: float
    labels: dict[str, list[LabelData]]
    proposals: dict[str, list[LabelData]]
    suspects: list[SuspectLabel]
    doubtful: list[DoubtfulLabel]
    markers: list[tuple[float, str]]
    media: list[Video]
    note: str
    author: str
    time: str
    revision: str
    read_only: bool
    origin: Origin


class SaveRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Labels to save, and the revision from which they were edited.

    A label may end up to one sample period after the recording, so that it includes the last
    sample. Each label is cut to the samples of its own finger.
    """

    labels: dict[str, list[LabelInput]]
    revision: str
    note: str = ""
    author: str = ""


class SaveReply(msgspec.Struct, frozen=True):
    """The revision and time of labels that were saved."""

    revision: str
    time: str


class ProposeRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A rule to apply, and its parameters; an empty name is the default rule of the recording."""

    rule: str = ""
    parameters: dict[str, Any] = {}


class ProposeReply(msgspec.Struct, frozen=True):
    """The labels that a rule proposes."""

    rule: str
    proposals: dict[str, list[LabelData]]
    doubtful: list[DoubtfulLabel]


class ChangePoints(msgspec.Struct, frozen=True):
    """Change points by finger [s]."""

    fingers: dict[str, list[float]]
