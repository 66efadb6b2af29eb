"""Labels from the JSON export of Label Studio: one label group per finger, times in seconds.

A task is one recording. It is found by the hash or name that holdfast's export writes into its
data, or by the name of its CSV file. Each annotation of a task, and each prediction, is a set of
labels. Regions of other types, such as choices and texts, are ignored.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import msgspec

from holdfast.contact import LABEL_STATES, Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.files import read_input
from holdfast.io.label_files import MAX_LABEL_FILE_SIZE
from holdfast.recordings import Label, Recording

Labels = dict[str, tuple[Label, ...]]

_IS_TABLE = re.compile(r".*\.[ct]sv", re.IGNORECASE | re.DOTALL).fullmatch
_SUFFIX = re.compile(r"(\.signals)?\.[ct]sv$", re.IGNORECASE)


@dataclass(frozen=True)
class Annotation:
    """Labels of one recording by one person or model.

    Attributes:
        annotator: email or number of the person, or version of the model; "" if it is missing.
        prediction: whether a model made the labels.
        labels: by finger.
    """

    annotator: str
    prediction: bool
    labels: Labels


class _Value(msgspec.Struct):
    start: float
    end: float
    timeserieslabels: list[str]
    instant: bool = False


class _Result(msgspec.Struct):
    type: str = ""
    from_name: str = ""
    origin: str = ""
    value: Any = None
    score: float | None = None
    meta: Any = None

    def label(self, annotator: str) -> Label:
        """Return the label of a region.

        Raises:
            ValueError: the region is no valid label.
        """
        try:
            value = msgspec.convert(self.value, _Value)
        except msgspec.ValidationError as cause:
            raise ValueError(
                f"start and end in seconds and one label expected ({cause}); a labelling config "
                "with a timeFormat exports dates: leave it out"
            ) from cause
        if value.instant or value.start == value.end:
            raise ValueError(f"an instant at {value.start:.15g} s given, an interval expected")
        if len(value.timeserieslabels) != 1:
            given = ", ".join(value.timeserieslabels) or "none"
            raise ValueError(f"one label for an interval expected, given: {given}")
        state, cause_of = state_of(value.timeserieslabels[0])
        meta = self.meta if isinstance(self.meta, dict) else {}
        # A region that a person has changed is no longer by its first author.
        changed = self.origin == "prediction-changed"
        return Label(
            value.start,
            value.end,
            state,
            cause_of,
            evidence=str(meta.get("evidence", "")),
            confidence=1.0 if self.score is None else self.score,
            author=annotator if changed else str(meta.get("author", annotator)),
        )


class _Annotation(msgspec.Struct):
    id: int | str | None = None
    completed_by: Any = None
    was_cancelled: bool = False
    result: list[_Result] = []


class _Prediction(msgspec.Struct):
    model_version: str | None = None
    result: list[_Result] = []


class _Task(msgspec.Struct):
    id: int | str | None = None
    data: dict[str, Any] = {}
    file_upload: str | None = None
    annotations: list[_Annotation] = []
    predictions: list[_Prediction | int] = []
    """Numbers if the export leaves the content of predictions out."""

    def names(self) -> list[str]:
        """Return possible names of the recording of the task."""
        given = self.data.get("recording")
        texts = [each for each in self.data.values() if isinstance(each, str)]
        files = [*texts, self.file_upload or ""]
        # Of a path or a URL, whose last part may be a query.
        last = [re.split(r"[/\\=]", unquote(file))[-1] for file in files if _IS_TABLE(file)]
        stems = [_SUFFIX.sub("", name) for name in last]
        # Without the prefix of an upload.
        bare = [re.sub(r"^[0-9a-f]{8}-", "", stem) for stem in stems]
        return [*([given] if isinstance(given, str) else []), *bare, *stems]


def label_name(state: ContactState, cause: Cause | None = None) -> str:
    """Return the name of a label in Label Studio.

    Example:
        >>> label_name(ContactState.UNSTABLE, Cause.SLIP)
        'UNSTABLE (slip)'
    """
    return f"{state}" if cause is None else f"{state} ({cause})"


def state_of(name: str) -> tuple[ContactState, Cause | None]:
    """Return the state and cause of the name of a label.

    Raises:
        ValueError: the name is unknown.

    Example:
        >>> state_of("UNSTABLE (slip)")
        (<ContactState.UNSTABLE: 'UNSTABLE'>, <Cause.SLIP: 'slip'>)
    """
    match = re.fullmatch(r"\s*(\w+)\s*(?:\(\s*(\w+)\s*\))?\s*", name)
    state, cause = match.groups() if match else ("", None)
    if state.upper() not in LABEL_STATES or (cause and cause.lower() not in tuple(Cause)):
        raise ValueError(
            f"unknown label {name!r}; there are {', '.join(LABEL_STATES)}, "
            f"alone or with a cause in brackets ({', '.join(Cause)})"
        )
    return ContactState(state.upper()), Cause(cause.lower()) if cause else None


def is_label_studio(data: bytes) -> bool:
    """Return whether a JSON document is a list of tasks, or one task."""
    try:
        document = msgspec.json.decode(data)
    except (ValueError, RecursionError):  # msgspec's errors are ValueErrors
        return False
    first = document[0] if isinstance(document, list) and document else document
    return isinstance(first, dict) and "data" in first


def annotations_of(path: str | Path, recording: Recording) -> list[Annotation]:
    """Return all annotations of a recording in an export, then all predictions.

    Annotations that were cancelled are left out.

    Args:
        path: of the JSON export.
        recording: the recording.

    Raises:
        RecordingError: the file is no such export or has no task of the recording, a label is
            unknown, reversed, outside the recording or overlaps another, or a label group is
            no finger.
    """
    try:
        document = msgspec.json.decode(read_input(path, MAX_LABEL_FILE_SIZE))
        tasks = document if isinstance(document, list) else [document]
        task = _task_of(msgspec.convert(tasks, list[_Task]), recording, Path(path))
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror}") from cause
    except (ValueError, RecursionError) as cause:  # msgspec's errors are ValueErrors
        raise RecordingError(f"{path} is no JSON export of Label Studio: {cause}") from cause
    found = []
    for annotation in task.annotations:
        if not annotation.was_cancelled:
            # A number in older versions and exports, an object with names in others.
            person = annotation.completed_by
            if isinstance(person, dict):
                person = person.get("email") or person.get("username") or person.get("id")
            annotator = "" if person is None else str(person)
            number = "an annotation" if annotation.id is None else f"annotation {annotation.id}"
            where = f"{path}, {recording.name!r}, {number}"
            found.append(
                Annotation(
                    annotator, False, _labels(annotation.result, recording, where, annotator)
                )
            )
    for made in task.predictions:
        if isinstance(made, _Prediction):
            annotator = made.model_version or ""
            where = f"{path}, {recording.name!r}, prediction {annotator!r}"
            found.append(
                Annotation(annotator, True, _labels(made.result, recording, where, annotator))
            )
    return found


def labels_from_label_studio(
    path: str | Path, recording: Recording, annotator: str | None = None
) -> Labels:
    """Return the labels of one annotator or model, by finger.

    Args:
        path: of the JSON export.
        recording: the recording.
        annotator: email or number of a person, or version of a model. By default the only
            person who labelled the recording, or the only model if no person did.

    Raises:
        RecordingError: see `annotations_of`; or the choice is not unique.
    """
    every = annotations_of(path, recording)
    if annotator is None:
        # What a person has labelled is final; predictions wait for one.
        found = [each for each in every if not each.prediction] or every
    else:
        found = [each for each in every if each.annotator == annotator]
    if len(found) == 1:
        return found[0].labels
    annotators = ", ".join(
        f"{each.annotator or 'unnamed'}{' (prediction)' * each.prediction}" for each in every
    )
    wanted = "one annotation" if annotator is None else f"one annotation by {annotator!r}"
    raise RecordingError(
        f"{path}: {wanted} of {recording.name!r} expected, {len(found)} found; "
        f"its annotators are {annotators or 'none'}"
    )


def _task_of(tasks: Sequence[_Task], recording: Recording, path: Path) -> _Task:
    """Return the task of a recording, by its hash or else by name."""
    named = [task for task in tasks if recording.name in task.names()]
    # The hash first: files are renamed, and names are given twice.
    known = [task for task in tasks if task.data.get("digest") == recording.digest]
    if not known and any("digest" in task.data for task in named):
        raise RecordingError(
            f"{path}: the task of {recording.name!r} is of another recording of that name "
            f"(hash {str(named[0].data['digest'])[:12]}, not {recording.digest[:12]})"
        )
    found = known or named
    if len(found) == 1:
        return found[0]
    names = ", ".join(dict.fromkeys(name for task in tasks for name in task.names()[:1]))
    raise RecordingError(
        f"{path}: one task of {recording.name!r} expected, {len(found)} found; "
        f"its {len(tasks)} tasks are of {names or 'recordings without a name'}"
    )


def _labels(results: Sequence[_Result], recording: Recording, where: str, annotator: str) -> Labels:
    labels: dict[str, list[Label]] = {}
    for result in results:
        if result.type != "timeserieslabels":
            continue
        finger = result.from_name
        if finger not in recording.modules:
            raise RecordingError(
                f"{where}: label group {finger!r} is no finger; one group for each of "
                f"{', '.join(recording.modules)} expected"
            )
        try:
            labels.setdefault(finger, []).append(result.label(annotator))
        except ValueError as cause:
            raise RecordingError(f"{where}, {finger}: {cause}") from cause
    try:
        validated = recording.with_labels(labels)
    except RecordingError as cause:
        raise RecordingError(f"{where}: {cause}") from cause
    return {
        finger: validated.modules[finger].labels for finger in recording.modules if finger in labels
    }
