"""`holdfast label auto`: write the labels that a rule proposes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.label.inputs import AuthorOption, PathsArgument, RuleOptions, SaveOptions
from holdfast.cli.label.output import label_all, print_labelled
from holdfast.cli.options import JsonOption
from holdfast.cli.terminal.console import print_message
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.labelling.server.store import ModuleLabels
    from holdfast.recordings import Recording


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
    recording that begins in contact it is the first sample. The rule tracking reads the video of
    stickers beside a recording, if there is one. See docs/labels.md.

    Example:
      holdfast label auto signal recordings/ --dry-run --json
      holdfast label auto tracking grasp.parquet --video webcam.mp4
      holdfast label auto tracking grasp.parquet --poses markers.csv
      holdfast label auto tracking grasp.mcap --poses run.bag \
        --track object=/aruco/pose
    """
    require_extras("label")
    from holdfast.detection import Tare
    from holdfast.labelling.rules import RULES

    if rule not in RULES:
        raise ValueError(f"unknown rule {rule!r}; there are {', '.join(RULES)}")
    options.arguments(rule)  # wrong options are refused before the first recording is read

    def labels_of(recording: "Recording", path: Path) -> "ModuleLabels":
        return options.propose(rule, recording, path)

    documents = label_all(paths, labels_of, author or f"rule:{rule}", saving)
    loaded = [document for document in documents if document.get("starts_loaded")]
    if loaded and (options.tare is None or Tare.parse(options.tare).without_contact):
        first = loaded[0]
        text = f"{len(loaded)} of {len(documents)} recordings begin in contact "
        text += f"({first['name']}: {first['starts_loaded']})"
        if options.tare is not None:
            text += f": a tare of {options.tare} s contains their grip, --tare first fits them"
        else:
            text += ": the first sample is their tare"
            if len(loaded) < len(documents):
                text += "; if the others do too, give --tare first"
        print_message(text)
    print_labelled({"rule": rule}, documents, saving, as_json=as_json)
