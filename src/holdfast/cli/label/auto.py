"""`holdfast label auto`: write the labels that a rule proposes."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.label.inputs import (
    AuthorOption,
    PathsArgument,
    RuleOptions,
    SaveOptions,
    current_time,
)
from holdfast.cli.options import JsonOption
from holdfast.cli.terminal.console import (
    print_error,
    print_json,
    print_line,
    print_message,
    print_table,
)
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.labelling.server.store import ModuleLabels
    from holdfast.recordings import Recording

MAX_DOUBTFUL_SHOWN = 20
"""Maximum number of doubtful labels in the table; JSON has all of them."""


def auto(
    rule: Annotated[str, typer.Argument(help="signal, tracking or command.")],
    paths: PathsArgument,
    *,
    options: RuleOptions,
    author: AuthorOption = None,
    saving: SaveOptions,
    as_json: JsonOption = False,
) -> None:
    r"""Write the labels that a rule proposes.

    Labels are written to NAME.labels.json beside each recording, and those with low confidence
    are printed. They outrank labels that came with the recording; --dry-run only shows them.
    Labels of a person are overwritten only with --force. The tare is 0.5 s by default; of a
    recording that begins in contact it is the first sample. See docs/labels.md.

    Example:
      holdfast label auto signal recordings/ --dry-run --json
      holdfast label auto tracking grasp.parquet --video webcam.mp4
      holdfast label auto tracking grasp.parquet --poses markers.csv
      holdfast label auto tracking grasp.mcap --poses run.bag \
        --track object=/aruco/pose
    """
    require_extras("label")
    from holdfast.labelling.rules import RULES

    if rule not in RULES:
        raise ValueError(f"unknown rule {rule!r}; there are {', '.join(RULES)}")
    options.arguments(rule)

    def labels_of(recording: "Recording", path: Path) -> "ModuleLabels":
        return options.propose(rule, recording, path)

    documents = label_all(paths, labels_of, author or f"rule:{rule}", saving)
    _report_loaded_starts(documents, options.tare)
    print_labelled({"rule": rule}, documents, saving, as_json=as_json)


def label_all(
    paths: Sequence[Path],
    labels_of: "Callable[[Recording, Path], ModuleLabels]",
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
        _print_documents(documents)
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


def _print_documents(documents: Sequence[dict[str, Any]]) -> None:
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
    print_line()
    print_line("labels of low confidence, check these first:")
    print_table(
        ("recording", "finger", "start [s]", "end [s]", "state", "confidence", "evidence"),
        [
            (name, x["finger"], f"{x['start']:.2f}", f"{x['end']:.2f}", x["state"],
             f"{x['confidence']:.2f}", x["evidence"])
            for name, x in doubtful[:MAX_DOUBTFUL_SHOWN]
        ],
    )  # fmt: skip
    if len(doubtful) > MAX_DOUBTFUL_SHOWN:
        print_line(f"and {len(doubtful) - MAX_DOUBTFUL_SHOWN} more: --json prints all")


def _report_loaded_starts(documents: Sequence[dict[str, Any]], tare: str | None) -> None:
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
