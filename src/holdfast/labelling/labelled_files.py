"""Recordings to label, by their paths, and the label files that are written beside them."""

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import msgspec

from holdfast.errors import HoldfastError, OutputError, RecordingError
from holdfast.files import file_stem, refuse_overwrite, write_whole
from holdfast.io import labels_to_csv, load_dataset, load_recording
from holdfast.io.label_files import SUFFIX, labels_for, labels_path, load_labels
from holdfast.io.recording_files import SUFFIXES
from holdfast.labelling.review.compare import Agreement, RecordingAgreement, compare, pool
from holdfast.labelling.review.content import label_seconds
from holdfast.labelling.review.spans import doubtful, state_name
from holdfast.labelling.rules import RULES
from holdfast.labelling.rules.forces import evidence_of_contact
from holdfast.labelling.server.documents import labels_data
from holdfast.labelling.server.store import ModuleLabels, revision_of, save_stored
from holdfast.labelling.server.workspace import summary_of
from holdfast.recordings import Recording

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


def recordings_beside(place: Path) -> list[Path]:
    """Return the recordings in a folder, at a path, or beside a label file; may be none.

    Raises:
        RecordingError: a label file cannot be read.
    """
    if place.is_dir():
        try:
            return list(load_dataset(place).paths)
        except RecordingError:
            return []
    if place.suffix in SUFFIXES:
        return [place]
    stems = [place.stem]
    if place.name.endswith(SUFFIX):
        stems = [place.name.removesuffix(SUFFIX), load_labels(place).name]
    beside = [place.with_name(stem + suffix) for stem in stems for suffix in SUFFIXES]
    return [path for path in beside if path.is_file()][:1]


def is_rule(place: Path) -> bool:
    """Return whether a path is the name of a rule, and no file."""
    return str(place) in RULES and not place.exists()


def recordings_to_compare(a: Path, b: Path) -> list[Path]:
    """Return the recordings to compare: those in A, otherwise those in B.

    Args:
        a: files or folders of labels or recordings, or a rule.
        b: likewise.

    Raises:
        RecordingError: there are none.
        ValueError: both are rules.
    """
    places = [place for place in (a, b) if not is_rule(place)]
    if not places:
        raise ValueError(f"rules {a} and {b} given; A or B must be recordings or labels")
    for place in places:
        if not place.exists():
            raise RecordingError(f"{place} does not exist; labels, recordings or a rule expected")
    for place in places:
        if files := recordings_beside(place):
            return files
    raise RecordingError(
        f"no recordings beside the labels in {a} or {b}; recordings give the sample times"
    )


def compare_files(
    files: Iterable[Path], labels_of_a: LabelsOf, labels_of_b: LabelsOf
) -> tuple[Agreement, dict[str, str]]:
    """Return the agreement of A and B, and why recordings are left out, by their names.

    Raises:
        RecordingError: all recordings are left out.
    """
    compared: dict[str, RecordingAgreement] = {}
    left_out: dict[str, str] = {}
    for path in files:
        try:
            recording = load_recording(path, labels=False)
            a, b = labels_of_a(recording, path), labels_of_b(recording, path)
            if any(a.values()) and any(b.values()):
                times = {name: module.times for name, module in recording.modules.items()}
                compared[recording.name] = compare(a, b, times, recording.name)
            else:
                side = "B" if any(a.values()) else "A"
                left_out[recording.name] = f"{side} has no labels of this recording"
        except RecordingError as cause:
            left_out[path.stem] = str(cause)
    if not compared:
        name, text = next(iter(left_out.items()))
        more = f" (and {len(left_out) - 1} other recordings)" if len(left_out) > 1 else ""
        raise RecordingError(f"nothing to compare: {name}: {text}{more}")
    return pool([*compared.values()]), left_out


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
            existing = labels_for(path, recording.digest)
            note = "" if existing is None else load_labels(labels_path(path)).notes
            save_stored(
                path, recording, labels,
                revision=revision_of(path), author=author, time=time, note=note,
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
