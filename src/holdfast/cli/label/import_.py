"""`holdfast label import`: labels of other programs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.label.inputs import (
    AnnotatorOption,
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
    source: Annotated[
        Path, typer.Argument(help="JSON of Label Studio, a CSV file, or a folder of labels.")
    ],
    paths: PathsArgument,
    *,
    author: AuthorOption = None,
    saving: SaveOptions,
    annotator: AnnotatorOption = None,
    as_json: JsonOption = False,
) -> None:
    """Import labels from Label Studio, or CSV.

    The labels are written to NAME.labels.json beside each recording. Labels of a person are
    overwritten only with --force. See docs/labels.md.

    Example:
      holdfast label import export.json recordings/
      holdfast label import export.json recordings/ --annotator ann --json
    """
    require_extras("label")
    from holdfast.errors import RecordingError
    from holdfast.labelling.exchange.read_labels import read_labels
    from holdfast.labelling.labelled_files import recordings_at

    files = recordings_at(paths)
    if not source.exists():
        raise RecordingError(f"{source} does not exist; labels of Label Studio or CSV expected")
    # A CSV of labels names fingers, and no recording.
    if source.is_file() and source.suffix == ".csv" and len(files) > 1:
        raise ValueError(f"{source} has the labels of one recording; {len(files)} recordings given")

    def labels_of(recording: "Recording", _: Path) -> "ModuleLabels":
        return read_labels(source, recording, annotator)

    documents = label_all(files, labels_of, author or annotator or login_name(), saving)
    print_labelled({"source": str(source)}, documents, saving, as_json=as_json)
