"""Files of labels: `<name>.labels.json` beside a recording, and CSV."""

import csv
from collections.abc import Mapping, Sequence
from hashlib import blake2b
from io import StringIO
from pathlib import Path
from typing import Literal, TypeVar

import msgspec

from holdfast.contact import Cause, ContactState
from holdfast.csv_cells import cell_text, csv_text
from holdfast.errors import RecordingError
from holdfast.files import read_input, write_whole
from holdfast.io.header import LabelData, label_data, label_of
from holdfast.recordings import Label, Recording

SUFFIX = ".labels.json"
MAX_LABEL_FILE_SIZE = 1 << 28
"""Maximum size of a file of labels [bytes]."""
CSV_COLUMNS = ("finger", "start", "end", "state", "cause")


class LabelOwner(msgspec.Struct, frozen=True, kw_only=True):
    """Recording that a label file belongs to.

    Attributes:
        schema: kind and version of the file.
        recording: `Recording.digest` of the labelled recording.
        name: name of that recording.
    """

    schema: Literal["holdfast.labels/1"] = "holdfast.labels/1"
    recording: str
    name: str


T = TypeVar("T", bound=LabelOwner)


class LabelFile(LabelOwner, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Content of a label file.

    Attributes:
        modules: labels by module; a module that is missing has none.
        author: person or program that made the labels.
        time: time of labelling, as ISO 8601 text; empty if unknown.
        notes: free text.
        digest: hash of all other fields; empty in a file that a person wrote.
    """

    modules: dict[str, list[LabelData]]
    author: str = ""
    time: str = ""
    notes: str = ""
    digest: str = ""


def labels_path(path: str | Path) -> Path:
    """Return the path of the label file of the recording at `path`.

    Example:
        >>> labels_path("grasps/can_1.parquet").name
        'can_1.labels.json'
    """
    recording = Path(path)
    return recording.with_name(recording.stem + SUFFIX)


def save_labels(
    recording: Recording,
    path: str | Path,
    *,
    author: str = "",
    time: str = "",
    notes: str = "",
    force: bool = False,
) -> Path:
    """Save the labels of a recording in the label file beside it.

    Args:
        recording: recording with the labels.
        path: path of the recording.
        author: person or program that made the labels.
        time: time of labelling, as ISO 8601 text; this package reads no clock.
        notes: free text.
        force: replace an existing label file.

    Returns:
        The path of the label file.

    Raises:
        OutputError: the label file exists or cannot be written.
    """
    file = LabelFile(
        recording=recording.digest,
        name=recording.name,
        modules={
            name: [label_data(label) for label in module.labels]
            for name, module in recording.modules.items()
        },
        author=author,
        time=time,
        notes=notes,
    )
    target = labels_path(path)
    write_whole(target, encode_labels(file), force=force)
    return target


def encode_labels(file: LabelFile) -> bytes:
    """Encode the content of a label file as JSON, with its digest."""
    complete = msgspec.structs.replace(file, digest=_digest(file))
    return msgspec.json.format(msgspec.json.encode(complete)) + b"\n"


def load_labels(path: str | Path) -> LabelFile:
    """Load the label file at `path`.

    Raises:
        RecordingError: it cannot be read, is not a label file, or does not match its digest.
    """
    try:
        return decode_labels(read_input(path, MAX_LABEL_FILE_SIZE), path)
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror}") from cause


def label_bytes(path: Path) -> bytes | None:
    """Return the content of the label file of the recording at `path`; None without one.

    Raises:
        RecordingError: it cannot be read, or is a link.
    """
    try:
        return read_input(labels_path(path), MAX_LABEL_FILE_SIZE, follow=False)
    except FileNotFoundError:
        return None
    except OSError as cause:
        raise RecordingError(f"cannot read {labels_path(path)}: {cause.strerror}") from cause


def decode_file(data: bytes, path: str | Path, kind: type[T]) -> T:
    """Decode the content of the label file at `path`, or which recording it belongs to.

    Raises:
        RecordingError: it is not a label file.
    """
    try:
        return msgspec.json.decode(data, type=kind)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as cause:
        raise RecordingError(f"{path} is not a label file: {cause}") from cause


def decode_labels(data: bytes, path: str | Path) -> LabelFile:
    """Decode the content of the label file at `path`.

    Raises:
        RecordingError: it is not a label file, or does not match its digest.
    """
    file = decode_file(data, path, LabelFile)
    if file.digest not in ("", _digest(file)):
        raise RecordingError(
            f"{path} does not match its digest: it is damaged, or was edited by hand; if you "
            'edited it, remove its line "digest"'
        )
    return file


def _digest(file: LabelFile) -> str:
    """Return the hash of all fields but the digest, in a form without spaces."""
    text = msgspec.json.encode(msgspec.structs.replace(file, digest=""))
    return blake2b(text, digest_size=16).hexdigest()


def labels_for(path: Path, digest: str) -> Mapping[str, tuple[Label, ...]] | None:
    """Return the labels in the label file of a recording, or None if there is no such file.

    Args:
        path: path of the recording.
        digest: digest of the recording.

    Raises:
        RecordingError: the file is not a label file, or belongs to another recording.
    """
    data = label_bytes(path)
    return None if data is None else labels_of(decode_labels(data, labels_path(path)), path, digest)


def labels_of(file: LabelFile, path: Path, digest: str) -> Mapping[str, tuple[Label, ...]]:
    """Return the labels of a label file by module.

    Args:
        file: content of the file.
        path: path of the recording.
        digest: digest of the recording.

    Raises:
        RecordingError: the file belongs to another recording, or a label is not valid.
    """
    check_owner(file, path, digest)
    try:
        return {
            name: tuple(label_of(label) for label in labels)
            for name, labels in file.modules.items()
        }
    except ValueError as cause:
        raise RecordingError(f"{labels_path(path)}: {cause}") from cause


def check_owner(file: LabelOwner, path: Path, digest: str) -> None:
    """Check that a label file belongs to the recording at `path`, which has this digest.

    Raises:
        RecordingError: it belongs to another recording.
    """
    if file.recording != digest:
        raise RecordingError(
            f"{labels_path(path)} labels another recording ({file.name!r}, hash "
            f"{file.recording[:12]}) than {path.name} (hash {digest[:12]}): remove it or put its "
            "recording back"
        )


def labels_to_csv(labels: Mapping[str, Sequence[Label]]) -> str:
    """Write labels by finger as CSV: finger,start,end,state,cause; times in seconds."""
    rows = [
        # a NumPy number is not written like a plain number
        (finger, float(x.start), float(x.end), x.state.value.lower(), x.cause or "")
        for finger, intervals in labels.items()
        for x in intervals
    ]
    return csv_text([CSV_COLUMNS, *rows])


def labels_from_csv(path: str | Path, *, author: str = "") -> dict[str, tuple[Label, ...]]:
    """Read labels by finger from CSV with the columns finger,start,end,state,cause.

    Args:
        path: path of the CSV file; times in seconds.
        author: person or program that made the labels.

    Raises:
        RecordingError: a column is missing, or a row is not a label.
    """
    try:
        # Spreadsheets write a byte order mark.
        text = read_input(path, MAX_LABEL_FILE_SIZE).decode("utf-8-sig")
        labels: dict[str, list[Label]] = {}
        for number, row in enumerate(
            csv.DictReader(StringIO(text)), start=2
        ):  # row 1 is the header
            row_name = f"{path}, row {number}"
            # The cause, the last column, may be empty or missing.
            if missing := [name for name in CSV_COLUMNS[:4] if not row.get(name)]:
                raise RecordingError(
                    f"{row_name}: no {', '.join(missing)}; the columns are {','.join(CSV_COLUMNS)}"
                )
            finger, start, end, state, cause = ((row.get(k) or "").strip() for k in CSV_COLUMNS)
            try:
                label_cause = Cause(cause.lower()) if cause else None
                contact = ContactState(state.upper())
                label = Label(float(start), float(end), contact, label_cause, "csv", 1.0, author)
            except ValueError as problem:
                raise RecordingError(f"{row_name}: {problem}") from problem
            labels.setdefault(cell_text(finger), []).append(label)
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror}") from error
    except (UnicodeError, csv.Error) as error:
        raise RecordingError(f"{path} is not CSV text: {error}") from error
    return {finger: tuple(intervals) for finger, intervals in labels.items()}
