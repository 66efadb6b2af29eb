"""Recordings to label, by their paths, and the label files that are written beside them."""

from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import msgspec

from holdfast.errors import HoldfastError, OutputError, RecordingError
from holdfast.files import file_stem, refuse_overwrite, write_whole
from holdfast.io import labels_to_csv, load_dataset, load_recording
from holdfast.io.file_formats import SUFFIXES
from holdfast.io.header import label_of
from holdfast.io.label_files import (
    SUFFIX,
    decode_labels,
    label_bytes,
    labels_for,
    labels_from_csv,
    labels_path,
    load_labels,
)
from holdfast.labelling.review.confidence import doubtful, state_name
from holdfast.labelling.review.content import label_seconds
from holdfast.labelling.rules.forces import evidence_of_contact
from holdfast.labelling.server.documents import labels_data
from holdfast.labelling.server.store import ModuleLabels, revision_of, save_stored
from holdfast.labelling.server.workspace import summary_of
from holdfast.recordings import Recording
from holdfast.removed import removal

LabelsOf = Callable[[Recording, Path], ModuleLabels]
"""Function that returns the labels of a recording, from it and its path."""


def recordings_at(paths: Sequence[Path]) -> list[Path]:
    """Return the recordings at these paths, without duplicates; of a folder all recordings.

    Raises:
        RecordingError: a path does not exist or is no recording, or a folder has none.
    """
    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            files.extend(load_dataset(path).paths)
        elif not path.exists():
            raise RecordingError(f"{path} does not exist; a recording or a folder expected")
        elif path.suffix not in SUFFIXES:
            raise RecordingError(
                f"{path} is not a recording: {' or '.join(SUFFIXES)} expected "
                "(`holdfast import` reads other formats)"
            )
        else:
            files.append(path)
    return list(dict.fromkeys(files))


def read_labels(path: Path, recording: Recording) -> ModuleLabels:
    """Read the labels of a recording from a file, or from a file in a folder.

    A file is a label file (`.labels.json`), a recording with labels inside or beside it
    (`.parquet`, `.mcap`) or a table (`.csv`). In a folder it is the first that exists of
    `NAME.labels.json`, `NAME.parquet`, `NAME.mcap`, `NAME.labels.csv` and `NAME.csv`.

    Args:
        path: of the file or folder.
        recording: the recording.

    Returns:
        By finger, in order of time; fingers without labels are left out.

    Raises:
        RecordingError: there are no labels, they are of another recording or do not fit it, or
            the file cannot be read.
    """
    file = path
    if file.is_dir():
        # The label file first: it outranks what is inside a recording, as when one is loaded.
        stem, endings = file_stem(recording.name), (SUFFIX, *SUFFIXES, ".labels.csv", ".csv")
        files = [at for ending in endings if (at := path / f"{stem}{ending}").is_file()]
        if not files:
            raise RecordingError(
                f"no labels of {recording.name!r} in {path}; "
                f"{stem} with one of {', '.join(endings)} expected"
            )
        file = files[0]
    labels = _read(file, recording)
    try:
        validated = recording.with_labels(labels)
    except RecordingError as cause:
        raise RecordingError(f"{file}: {cause}") from cause
    return {name: module.labels for name, module in validated.modules.items() if module.labels}


def _read(file: Path, recording: Recording) -> ModuleLabels:
    if file.suffix in SUFFIXES:
        other = load_recording(file)
        _check_digest(file, other.digest, other.name, recording)
        return {name: module.labels for name, module in other.modules.items()}
    if file.suffix == ".csv":
        return labels_from_csv(file)
    if file.suffix == ".json":
        try:
            labels = load_labels(file)
        except RecordingError as cause:
            # Any other JSON may be of Label Studio.
            if file.name.endswith(SUFFIX) or not isinstance(cause.__cause__, msgspec.DecodeError):
                raise
            removed = removal("labels", "label-studio", "the format label-studio")
            raise RecordingError(f"{cause}; {removed}") from cause
        _check_digest(file, labels.recording, labels.name, recording)
        try:
            return {name: tuple(map(label_of, x)) for name, x in labels.modules.items()}
        except ValueError as cause:
            raise RecordingError(f"{file}: {cause}") from cause
    raise RecordingError(
        f"cannot read labels from {file}: {file.suffix or 'no suffix'} given; {SUFFIX}, "
        f".csv, {' or '.join(SUFFIXES)} expected"
    )


def _check_digest(file: Path, digest: str, name: str, recording: Recording) -> None:
    if digest != recording.digest:
        raise RecordingError(
            f"{file} labels another recording ({name!r}, hash {digest[:12]}) than "
            f"{recording.name!r} (hash {recording.digest[:12]})"
        )


def check_no_manual_labels(files: Sequence[Path]) -> None:
    """Check that no recording has labels of a person.

    Raises:
        OutputError: a recording has labels of a person.
    """
    manual = [(path, name) for path in files if (name := _manual_author(path)) is not None]
    if manual:
        path, name = manual[0]
        more = f" (and {len(manual) - 1} more)" if len(manual) > 1 else ""
        raise OutputError(
            f"{labels_path(path)}{more}: labels of {name or 'a person'} exist already; "
            "nothing was written: overwrite them with --force"
        )


def _manual_author(path: Path) -> str | None:
    """Return the person who saved the labels of a recording; None if there is none."""
    try:
        labels = labels_for(path, summary_of(path).digest)
    except RecordingError:  # `label_file` reports it
        return None
    if labels is None:
        return None
    authors = [load_labels(labels_path(path)).author]
    authors += [label.author for label in chain.from_iterable(labels.values())]
    return next((name for name in authors if not name.startswith("rule:")), None)


def label_file(
    path: Path,
    labels_of: LabelsOf,
    author: str,
    time: str | None,
) -> dict[str, Any]:
    """Label a recording, and write its label file; its note is kept.

    Args:
        path: of the recording.
        labels_of: returns its labels; called with the recording and its path.
        author: of the label file.
        time: of the label file, in ISO 8601 format; without it nothing is written.

    Returns:
        A JSON document: the labels, seconds of each state, labels of low confidence, why the
        recording seems to begin in contact, and how many labels came with it; or an error.

    Raises:
        OutputError: the file cannot be written.
    """
    try:
        recording = load_recording(path, labels=False)
        labels = labels_of(recording, path)
        if time is not None:
            data = label_bytes(path)
            note = "" if data is None else decode_labels(data, labels_path(path)).notes
            save_stored(
                path, recording, labels,
                revision=revision_of(data), author=author, time=time, note=note,
            )  # fmt: skip
        return _document(path, recording, labels)
    except HoldfastError as cause:
        return {"name": path.stem, "path": str(path), "error": str(cause)}


def _document(path: Path, recording: Recording, labels: ModuleLabels) -> dict[str, Any]:
    seconds = label_seconds(chain.from_iterable(labels.values()))
    return {
        "name": recording.name,
        "path": str(path),
        "file": str(labels_path(path)),
        "seconds": {state: round(duration, 6) for state, duration in seconds.items()},
        "labels": msgspec.to_builtins(labels_data(labels)),
        "doubtful": [
            {
                "finger": finger,
                "start": label.start,
                "end": label.end,
                "state": state_name(label.state),
                "confidence": label.confidence,
                "evidence": label.evidence,
            }
            for finger, label in doubtful(labels)
        ],
        "starts_loaded": evidence_of_contact(recording),
        "n_inside": sum(len(module.labels) for module in recording.modules.values()),
    }


def save_csv(recording: Recording, folder: Path, *, force: bool) -> Path:
    """Write the labels of a recording to a CSV file, and return its path.

    Raises:
        OutputError: the file exists and `force` is not given, or it cannot be written.
    """
    target = folder / f"{file_stem(recording.name)}.labels.csv"
    refuse_overwrite(target, force=force)
    labels = {name: module.labels for name, module in recording.modules.items()}
    write_whole(target, labels_to_csv(labels).encode(), force=force)
    return target
