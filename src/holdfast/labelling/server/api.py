"""Replies of the labelling server: workspace and labels as documents of the schema."""

from collections.abc import Sequence

from holdfast.errors import HoldfastError
from holdfast.io.header import LabelData, label_data
from holdfast.io.label_files import labels_for
from holdfast.labelling.review.spans import doubtful, state_name
from holdfast.labelling.server.schema import (
    DoubtfulLabel,
    RecordingDetails,
    RecordingEntry,
    RecordingList,
    SuspectLabel,
    Video,
)
from holdfast.labelling.server.store import Labels, is_read_only
from holdfast.labelling.server.workspace import Workspace, beside
from holdfast.recordings import Label, Recording


def list_recordings(workspace: Workspace) -> RecordingList:
    """Return all recordings of a workspace, with the numbers of labels and proposals."""
    entries = [_entry(workspace, index) for index in range(len(workspace.paths))]
    return RecordingList(workspace.author, entries)


def _entry(workspace: Workspace, index: int) -> RecordingEntry:
    path = workspace.paths[index]
    try:
        summary = workspace.summary(index)
        labels = labels_for(path, summary.digest)
    except (HoldfastError, OSError) as cause:
        return RecordingEntry(index, path.stem, error=" ".join(str(cause).split()))
    proposals = open_proposals(workspace.proposals(index), labels or {})
    return RecordingEntry(
        id=index,
        name=summary.name,
        duration=summary.duration,
        fingers=list(summary.fingers),
        labelled=labels is not None,
        n_labels=summary.n_inside if labels is None else sum(map(len, labels.values())),
        n_proposals=sum(map(len, proposals.values())),
        n_doubtful=len(doubtful(labels or {})) + len(doubtful(proposals)),
    )


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
        suspects=_suspects(workspace, recording),
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


def doubtful_labels(labels: Labels, proposals: Labels) -> list[DoubtfulLabel]:
    """Return labels and open proposals of low confidence, lowest first."""
    found = [*doubtful(labels), *doubtful(open_proposals(proposals, labels))]
    return [
        DoubtfulLabel(finger, each.start, each.end, state_name(each.state), each.confidence)
        for finger, each in sorted(found, key=lambda one: one[1].confidence)
    ]


def open_proposals(proposals: Labels, labels: Labels) -> dict[str, list[Label]]:
    """Return the proposals whose middle has no label yet."""
    return {
        finger: [each for each in own if not _is_labelled(labels.get(finger, ()), each)]
        for finger, own in proposals.items()
    }


def labels_data(labels: Labels) -> dict[str, list[LabelData]]:
    """Return labels by finger as they are written to JSON."""
    return {finger: [label_data(each) for each in own] for finger, own in labels.items()}


def _is_labelled(labels: Sequence[Label], proposal: Label) -> bool:
    middle = (proposal.start + proposal.end) / 2
    return any(label.start <= middle < label.end for label in labels)


def _suspects(workspace: Workspace, recording: Recording) -> list[SuspectLabel]:
    return [
        SuspectLabel(s.finger, s.start, s.end, s.given, s.expected, s.confidence, s.kind)
        for s in workspace.suspects(recording.name)
    ]
