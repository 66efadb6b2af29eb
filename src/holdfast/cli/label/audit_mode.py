"""`holdfast label --audit`: print labels that a cross-validated classifier contradicts."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from holdfast.cli.label.inputs import recordings_at
from holdfast.cli.terminal.console import print_json, print_line, print_message, print_table

if TYPE_CHECKING:
    from holdfast.labelling.review.audit import Audit, Suspect


def audit_labels(paths: Sequence[Path], jobs: int, *, as_json: bool) -> "Sequence[Suspect]":
    """Print the labels that a classifier contradicts, and return them.

    Args:
        paths: recordings, or folders of recordings.
        jobs: number of parallel fits; -1: one per processor.
        as_json: print JSON.

    Raises:
        TrainingError: there are too few labels to train a classifier.
        RecordingError: a recording cannot be read.
    """
    from msgspec import to_builtins

    from holdfast.io import Dataset
    from holdfast.labelling.review.audit import audit

    files = recordings_at(paths)
    print_message(f"cross-validating the labels of {len(files)} recordings")
    found = audit(Dataset(files), n_jobs=jobs)
    if as_json:
        print_json(to_builtins(found))
    else:
        _print(found)
    return found.suspects


def _print(found: "Audit") -> None:
    rows = [
        (
            suspect.recording, suspect.finger, suspect.kind,
            f"{suspect.start:.2f}", f"{suspect.end:.2f}",
            suspect.given, suspect.expected, f"{suspect.confidence:.2f}",
            "-" if suspect.shift is None else f"{suspect.shift:+.2f}",
        )
        for suspect in found.suspects
    ]  # fmt: skip
    if rows:
        header = (
            "recording", "finger", "kind", "start [s]", "end [s]",
            "label", "expected", "confidence", "shift [s]",
        )  # fmt: skip
        print_table(header, rows)
        print_line()
    print_line(
        f"{len(rows)} suspects in {found.judged:.1f} s of labels of {found.n_recordings} recordings"
    )
