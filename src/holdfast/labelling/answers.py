"""What the label page is told of a shelf of recordings."""

from collections.abc import Sequence

from holdfast.errors import HoldfastError
from holdfast.io.header import LabelData, label_data
from holdfast.io.label_files import labels_for
from holdfast.labelling.doubt import doubtful
from holdfast.labelling.page_schema import Doubted, Doubtful, Entry, Listing, Opened, Video
from holdfast.labelling.shelf import Shelf, beside
from holdfast.labelling.spans import state_name
from holdfast.labelling.store import Labels, is_read_only
from holdfast.recordings import Label, Recording


def listing(shelf: Shelf) -> Listing:
    """All recordings of a shelf, with what is done and what is left."""
    return Listing(shelf.author, [_entry(shelf, place) for place in range(len(shelf.paths))])


def _entry(shelf: Shelf, place: int) -> Entry:
    path = shelf.paths[place]
    try:
        known = shelf.summary(place)
        labels = labels_for(path, known.digest)
    except (HoldfastError, OSError) as cause:
        return Entry(place, path.stem, error=" ".join(str(cause).split()))
    proposals = left(shelf.proposals(place), labels or {})
    return Entry(
        id=place,
        name=known.name,
        duration=known.duration,
        fingers=list(known.fingers),
        labelled=labels is not None,
        n_labels=known.n_inside if labels is None else sum(map(len, labels.values())),
        n_proposals=sum(map(len, proposals.values())),
        n_doubtful=len(doubtful(labels or {})) + len(doubtful(proposals)),
    )


def opened(shelf: Shelf, place: int) -> Opened:
    """A recording with all that a person needs to label it, but what is drawn.

    Raises:
        RecordingError: it or its label file cannot be read.
    """
    work, stored = shelf.work(place), shelf.stored(place)
    recording, proposals = work.recording, shelf.proposals(place)
    return Opened(
        id=place,
        name=recording.name,
        start=recording.start,
        end=recording.end,
        fingers=list(recording.modules),
        unit={name: str(module.unit) for name, module in recording.modules.items()},
        rate=recording.rate,
        labels=labels_data(stored.labels),
        proposals=labels_data(proposals),
        suspects=_suspects(shelf, recording),
        doubtful=doubts(stored.labels, proposals),
        markers=list(recording.markers),
        media=[
            Video(index, name, offset, beside(work.path, name) is None)
            for index, (name, offset) in enumerate(recording.media)
        ],
        note=stored.note,
        author=stored.author,
        time=stored.time,
        revision=stored.revision,
        read_only=is_read_only(work.path),
        origin=stored.origin,
    )


def doubts(labels: Labels, proposals: Labels) -> list[Doubtful]:
    """Labels of little confidence, and proposals that are not labelled yet, the worst first."""
    found = [*doubtful(labels), *doubtful(left(proposals, labels))]
    return [
        Doubtful(finger, each.start, each.end, state_name(each.state), each.confidence)
        for finger, each in sorted(found, key=lambda one: one[1].confidence)
    ]


def left(proposals: Labels, labels: Labels) -> dict[str, list[Label]]:
    """The proposals whose middle no label holds."""
    return {
        finger: [each for each in own if not _holds(labels.get(finger, ()), each)]
        for finger, own in proposals.items()
    }


def labels_data(labels: Labels) -> dict[str, list[LabelData]]:
    """Labels by finger, as a page is told them."""
    return {finger: [label_data(each) for each in own] for finger, own in labels.items()}


def _holds(labels: Sequence[Label], proposal: Label) -> bool:
    middle = (proposal.start + proposal.end) / 2
    return any(each.start <= middle < each.end for each in labels)


def _suspects(shelf: Shelf, recording: Recording) -> list[Doubted]:
    return [
        Doubted(s.finger, s.start, s.end, s.given, s.expected, s.confidence, s.kind)
        for s in shelf.suspects(recording.name)
    ]
