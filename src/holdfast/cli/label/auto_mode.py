"""`holdfast label --auto RULE`: write the labels that a rule proposes."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from holdfast.cli.label.inputs import (
    RuleOptions,
    SaveOptions,
    check_rule,
    current_time,
    recordings_at,
)
from holdfast.cli.terminal.console import (
    print_error,
    print_json,
    print_line,
    print_message,
    print_table,
)
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.labelling.server.store import ModuleLabels
    from holdfast.recordings import Recording

MAX_DOUBTFUL_SHOWN = 20
"""Maximum number of doubtful labels in the table; JSON has all of them."""


def label_by_rule(
    paths: Sequence[Path],
    rule: str,
    options: RuleOptions,
    saving: SaveOptions,
    *,
    as_json: bool,
) -> None:
    """Write the labels that a rule proposes, and print those with low confidence.

    Args:
        paths: recordings, or folders of recordings.
        rule: name of the rule.
        options: options of the rule.
        saving: how they are saved; the author is the rule by default.
        as_json: print JSON.

    Raises:
        OutputError: a recording has labels of a person, or a file cannot be written.
        HoldfastError: a recording cannot be labelled; all others are labelled.
        ValueError: an unknown rule or parameter.
    """
    check_rule(rule)
    options.arguments(rule)
    documents = label_all(
        recordings_at(paths),
        lambda recording: options.propose(rule, recording),
        saving,
        saving.author or f"rule:{rule}",
    )
    report_loaded_starts(documents, options.tare)
    print_labelled(("rule", rule), documents, saving, as_json=as_json)


def check_no_manual_labels(files: Sequence[Path]) -> None:
    """Check that no recording has labels of a person.

    Raises:
        OutputError: a recording has labels of a person.
    """
    from holdfast.errors import OutputError
    from holdfast.io.label_files import labels_path

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
    from holdfast.errors import RecordingError
    from holdfast.io.label_files import labels_for, labels_path, load_labels
    from holdfast.labelling.server.workspace import summary_of

    try:
        labels = labels_for(path, summary_of(path).digest)
    except RecordingError:  # `label_all` reports it
        return None
    if labels is None:
        return None
    authors = [load_labels(labels_path(path)).author]
    authors += [label.author for label in chain.from_iterable(labels.values())]
    return next((name for name in authors if not name.startswith("rule:")), None)


def label_all(
    files: Sequence[Path],
    labels_of: "Callable[[Recording], ModuleLabels]",
    saving: SaveOptions,
    author: str,
) -> list[dict[str, Any]]:
    """Label recordings; return a JSON document of each: its labels, or an error.

    Raises:
        OutputError: a recording has labels of a person, or a file cannot be written.
    """
    from holdfast.errors import HoldfastError
    from holdfast.io import load_recording

    if not (saving.dry_run or saving.force):
        check_no_manual_labels(files)
    documents: list[dict[str, Any]] = []
    for path in progress(files, "labelling"):
        try:
            recording = load_recording(path, labels=False)
            labels = labels_of(recording)
            if not saving.dry_run:
                write_labels(path, recording, labels, author)
            documents.append(_document(path, recording, labels))
        except HoldfastError as cause:
            documents.append({"name": path.stem, "path": str(path), "error": str(cause)})
    return documents


def write_labels(path: Path, recording: "Recording", labels: "ModuleLabels", author: str) -> None:
    """Write the label file of a recording; keep its note.

    Raises:
        OutputError: the file cannot be written.
        RecordingError: the existing file is damaged or belongs to another recording.
    """
    from holdfast.io.label_files import labels_for, labels_path, load_labels
    from holdfast.labelling.server.store import revision_of, save_stored

    existing = labels_for(path, recording.digest)
    note = "" if existing is None else load_labels(labels_path(path)).notes
    save_stored(
        path,
        recording,
        labels,
        revision=revision_of(path),
        author=author,
        time=current_time(),
        note=note,
    )


def print_labelled(
    origin: tuple[str, str],
    documents: Sequence[dict[str, Any]],
    saving: SaveOptions,
    *,
    as_json: bool,
) -> None:
    """Print what was labelled, and report what failed.

    Args:
        origin: what made the labels, and its name; the first field of the JSON document.
        documents: from `label_all`.
        saving: how the labels were saved.
        as_json: print JSON.

    Raises:
        RecordingError: a recording failed.
    """
    written, (maker, name) = not saving.dry_run, origin
    if as_json:
        print_json({maker: name, "written": written, "recordings": documents})
    else:
        _print_documents(documents)
    _report_failures(documents, written=written)


def _print_documents(documents: Sequence[dict[str, Any]]) -> None:
    """Print seconds per state of each recording, and labels with low confidence."""
    good = [document for document in documents if "error" not in document]
    if not good:
        return
    rows = [
        (
            document["name"],
            *(f"{seconds:.2f}" for seconds in document["seconds"].values()),
            len(document["doubtful"]),
        )
        for document in good
    ]
    print_table(("recording", "stable [s]", "unstable [s]", "no contact [s]", "doubtful"), rows)
    doubtful = sorted(
        ((document["name"], label) for document in good for label in document["doubtful"]),
        key=lambda item: item[1]["confidence"],
    )
    if doubtful:
        print_line()
        print_line("labels of low confidence, check these first:")
        _print_doubtful(doubtful)


def _print_doubtful(doubtful: Sequence[tuple[str, dict[str, Any]]]) -> None:
    rows = [
        (
            name,
            label["finger"],
            f"{label['start']:.2f}",
            f"{label['end']:.2f}",
            label["state"],
            f"{label['confidence']:.2f}",
            label["evidence"],
        )
        for name, label in doubtful[:MAX_DOUBTFUL_SHOWN]
    ]
    header = ("recording", "finger", "start [s]", "end [s]", "state", "confidence", "evidence")
    print_table(header, rows)
    if len(doubtful) > MAX_DOUBTFUL_SHOWN:
        print_line(f"and {len(doubtful) - MAX_DOUBTFUL_SHOWN} more: --json prints all")


def report_loaded_starts(documents: Sequence[dict[str, Any]], tare: str | None) -> None:
    """Report recordings that begin in contact, and whether the tare fits them.

    Args:
        documents: from `label_all`.
        tare: of the option `--tare`, if it is given.
    """
    from holdfast.features import Tare

    loaded = [document for document in documents if document.get("starts_loaded")]
    if not loaded or (tare is not None and not Tare.parse(tare).without_contact):
        return
    first = loaded[0]
    text = f"{len(loaded)} of {len(documents)} recordings begin in contact "
    text += f"({first['name']}: {first['starts_loaded']})"
    if tare is not None:
        print_message(f"{text}: a tare of {tare} s contains their grip, --tare first fits them")
        return
    more = "; if the others do too, give --tare first" if len(loaded) < len(documents) else ""
    print_message(f"{text}: the first sample is their tare{more}")


def _report_failures(documents: Sequence[dict[str, Any]], *, written: bool) -> None:
    """Report labels that are hidden by the label files, and recordings that failed."""
    from holdfast.errors import RecordingError

    n_hidden = sum(bool(document.get("n_inside")) for document in documents)
    if n_hidden:
        print_message(_hidden_text(n_hidden, len(documents), written=written))
    errors = [document["error"] for document in documents if "error" in document]
    for error in errors[:-1]:
        print_error(error)
    if errors:
        raise RecordingError(errors[-1])


def _hidden_text(n_hidden: int, n: int, *, written: bool) -> str:
    text = f"{n_hidden} of {n} recordings came with labels; the label files "
    if not written:
        return f"{text}would outrank them in train and evaluate"
    return f"{text}outrank them in train and evaluate: delete NAME.labels.json to use them again"


def _document(path: Path, recording: "Recording", labels: "ModuleLabels") -> dict[str, Any]:
    from holdfast.io.label_files import labels_path
    from holdfast.labelling.rules.forces import evidence_of_contact

    return {
        "name": recording.name,
        "path": str(path),
        "file": str(labels_path(path)),
        "seconds": _label_seconds(labels),
        "labels": _labels_json(labels),
        "doubtful": _doubtful_labels(labels),
        "starts_loaded": evidence_of_contact(recording),
        "n_inside": sum(len(module.labels) for module in recording.modules.values()),
    }


def _label_seconds(labels: "ModuleLabels") -> dict[str, float]:
    """Return the duration of each state over all fingers [s], rounded to microseconds."""
    from holdfast.labelling.review.content import label_seconds

    total = label_seconds(chain.from_iterable(labels.values()))
    return {state: round(seconds, 6) for state, seconds in total.items()}


def _doubtful_labels(labels: "ModuleLabels") -> list[dict[str, Any]]:
    """Return the labels with low confidence as JSON values, the lowest first."""
    from holdfast.labelling.review.spans import doubtful

    return [
        {
            "finger": finger,
            "start": label.start,
            "end": label.end,
            "state": label.state.value.lower(),
            "confidence": label.confidence,
            "evidence": label.evidence,
        }
        for finger, label in doubtful(labels)
    ]


def _labels_json(labels: "ModuleLabels") -> Mapping[str, Any]:
    """Return labels by finger as JSON values."""
    from msgspec import to_builtins

    from holdfast.labelling.server.documents import labels_data

    values: Mapping[str, Any] = to_builtins(labels_data(labels))
    return values
