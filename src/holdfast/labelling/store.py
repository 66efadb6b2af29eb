"""The label file of a recording under a person's hands: read, checked, and saved whole.

What was saved is on the disk. Nothing is written over what the writer has not seen: a revision
is a hash of the file's bytes, and whoever saves says which revision he changed.
"""

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import msgspec

from holdfast.contact import Cause, ContactState
from holdfast.errors import HoldfastError, OutputError, RecordingError
from holdfast.files import write_whole
from holdfast.io.header import label_data
from holdfast.io.label_files import LabelFile, labels_for, labels_path, load_labels
from holdfast.recordings import Label, Recording

EDGE = 1e-6
"""Nearer times are one time [s]."""

NONE = "none"
"""The revision of a label file that is not there."""

STATES = ("stable", "unstable", "no_contact")
CAUSES = tuple(cause.value for cause in Cause)

Labels = Mapping[str, Sequence[Label]]
Origin = Literal["file", "inside", "none"]


class ReadOnlyError(OutputError):
    """A label file or its folder may not be written: mend that, or label a copy."""


class ConflictError(HoldfastError):
    """The label file changed since it was read: look at it, and decide whose labels stay.

    Attributes:
        revision: of what is on the disk now.
    """

    def __init__(self, text: str, revision: str) -> None:
        super().__init__(text)
        self.revision = revision


class GivenLabel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A label that somebody gives, before it is looked at; fields as in `Label`."""

    start: float
    end: float
    state: str
    cause: str | None = None
    evidence: str = ""
    confidence: float = 1.0
    author: str = ""


@dataclass(frozen=True)
class Stored:
    """What is on the disk of a recording's labels.

    Attributes:
        labels: by finger, for every finger of the recording; in order of time.
        origin: where they come from: the label file, the recording itself, or nowhere.
        revision: of the label file.
        author: who saved them last.
        time: when, as ISO 8601 text.
        note: on the recording.
    """

    labels: Mapping[str, tuple[Label, ...]]
    origin: Origin
    revision: str
    author: str = ""
    time: str = ""
    note: str = ""


def read_stored(path: Path, recording: Recording) -> Stored:
    """The labels of a recording: of the file beside it, else those inside.

    Args:
        path: of the recording.
        recording: as it was recorded, with the labels inside.

    Raises:
        RecordingError: the label file is damaged, of another recording, or contradicts it.
    """
    revision = revision_of(path)
    beside = labels_for(path, recording.digest)
    if beside is None:
        inside = {name: module.labels for name, module in recording.modules.items()}
        return Stored(inside, "inside" if any(inside.values()) else "none", revision)
    file = load_labels(labels_path(path))
    try:
        labels = checked(recording, beside)
    except ValueError as cause:
        raise RecordingError(f"{labels_path(path)}: {cause}") from cause
    return Stored(labels, "file", revision, file.author, file.time, file.notes)


def save_stored(
    path: Path,
    recording: Recording,
    labels: Labels,
    *,
    revision: str,
    author: str,
    time: str,
    note: str = "",
) -> Stored:
    """Saves labels into the file beside a recording, whole, and gives what is there now.

    Labels that nobody signed are signed by the author.

    Args:
        path: of the recording.
        recording: that is labelled.
        labels: by finger; a finger that is not named has none.
        revision: that the labels were changed from.
        author: who saves.
        time: when, as ISO 8601 text.
        note: on the recording.

    Raises:
        ConflictError: the file has another revision.
        ReadOnlyError: the file or its folder may not be written.
        OutputError: the disk refuses.
        RecordingError: the file there is of another recording, or none.
        ValueError: the labels contradict each other or the recording.
    """
    mine = checked(recording, labels)
    signed = {
        name: tuple(each if each.author else replace(each, author=author) for each in own)
        for name, own in mine.items()
    }
    modules = {name: [label_data(each) for each in own] for name, own in signed.items()}
    file = LabelFile(
        recording=recording.digest,
        name=recording.name,
        modules=modules,
        author=author,
        time=time,
        notes=note,
    )
    data = msgspec.json.format(msgspec.json.encode(file)) + b"\n"
    target = labels_path(path)
    if is_read_only(path):
        raise ReadOnlyError(f"{target} cannot be written: it or its folder is read-only")
    with _alone(target.parent):
        now = revision_of(path)
        if now != revision:
            raise ConflictError(
                f"{target.name} was changed by somebody else since it was read", now
            )
        labels_for(path, recording.digest)  # refuses to replace what is no label file of its own
        write_whole(target, data, force=True)
        _settle(target)
        return Stored(signed, "file", revision_of(path), author, time, note)


def revision_of(path: Path) -> str:
    """The revision of the label file of the recording at `path`.

    Raises:
        RecordingError: it cannot be read.
    """
    try:
        return hashlib.blake2b(labels_path(path).read_bytes(), digest_size=12).hexdigest()
    except FileNotFoundError:
        return NONE
    except OSError as cause:
        raise RecordingError(f"cannot read {labels_path(path)}: {cause.strerror}") from cause


def is_read_only(path: Path) -> bool:
    """Whether the labels of the recording at `path` cannot be saved.

    A file that everybody may only read is meant to stay, though a folder would let it be
    replaced, and an administrator may write all.
    """
    target = labels_path(path)
    return not (_writable(target.parent) and (not target.exists() or _writable(target)))


def checked(recording: Recording, labels: Labels) -> dict[str, tuple[Label, ...]]:
    """The labels of every finger of a recording, in order of time.

    Args:
        recording: that they label.
        labels: by finger; a finger that is not named has none.

    Raises:
        ValueError: a finger that it does not have, labels that overlap, or lie outside it; the
            text names finger and times.
    """
    if unknown := sorted(set(labels) - set(recording.modules)):
        raise ValueError(
            f"labels for {', '.join(unknown)} given; recording {recording.name!r} "
            f"has {', '.join(recording.modules)}"
        )
    for finger, own in labels.items():
        _check(finger, recording, own)
    return {
        finger: tuple(sorted(labels.get(finger, ()), key=lambda label: label.start))
        for finger in recording.modules
    }


def labels_from(given: Mapping[str, Sequence[GivenLabel]]) -> dict[str, tuple[Label, ...]]:
    """The labels that somebody gives.

    Args:
        given: by finger.

    Raises:
        ValueError: an unknown state or cause, or an interval or confidence that is none; the
            text names finger and times.
    """
    return {finger: tuple(_label(finger, each) for each in own) for finger, own in given.items()}


def _label(finger: str, given: GivenLabel) -> Label:
    place = f"{finger}, [{given.start:.10g}, {given.end:.10g}) s"
    if given.state not in STATES:
        raise ValueError(f"{place}: state {', '.join(STATES)} expected, {given.state!r} given")
    if given.cause not in (None, *CAUSES):
        raise ValueError(f"{place}: cause {', '.join(CAUSES)} or none, {given.cause!r} given")
    state, cause = ContactState(given.state.upper()), given.cause and Cause(given.cause)
    span = given.start, given.end
    try:
        return Label(*span, state, cause or None, given.evidence, given.confidence, given.author)
    except ValueError as problem:
        raise ValueError(f"{finger}: {problem}") from problem


def _check(finger: str, recording: Recording, labels: Sequence[Label]) -> None:
    for one, two in pairwise(sorted(labels, key=lambda label: label.start)):
        if two.start < one.end - EDGE:
            raise ValueError(f"{finger}: {_span(one)} and {_span(two)} overlap")
    try:
        replace(recording.modules[finger], labels=tuple(labels))
    except RecordingError as cause:
        raise ValueError(f"{finger}: {cause}") from cause


def _span(label: Label) -> str:
    return f"{label.state.value.lower()} [{label.start:.10g}, {label.end:.10g}) s"


def _writable(place: Path) -> bool:
    return os.access(place, os.W_OK) and bool(place.stat().st_mode & 0o222)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Lets nobody else save in a folder, be it another process; where the system can."""
    if os.name != "posix":
        yield
        return
    import fcntl

    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a network's disk that knows no locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _settle(target: Path) -> None:
    """Returns when the file and its place in the folder are on the disk itself."""
    places = (target, target.parent) if os.name == "posix" else ()
    for place in places:
        handle = os.open(place, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
