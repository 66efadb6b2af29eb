"""`holdfast label --auto RULE`: what a rule proposes, as label files."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from holdfast.cli.label.inputs import (
    MOST_DOUBTFUL,
    Asking,
    check_rule,
    doubtful_of,
    labels_json,
    now,
    recordings_at,
    seconds_of,
)
from holdfast.cli.terminal.console import complain, print_json, print_table, say, show
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.labelling.server.store import Labels
    from holdfast.recordings import Recording


def label_by_rule(
    paths: Sequence[Path],
    rule: str,
    asking: Asking,
    *,
    author: str | None,
    dry_run: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Writes what a rule proposes for recordings, and tells what a person should look at.

    Args:
        paths: of recordings, or folders of them.
        rule: that labels.
        asking: what it is given.
        author: who signs the label files; the rule by default.
        dry_run: write nothing.
        force: replace a person's labels.
        as_json: print JSON.

    Raises:
        OutputError: a person labelled one of the recordings, or a file cannot be written.
        HoldfastError: a recording cannot be labelled; the others are.
        ValueError: an unknown rule or parameter.
    """
    check_rule(rule)
    asking.arguments(rule)
    files = recordings_at(paths)
    if not (dry_run or force):
        refuse_persons(files)

    def label(path: Path, recording: "Recording") -> "Labels":
        labels = asking.propose(rule, recording)
        if not dry_run:
            write(path, recording, labels, author or f"rule:{rule}")
        return labels

    documents = label_all(files, label)
    if as_json:
        print_json({"rule": rule, "written": not dry_run, "recordings": documents})
    else:
        tell(documents)
    finish(documents, written=not dry_run)


def refuse_persons(files: Sequence[Path]) -> None:
    """Does nothing where no person has labelled any of the recordings.

    Raises:
        OutputError: a person has.
    """
    from holdfast.errors import OutputError
    from holdfast.io.label_files import labels_path

    theirs = [(path, who) for path in files if (who := _person(path)) is not None]
    if theirs:
        path, who = theirs[0]
        more = f" (and {len(theirs) - 1} more)" if len(theirs) > 1 else ""
        raise OutputError(
            f"{labels_path(path)}{more}: labels of {who or 'a person'} are there already; "
            "nothing was written: --force replaces them"
        )


def _person(path: Path) -> str | None:
    """Who saved the labels of a recording by hand; None where nobody did."""
    from holdfast.errors import RecordingError
    from holdfast.io.label_files import labels_for, labels_path, load_labels
    from holdfast.labelling.server.workspace import summary_of

    try:
        labels = labels_for(path, summary_of(path).digest)
    except RecordingError:  # `label_all` tells, and writes nothing there
        return None
    if labels is None:
        return None
    every = [label.author for own in labels.values() for label in own]
    authors = [load_labels(labels_path(path)).author, *every]
    return next((name for name in authors if not name.startswith("rule:")), None)


def label_all(
    files: Sequence[Path], label: "Callable[[Path, Recording], Labels]"
) -> list[dict[str, Any]]:
    """What becomes of each recording: its labels and its doubts, or an error."""
    from holdfast.errors import HoldfastError
    from holdfast.io import load_recording

    documents: list[dict[str, Any]] = []
    for path in progress(files, "labelling"):
        try:
            recording = load_recording(path, labels=False)
            documents.append(_document(path, recording, label(path, recording)))
        except HoldfastError as cause:
            documents.append({"name": path.stem, "path": str(path), "error": str(cause)})
    return documents


def write(path: Path, recording: "Recording", labels: "Labels", author: str) -> None:
    """Writes labels into the label file of a recording; its note is kept.

    Raises:
        OutputError: it cannot be written.
        RecordingError: the file there is of another recording, or none.
    """
    from holdfast.io.label_files import labels_for, labels_path, load_labels
    from holdfast.labelling.server.store import revision_of, save_stored

    there = labels_for(path, recording.digest)
    note = "" if there is None else load_labels(labels_path(path)).notes
    save_stored(
        path, recording, labels, revision=revision_of(path), author=author, time=now(), note=note
    )


def tell(documents: Sequence[dict[str, Any]]) -> None:
    """Prints seconds per state of each recording, and what is doubtful."""
    good = [each for each in documents if "error" not in each]
    if not good:
        return
    rows = [
        (
            each["name"],
            *(f"{each['seconds'][state]:.2f}" for state in each["seconds"]),
            len(each["doubtful"]),
        )
        for each in good
    ]
    print_table(("recording", "stable [s]", "unstable [s]", "no contact [s]", "doubtful"), rows)
    doubts = sorted(
        ((each["name"], one) for each in good for one in each["doubtful"]),
        key=lambda found: found[1]["confidence"],
    )
    if doubts:
        show("\nlook at these first:")
        _tell_doubts(doubts)


def _tell_doubts(doubts: Sequence[tuple[str, dict[str, Any]]]) -> None:
    rows = [
        (
            name,
            one["finger"],
            f"{one['start']:.2f}",
            f"{one['end']:.2f}",
            one["state"],
            f"{one['confidence']:.2f}",
            one["evidence"],
        )
        for name, one in doubts[:MOST_DOUBTFUL]
    ]
    header = ("recording", "finger", "start [s]", "end [s]", "state", "confidence", "evidence")
    print_table(header, rows)
    if len(doubts) > MOST_DOUBTFUL:
        show(f"and {len(doubts) - MOST_DOUBTFUL} more: --json tells all of them")


def finish(documents: Sequence[dict[str, Any]], *, written: bool) -> None:
    """Tells which labels are hidden now, and which recordings failed.

    Args:
        documents: from `label_all`.
        written: whether label files were.

    Raises:
        RecordingError: one failed.
    """
    from holdfast.errors import RecordingError

    n_hidden = sum(bool(each.get("n_inside")) for each in documents)
    if written and n_hidden:
        say(
            f"{n_hidden} of {len(documents)} recordings have labels inside as well: the label "
            "files count while they are there"
        )
    errors = [each["error"] for each in documents if "error" in each]
    for error in errors[:-1]:
        complain(error)
    if errors:
        raise RecordingError(errors[-1])


def _document(path: Path, recording: "Recording", labels: "Labels") -> dict[str, Any]:
    from holdfast.io.label_files import labels_path

    return {
        "name": recording.name,
        "path": str(path),
        "file": str(labels_path(path)),
        "seconds": seconds_of(labels),
        "labels": labels_json(labels),
        "doubtful": doubtful_of(labels),
        "n_inside": sum(len(module.labels) for module in recording.modules.values()),
    }
