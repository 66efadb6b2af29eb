"""Labels that `holdfast label auto` and `import` write, and what they print of them."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from holdfast.cli.label.inputs import SaveOptions, current_time
from holdfast.cli.terminal.console import (
    print_error,
    print_json,
    print_line,
    print_message,
    print_table,
)
from holdfast.cli.terminal.progress import progress
from holdfast.recordings import shown_origin

if TYPE_CHECKING:
    from holdfast.labelling.labelled_files import LabelsOf

MAX_DOUBTFUL_SHOWN = 5
"""Maximum number of doubtful labels in the table; JSON has all of them."""


def label_all(
    paths: Sequence[Path],
    labels_of: "LabelsOf",
    author: str,
    saving: SaveOptions,
) -> list[dict[str, Any]]:
    """Label recordings; return a JSON document of each: its labels, or an error.

    Raises:
        RecordingError: there is no recording at a path.
        OutputError: a recording has labels of a person.
    """
    from holdfast.labelling.labelled_files import check_no_manual_labels, label_file, recordings_at

    files = recordings_at(paths)
    # All are checked before the first is written.
    if not (saving.dry_run or saving.force):
        check_no_manual_labels(files)
    return [
        label_file(path, labels_of, author, None if saving.dry_run else current_time())
        for path in progress(files, "labelling")
    ]


def print_labelled(
    origin: dict[str, str],
    documents: Sequence[dict[str, Any]],
    saving: SaveOptions,
    *,
    as_json: bool,
) -> None:
    """Print what was labelled; report labels that are hidden now, and recordings that failed.

    Args:
        origin: what made the labels; the first field of the JSON document.
        documents: from `label_all`.
        saving: how the labels were saved.
        as_json: print JSON.

    Raises:
        RecordingError: a recording failed.
    """
    from holdfast.errors import RecordingError

    if as_json:
        print_json({**origin, "written": not saving.dry_run, "recordings": documents})
    else:
        print_seconds(documents)
    if n_hidden := sum(bool(document.get("n_inside")) for document in documents):
        outrank = (
            "would outrank them in train and evaluate"
            if saving.dry_run
            else "outrank them in train and evaluate: delete NAME.labels.json to use them again"
        )
        print_message(
            f"{n_hidden} of {len(documents)} recordings came with labels; the label files {outrank}"
        )
    errors = [document["error"] for document in documents if "error" in document]
    for error in errors[:-1]:
        print_error(error)
    if errors:
        raise RecordingError(errors[-1])


def print_seconds(documents: Sequence[dict[str, Any]]) -> None:
    """Print seconds per state of each recording, and labels with low confidence."""
    good = [document for document in documents if "error" not in document]
    if not good:
        return
    print_table(
        ("recording", "stable [s]", "unstable [s]", "no contact [s]", "doubtful"),
        [
            (x["name"], *(f"{s:.2f}" for s in x["seconds"].values()), len(x["doubtful"]))
            for x in good
        ],
    )
    doubtful = [(document["name"], label) for document in good for label in document["doubtful"]]
    if not doubtful:
        return
    doubtful.sort(key=lambda item: item[1]["confidence"])
    origins = {
        document["name"]: shown_origin(
            min(label["start"] for labels in document["labels"].values() for label in labels)
        )
        for document in good
        if document["doubtful"]
    }
    print_line()
    shown = doubtful[:MAX_DOUBTFUL_SHOWN]
    print_line(f"check these first, the least certain of {len(doubtful)} (--json has all):")
    # Without the name of a single recording, each label is one line of 80 columns.
    several = len(good) > 1
    header = ("finger", "start [s]", "end [s]", "state", "sure [%]", "evidence")
    rows = [
        (x["finger"], f"{x['start'] - origins[name]:.2f}", f"{x['end'] - origins[name]:.2f}",
         x["state"], f"{100 * x['confidence']:.0f}", x["evidence"])
        for name, x in shown
    ]  # fmt: skip
    names = [(name,) * several for name, _ in shown]
    print_table(
        ("recording",) * several + header,
        [name + row for name, row in zip(names, rows, strict=True)],
    )
