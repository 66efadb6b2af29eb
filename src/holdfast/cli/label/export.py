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
    kind: Annotated[str, typer.Argument(metavar="format", help="csv.")],
    folder: Annotated[Path, typer.Argument(help="Folder for the files.")],
    paths: PathsArgument,
    *,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Export labels as CSV.

    Write a CSV file for each recording. See docs/labels.md.

    Example:
      holdfast label export csv labels/ recordings/ --json
    """
    require_extras("label")
    from holdfast.io import Dataset
    from holdfast.labelling.labelled_files import recordings_at, save_csv

    if kind != "csv":
        raise missing_part("labels", kind, f"the format {kind}") or ValueError(
            f"the format csv expected, {kind!r} given"
        )
    recordings = Dataset(recordings_at(paths))
    folder.mkdir(parents=True, exist_ok=True)
    written = [save_csv(x, folder, force=force) for x in progress(recordings, "exporting")]
    if as_json:
        print_json({"format": kind, "written": [str(path) for path in written]})
    else:
        print_lines(map(str, written))
