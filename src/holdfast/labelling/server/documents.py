"""JSON documents that the labelling page and its server exchange, and how they are made."""

from typing import Any

import msgspec

from holdfast.errors import HoldfastError
from holdfast.io.header import LabelData, label_data
from holdfast.io.label_files import labels_for
from holdfast.labelling.review.confidence import State, doubtful, state_name
from holdfast.labelling.server.store import LabelInput, ModuleLabels, Origin, is_read_only
from holdfast.labelling.server.workspace import Workspace, beside
from holdfast.recordings import Label

LABEL_SCHEMA = "holdfast.label/1"


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
    schema: str = LABEL_SCHEMA


class DoubtfulLabel(msgspec.Struct, frozen=True):
    """A label or proposal of low confidence."""

    finger: str
    start: float
    end: float
    state: State
    confidence: float


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


def list_recordings(workspace: Workspace) -> RecordingList:
    """Return all recordings of a workspace, with the numbers of labels and proposals."""
    entries = []
    for index, path in enumerate(workspace.paths):
        try:
            summary = workspace.summary(index)
            labels = labels_for(path, summary.digest)
        except (HoldfastError, OSError) as cause:  # the others can be labelled all the same
            error = " ".join(str(cause).split())
            entries.append(RecordingEntry(index, path.stem, error=error))
            continue
        proposals = open_proposals(workspace.proposals(index), labels or {})
        entry = RecordingEntry(
            id=index,
            name=summary.name,
            duration=summary.duration,
            fingers=list(summary.fingers),
            labelled=labels is not None,
            n_labels=summary.n_inside if labels is None else sum(map(len, labels.values())),
            n_proposals=sum(map(len, proposals.values())),
            n_doubtful=len(doubtful(labels or {})) + len(doubtful(proposals)),
        )
        entries.append(entry)
    return RecordingList(workspace.author, entries)


def describe_recording(workspace: Workspace, index: int) -> RecordingDetails:
    """Return all that the page shows of a recording but its signals.

    Raises:
        RecordingError: the recording or its label file cannot be read.
    """
    opened, stored = workspace.open(index), workspace.stored(index)
    recording, proposals = opened.recording, workspace.proposals(index)
    return RecordingDetails(
        id=index,
        name=recording.name,
        start=recording.start,
        end=recording.end,
        fingers=list(recording.modules),
        unit={name: str(module.unit) for name, module in recording.modules.items()},
        rate=recording.rate,
        labels=labels_data(stored.labels),
        proposals=labels_data(proposals),
        doubtful=doubtful_labels(stored.labels, proposals),
        markers=list(recording.markers),
        media=[
            Video(number, name, offset, beside(opened.path, name) is None)
            for number, (name, offset) in enumerate(recording.media)
        ],
        note=stored.note,
        author=stored.author,
        time=stored.time,
        revision=stored.revision,
        read_only=is_read_only(opened.path),
        origin=stored.origin,
    )


def doubtful_labels(labels: ModuleLabels, proposals: ModuleLabels) -> list[DoubtfulLabel]:
    """Return labels and open proposals of low confidence, lowest first."""
    unsure = [*doubtful(labels), *doubtful(open_proposals(proposals, labels))]
    return [
        DoubtfulLabel(finger, label.start, label.end, state_name(label.state), label.confidence)
        for finger, label in sorted(unsure, key=lambda pair: pair[1].confidence)
    ]


def open_proposals(proposals: ModuleLabels, labels: ModuleLabels) -> dict[str, list[Label]]:
    """Return the proposals whose middle has no label yet."""
    still_open: dict[str, list[Label]] = {}
    for finger, proposed in proposals.items():
        still_open[finger] = []
        for label in proposed:
            # By the middle: a label that was taken over and then moved a little still answers it.
            middle = (label.start + label.end) / 2
            if not any(done.start <= middle < done.end for done in labels.get(finger, ())):
                still_open[finger].append(label)
    return still_open


def labels_data(labels: ModuleLabels) -> dict[str, list[LabelData]]:
    """Return labels by finger as they are written to JSON."""
    return {name: [label_data(label) for label in finger] for name, finger in labels.items()}
