"""Label file of a recording: read, validate and save it without losing the work of others.

A save returns when the file is on the disk. Each save names the revision that it was made from,
a hash of the bytes of the file; a file with another revision is not replaced.
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

from holdfast.contact import LABEL_STATES, TIME_TOLERANCE, Cause, ContactState
from holdfast.errors import HoldfastError, OutputError, RecordingError
from holdfast.files import lock, sync, write_whole
from holdfast.io.header import label_data
from holdfast.io.label_files import (
    LabelFile,
    LabelOwner,
    check_owner,
    decode_file,
    decode_labels,
    encode_labels,
    label_bytes,
    labels_of,
    labels_path,
)
from holdfast.recordings import Label, Recording, cut_labels

NO_REVISION = "none"
"""Revision of a label file that does not exist."""

STATE_NAMES = tuple(state.value.lower() for state in LABEL_STATES)
CAUSE_NAMES = tuple(cause.value for cause in Cause)

ModuleLabels = Mapping[str, Sequence[Label]]
Origin = Literal["file", "inside", "none"]


class ReadOnlyError(OutputError):
    """The label file or its folder is read-only. Change that, or label a copy."""


class ConflictError(HoldfastError):
    """The label file changed since it was read. Read it again before the next save.

    Attributes:
        revision: of the file on the disk.
    """

    def __init__(self, text: str, revision: str) -> None:
        super().__init__(text)
        self.revision = revision


class LabelInput(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A label as a client sends it, not validated yet; fields as in `Label`."""

    start: float
    end: float
    state: str
    cause: str | None = None
    evidence: str = ""
    confidence: float = 1.0
    author: str = ""

    def parsed(self, finger: str) -> Label:
        """Return the label of a finger.

        Raises:
            ValueError: see `parse_labels`.
        """
        where = f"{finger}, [{self.start:.10g}, {self.end:.10g}) s"
        if self.state not in STATE_NAMES:
            raise ValueError(
                f"{where}: state {', '.join(STATE_NAMES)} expected, {self.state!r} given"
            )
        if self.cause not in (None, *CAUSE_NAMES):
            raise ValueError(
                f"{where}: cause {', '.join(CAUSE_NAMES)} or none expected, {self.cause!r} given"
            )
        state, cause = ContactState(self.state.upper()), self.cause and Cause(self.cause)
        span = self.start, self.end
        try:
            return Label(*span, state, cause or None, self.evidence, self.confidence, self.author)
        except ValueError as problem:
            raise ValueError(f"{finger}: {problem}") from problem


@dataclass(frozen=True)
class StoredLabels:
    """The labels of a recording as they are on the disk.

    Attributes:
        labels: by finger, for every finger of the recording, in order of time.
        origin: the label file, the recording file itself, or none.
        revision: of the label file.
        author: of the last save.
        time: of the last save, as ISO 8601 text.
        note: on the recording.
    """

    labels: Mapping[str, tuple[Label, ...]]
    origin: Origin
    revision: str
    author: str = ""
    time: str = ""
    note: str = ""


def read_stored(path: Path, recording: Recording) -> StoredLabels:
    """Read the labels of a recording from its label file, else from the recording itself.

    Args:
        path: of the recording.
        recording: with the labels of the recording file itself.

    Raises:
        RecordingError: the label file is damaged, of another recording, or does not fit it.
    """
    data = label_bytes(path)
    if data is None:
        inside = {name: module.labels for name, module in recording.modules.items()}
        return StoredLabels(inside, "inside" if any(inside.values()) else "none", NO_REVISION)
    file = decode_labels(data, labels_path(path))
    try:
        labels = validated(recording, labels_of(file, path, recording.digest))
    except ValueError as cause:
        raise RecordingError(f"{labels_path(path)}: {cause}") from cause
    return StoredLabels(labels, "file", revision_of(data), file.author, file.time, file.notes)


def save_stored(
    path: Path,
    recording: Recording,
    labels: ModuleLabels,
    *,
    revision: str,
    author: str,
    time: str,
    note: str = "",
) -> StoredLabels:
    """Save labels to the label file of a recording, and return what is stored.

    Labels without an author get the author of the save.

    Args:
        path: of the recording.
        recording: the recording.
        labels: by finger; a finger that is missing has none.
        revision: of the label file from which the labels were edited.
        author: of the save.
        time: of the save, as ISO 8601 text.
        note: on the recording.

    Raises:
        ConflictError: the file has another revision.
        ReadOnlyError: the file or its folder is read-only.
        OutputError: the file cannot be written.
        RecordingError: the existing file is of another recording, or no label file.
        ValueError: the labels contradict each other or the recording.
    """
    signed = {
        name: tuple(label if label.author else replace(label, author=author) for label in valid)
        for name, valid in validated(recording, labels).items()
    }
    # Of half a million labels, no form is kept longer than until the next one is made.
    data = encode_labels(
        LabelFile(
            recording=recording.digest,
            name=recording.name,
            modules={name: [label_data(label) for label in done] for name, done in signed.items()},
            author=author,
            time=time,
            notes=note,
        )
    )
    target = labels_path(path)
    if is_read_only(path):
        raise ReadOnlyError(f"{target} cannot be written: it or its folder is read-only")
    # The revision is compared and the file replaced under one lock, so that two saves of the same
    # revision never both succeed.
    with _locked(target.parent):
        before = label_bytes(path)
        if (current := revision_of(before)) != revision:
            raise ConflictError(
                f"{target.name} was changed by another program since it was read", current
            )
        if before is not None:  # raises if the file is not this recording's
            check_owner(decode_file(before, target, LabelOwner), path, recording.digest)
        write_whole(target, data, force=True)
        sync(target, target.parent)
        return StoredLabels(signed, "file", revision_of(data), author, time, note)


def revision_of(data: bytes | None) -> str:
    """Return the revision of the content of a label file, from `label_bytes`."""
    return NO_REVISION if data is None else hashlib.blake2b(data, digest_size=12).hexdigest()


def is_read_only(path: Path) -> bool:
    """Return whether the labels of the recording at `path` must not be saved.

    A file without any write permission is respected, even if the folder would allow to replace
    it, or an administrator could write it.
    """
    target = labels_path(path)
    return not (_writable(target.parent) and (not target.exists() or _writable(target)))


def validated(recording: Recording, labels: ModuleLabels) -> dict[str, tuple[Label, ...]]:
    """Return the labels of every finger of a recording in order of time, after validation.

    Args:
        recording: the recording.
        labels: by finger; a finger that is missing has none.

    Raises:
        ValueError: the recording has no such finger, or labels overlap or lie outside it. The
            text names the finger and the times.
    """
    if unknown := sorted(set(labels) - set(recording.modules)):
        raise ValueError(
            f"labels for {', '.join(unknown)} given; recording {recording.name!r} "
            f"has {', '.join(recording.modules)}"
        )
    for finger, finger_labels in labels.items():
        for earlier, later in pairwise(sorted(finger_labels, key=lambda label: label.start)):
            if later.start < earlier.end - TIME_TOLERANCE:
                raise ValueError(f"{finger}: {_span_text(earlier)} and {_span_text(later)} overlap")
        try:  # a module checks all else
            replace(recording.modules[finger], labels=tuple(finger_labels))
        except RecordingError as cause:
            raise ValueError(f"{finger}: {cause}") from cause
    return {
        finger: tuple(sorted(labels.get(finger, ()), key=lambda label: label.start))
        for finger in recording.modules
    }


def parse_labels(inputs: Mapping[str, Sequence[LabelInput]]) -> dict[str, tuple[Label, ...]]:
    """Return labels from what a client sent.

    Args:
        inputs: by finger.

    Raises:
        ValueError: a state, cause, interval or confidence is invalid. The text names the finger
            and the times.
    """
    return {
        finger: tuple(label.parsed(finger) for label in labels) for finger, labels in inputs.items()
    }


def cut_to_samples(recording: Recording, labels: ModuleLabels) -> dict[str, tuple[Label, ...]]:
    """Cut each label to the samples of its own finger.

    Fingers begin and end at different times, while a page has one time axis. Labels that exceed
    the whole recording stay as they are, and `validated` rejects them. A label may end up to one
    sample period after the last sample.

    Args:
        recording: the recording.
        labels: by finger.
    """
    start = recording.start - TIME_TOLERANCE
    end = recording.end + max(module.period for module in recording.modules.values())
    cut: dict[str, tuple[Label, ...]] = {}
    for finger, uncut in labels.items():
        module = recording.modules.get(finger)
        is_inside = all(start <= x.start and x.end <= end + TIME_TOLERANCE for x in uncut)
        if module is not None and module.n_samples and is_inside:
            cut[finger] = cut_labels(uncut, module)
        else:  # `validated` rejects them
            cut[finger] = tuple(uncut)
    return cut


def _span_text(label: Label) -> str:
    return f"{label.state.value.lower()} [{label.start:.10g}, {label.end:.10g}) s"


def _writable(path: Path) -> bool:
    return os.access(path, os.W_OK) and bool(path.stat().st_mode & 0o222)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Prevent other saves in a folder, by other processes too, where the system has locks."""
    if os.name != "posix":
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # network file systems without locks
            lock(handle, wait=True)
        yield
    finally:
        os.close(handle)
