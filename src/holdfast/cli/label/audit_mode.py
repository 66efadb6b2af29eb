"""`holdfast label --audit`: labels that a cross-validated classifier contradicts."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from holdfast.cli.label.inputs import recordings_at
from holdfast.cli.terminal.console import print_json, print_table, say, show

if TYPE_CHECKING:
    from holdfast.labelling.review.audit import Audit, Suspect


def audit_labels(paths: Sequence[Path], jobs: int, *, as_json: bool) -> "Sequence[Suspect]":
    """Tells which labels are suspect, and gives them.

    Args:
        paths: of recordings, or folders of them.
        jobs: fits at a time; -1 for as many as there are processors.
        as_json: print JSON.

    Raises:
        TrainingError: there are too few labels to learn from.
        RecordingError: a recording cannot be read.
    """
    from msgspec import to_builtins

    from holdfast.io import Dataset
    from holdfast.labelling.review.audit import audit

    files = recordings_at(paths)
    say(f"training on the labels of {len(files)} recordings, to judge each by the others")
    found = audit(Dataset(files), n_jobs=jobs)
    if as_json:
        print_json(to_builtins(found))
    else:
        _tell(found)
    return found.suspects


def _tell(found: "Audit") -> None:
    rows = [
        (
            each.recording, each.finger, each.kind, f"{each.start:.2f}", f"{each.end:.2f}",
            each.given, each.expected, f"{each.confidence:.2f}",
            "-" if each.shift is None else f"{each.shift:+.2f}",
        )
        for each in found.suspects
    ]  # fmt: skip
    if rows:
        header = (
            "recording", "finger", "kind", "start [s]", "end [s]",
            "label", "expected", "confidence", "shift [s]",
        )  # fmt: skip
        print_table(header, rows)
        show()
    show(
        f"{len(rows)} suspects in {found.judged:.1f} s of labels of {found.n_recordings} recordings"
    )
