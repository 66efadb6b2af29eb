"""`holdfast label export`: labels for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.label.inputs import PathsArgument
from holdfast.cli.options import ForceOption, JsonOption
from holdfast.cli.terminal.console import print_json, print_lines
from holdfast.cli.terminal.progress import progress
from holdfast.errors import missing_part, require_extras


def export(
    kind: Annotated[str, typer.Argument(metavar="format", help="label-studio or csv.")],
    folder: Annotated[Path, typer.Argument(help="Folder for the files.")],
    paths: PathsArgument,
    *,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Export labels to Label Studio, or as CSV.

    Write a task of Label Studio for each recording, or a CSV file. See docs/labels.md.

    Example:
      holdfast label export label-studio studio/ recordings/
      holdfast label export csv labels/ recordings/ --json
    """
    require_extras("label")
    from holdfast.io import Dataset
    from holdfast.labelling.exchange.read_labels import LABEL_PLUGINS
    from holdfast.labelling.labelled_files import recordings_at, save_csv

    formats = (*LABEL_PLUGINS.names(), "csv")
    if kind not in formats:
        raise missing_part("labels", kind, f"the format {kind}") or ValueError(
            f"--export {' or '.join(formats)} expected, {kind!r} given"
        )
    recordings = Dataset(recordings_at(paths))
    if kind == "csv":
        folder.mkdir(parents=True, exist_ok=True)
        written = [save_csv(x, folder, force=force) for x in progress(recordings, "exporting")]
    else:
        save = LABEL_PLUGINS.require(kind, f"the format {kind}").save
        written = save(progress(recordings, "exporting"), folder, force=force)
    if as_json:
        print_json({"format": kind, "written": [str(path) for path in written]})
    else:
        print_lines(map(str, written))
