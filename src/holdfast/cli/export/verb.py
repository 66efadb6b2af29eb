"""`holdfast export`: a model for programs without Python, or recordings for other tools."""

from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.export.models import HeaderOptions, export_model
from holdfast.cli.export.recordings import RecordingOptions, export_recordings
from holdfast.cli.extensions import ExporterOptions
from holdfast.cli.options import ForceOption, JsonOption


def export(
    source: Annotated[
        str, typer.Argument(help="A model file or builtin:NAME; or a recording, or a folder.")
    ],
    out: Annotated[Path, typer.Argument(help="model.h; or a folder (a file for a CSV table).")],
    header: HeaderOptions,
    recordings: RecordingOptions,
    formats: ExporterOptions,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Export a model as C, or recordings to other tools.

    A C99 header is the whole detector: tare, features, faults and decisions, with all memory in
    one struct. It allocates nothing, and gives what holdfast detect gives at every sample. A
    program calls holdfast_init once, and holdfast_update for every sample. A model for any finger
    needs the fingers of the hand, from a recording or from --sensor and --fingers.

    Recordings need --format: lerobot is a LeRobot data set (v3.0), which holdfast import brings
    back without loss; rerun is files for Rerun with plots, states, a log and an arrow for each
    taxel; csv is the generic CSV of docs/importing.md.

    Example:
      holdfast export builtin:twin model.h --like grasp.parquet
      holdfast export builtin:any model.h --sensor uskin-curved --fingers 4
      holdfast export grasps/ dataset/ --format lerobot
      holdfast export grasp.parquet view/ --format rerun --model builtin:any
      holdfast export grasp.parquet grasp.csv --format csv
    """
    # The suffix of `out` decides as well: a wrong model is then refused as a model.
    is_named_so = source.startswith("builtin:") or source.endswith(".json")
    if is_named_so or out.suffix == ".h":
        if recordings != RecordingOptions() or formats.chosen():
            raise ValueError(f"--format, --fps and --model are for recordings; {source} is a model")
        export_model(source, out, header, force=force, as_json=as_json)
        return
    if header != HeaderOptions():
        raise ValueError(
            "--like, --sensor, --fingers, --float and --in-contact are for models; "
            f"{source} is a recording or a folder"
        )
    export_recordings(Path(source), out, recordings.format, formats, force=force, as_json=as_json)
