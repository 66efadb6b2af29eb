"""Labels of a recording from a file of any known format, or from a folder of files."""

from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec

from holdfast.errors import RecordingError
from holdfast.files import file_stem
from holdfast.io.header import label_of
from holdfast.io.label_files import SUFFIX, labels_from_csv, load_labels
from holdfast.io.recording_files import SUFFIXES, load_recording
from holdfast.plugins import PluginGroup
from holdfast.recordings import Label, Recording

Labels = dict[str, tuple[Label, ...]]


def read_labels(path: str | Path, recording: Recording, annotator: str | None = None) -> Labels:
    """Read the labels of a recording from a file, or from a file in a folder.

    A file is a label file (`.labels.json`), a recording with labels inside or beside it
    (`.parquet`, `.mcap`), a table (`.csv`) or a file of a plug-in, such as a JSON export of Label
    Studio (`.json`). In a folder it is the first that exists of `NAME.labels.json`,
    `NAME.parquet`, `NAME.mcap`, `NAME.labels.csv`, `NAME.csv`, `NAME.json`, and the only other
    `.json` file.

    Args:
        path: of the file or folder.
        recording: the recording.
        annotator: whose labels are read, where a format of a plug-in has those of several.

    Returns:
        By finger, in order of time; fingers without labels are left out.

    Raises:
        RecordingError: there are no labels, they are of another recording or do not fit it, or
            the file cannot be read.
    """
    file = Path(path)
    if file.is_dir():
        # The label file first: it outranks what is inside a recording, as when one is loaded.
        folder, stem = file, file_stem(recording.name)
        endings = (SUFFIX, *SUFFIXES, ".labels.csv", ".csv", ".json")
        candidates = [folder / f"{stem}{ending}" for ending in endings]
        others = [at for at in sorted(folder.glob("*.json")) if not at.name.endswith(SUFFIX)]
        # One JSON file of another name is an export of all recordings of a project.
        found = [at for at in candidates if at.is_file()] or (others if len(others) == 1 else [])
        if not found:
            raise RecordingError(
                f"no labels of {recording.name!r} in {folder}; "
                f"{stem} with one of {', '.join(endings)} expected"
            )
        file = found[0]
    labels = _read(file, recording, annotator)
    try:
        validated = recording.with_labels(labels)
    except RecordingError as cause:
        raise RecordingError(f"{file}: {cause}") from cause
    return {name: module.labels for name, module in validated.modules.items() if module.labels}


def _read(file: Path, recording: Recording, annotator: str | None) -> Labels:
    if file.suffix in SUFFIXES:
        other = load_recording(file)
        _check_digest(file, other.digest, other.name, recording)
        return {name: module.labels for name, module in other.modules.items()}
    if file.suffix == ".csv":
        return labels_from_csv(file)
    for source in [] if file.name.endswith(SUFFIX) else LABEL_PLUGINS.load_all().values():
        if source.can_read(file):
            labels: Labels = source.read(file, recording, annotator)
            return labels
    if file.suffix == ".json":
        try:
            found = load_labels(file)
        except RecordingError as cause:
            # Any other JSON may be of a format whose package is missing.
            if file.name.endswith(SUFFIX) or not isinstance(cause.__cause__, msgspec.DecodeError):
                raise
            raise RecordingError(f"{cause}{LABEL_PLUGINS.missing_text()}") from cause
        _check_digest(file, found.recording, found.name, recording)
        try:
            return {name: tuple(map(label_of, own)) for name, own in found.modules.items()}
        except ValueError as cause:
            raise RecordingError(f"{file}: {cause}") from cause
    raise RecordingError(
        f"cannot read labels from {file}: {file.suffix or 'no suffix'} given; {SUFFIX}, .json, "
        f".csv, {' or '.join(SUFFIXES)} expected"
    )


def _check_digest(file: Path, digest: str, name: str, recording: Recording) -> None:
    if digest != recording.digest:
        raise RecordingError(
            f"{file} labels another recording ({name!r}, hash {digest[:12]}) than "
            f"{recording.name!r} (hash {recording.digest[:12]})"
        )


def _label_format(name: str, loaded: Any) -> ModuleType:  # noqa: ANN401
    """Return the module of a plug-in, with the functions that every format of labels has."""
    functions = ("can_read", "read", "save")
    if not isinstance(loaded, ModuleType) or not all(hasattr(loaded, part) for part in functions):
        raise TypeError(
            f"a module with can_read, read and save expected for {name}, {loaded!r} given"
        )
    return loaded


LABEL_PLUGINS = PluginGroup("labels", ("csv",), _label_format)
"""Formats of labels of other packages."""
