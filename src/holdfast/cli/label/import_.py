"""`holdfast label import`: labels of other programs and people."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.label.inputs import (
    AuthorOption,
    PathsArgument,
    SaveOptions,
    login_name,
)
from holdfast.cli.label.output import label_all, print_labelled
from holdfast.cli.options import JsonOption
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.labelling.server.store import ModuleLabels
    from holdfast.recordings import Recording


def import_(
    source: Annotated[Path, typer.Argument(help="A CSV file, a label file, or a folder of these.")],
    paths: PathsArgument,
    *,
    author: AuthorOption = None,
    saving: SaveOptions,
    as_json: JsonOption = False,
) -> None:
    """Import labels from CSV or other label files.

    The labels are written to NAME.labels.json beside each recording. Labels of a person are
    overwritten only with --force. See docs/labels.md.

    Example:
      holdfast label import labels/ recordings/
      holdfast label import grasp.labels.csv grasp.mcap --author ann --json
    """
    require_extras("label")
    from holdfast.errors import RecordingError
    from holdfast.labelling.labelled_files import read_labels, recordings_at

    files = recordings_at(paths)
    if not source.exists():
        raise RecordingError(f"{source} does not exist; a file or folder of labels expected")
    # A CSV of labels names fingers, and no recording.
    if source.is_file() and source.suffix == ".csv" and len(files) > 1:
        raise ValueError(f"{source} has the labels of one recording; {len(files)} recordings given")

    def labels_of(recording: "Recording", _: Path) -> "ModuleLabels":
        return read_labels(source, recording)

    documents = label_all(files, labels_of, author or login_name(), saving)
    print_labelled({"source": str(source)}, documents, saving, as_json=as_json)
