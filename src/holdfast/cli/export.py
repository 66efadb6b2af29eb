"""`holdfast export`: recordings in the formats of other tools."""

from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.export_recordings import RecordingOptions, export_recordings
from holdfast.cli.options import ForceOption, JsonOption


def export(
    source: Annotated[Path, typer.Argument(help="A recording, or a folder of them.")],
    out: Annotated[Path, typer.Argument(help="Folder to write; a file for one CSV table.")],
    options: RecordingOptions,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Export recordings to other tools.

    Formats: lerobot, a LeRobot data set (v3.0), which `holdfast import` brings back without loss;
    foxglove, MCAP files with plots, states, a log and an arrow for each taxel, and a layout for
    them; csv, the generic CSV of docs/importing.md.

    Example:
      holdfast export grasps/ dataset/ --format lerobot
      holdfast export grasp.parquet view/ --format foxglove --model builtin:any
      holdfast export grasp.parquet grasp.csv --format csv
    """
    export_recordings(source, out, options, force=force, as_json=as_json)
