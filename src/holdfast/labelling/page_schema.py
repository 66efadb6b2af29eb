"""What the label page and the service say to each other, as JSON."""

from typing import Any, Literal

import msgspec

from holdfast.io.header import LabelData
from holdfast.labelling.spans import State
from holdfast.labelling.store import GivenLabel, Origin

SCHEMA = "holdfast.label/1"


class Entry(msgspec.Struct, frozen=True):
    """A recording in the list.

    Attributes:
        id: its place in the list.
        name: of the recording.
        duration: about how long it is [s]; None where it cannot be read.
        fingers: its modules.
        labelled: it has a label file of its own.
        n_labels: in the file, or else inside.
        n_proposals: that are not labelled yet.
        n_doubtful: labels and proposals of little confidence.
        error: why it cannot be labelled, in one line.
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


class Listing(msgspec.Struct, frozen=True):
    """All recordings, and who labels them."""

    author: str
    recordings: list[Entry]
    schema: str = SCHEMA


class Doubtful(msgspec.Struct, frozen=True):
    """A label or proposal of little confidence."""

    finger: str
    start: float
    end: float
    state: State
    confidence: float


class Doubted(msgspec.Struct, frozen=True):
    """A label that an audit contradicts; fields as in `holdfast.labelling.audit.Suspect`."""

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
        index: its place in the recording's list.
        name: of the file.
        offset: of its start on the clock of the recording [s].
        missing: there is no such file beside the recording.
    """

    index: int
    name: str
    offset: float
    missing: bool


class Opened(msgspec.Struct, frozen=True, kw_only=True):
    """A recording that is to be labelled; times on its clock [s].

    Attributes:
        id: its place in the list.
        name: of the recording.
        start: of the first sample [s].
        end: of the last sample [s].
        fingers: its modules.
        unit: of each finger's readings.
        rate: samples per second [Hz].
        labels: by finger.
        proposals: by finger.
        suspects: that an audit found.
        doubtful: the most doubtful first.
        markers: times [s] and texts.
        media: its videos.
        note: on the recording.
        author: who saved the labels last.
        time: when, as ISO 8601 text.
        revision: of the label file.
        read_only: labels cannot be saved.
        origin: where the labels come from.
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
    suspects: list[Doubted]
    doubtful: list[Doubtful]
    markers: list[tuple[float, str]]
    media: list[Video]
    note: str
    author: str
    time: str
    revision: str
    read_only: bool
    origin: Origin


class Given(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Labels to be saved, and the revision that they were changed from.

    They may end a sample period after the recording, so that its last sample is labelled; each is
    cut to the samples of its own finger.
    """

    labels: dict[str, list[GivenLabel]]
    revision: str
    note: str = ""
    author: str = ""


class Asked(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A rule that is asked for proposals; the best that there is evidence for by default."""

    rule: str = ""
    parameters: dict[str, Any] = {}


class Proposed(msgspec.Struct, frozen=True):
    """What a rule proposes."""

    rule: str
    proposals: dict[str, list[LabelData]]
    doubtful: list[Doubtful]


class Saved(msgspec.Struct, frozen=True):
    """Labels were saved."""

    revision: str
    time: str


class Changes(msgspec.Struct, frozen=True):
    """Change points by finger [s]."""

    fingers: dict[str, list[float]]
