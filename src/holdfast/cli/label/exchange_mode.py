"""`holdfast label --export` and `--import`: exchange labels with other programs."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from holdfast.cli.label.auto_mode import label_all, print_labelled
from holdfast.cli.label.inputs import SaveOptions, login_name, recordings_at
from holdfast.cli.terminal.console import print_json, print_line
from holdfast.cli.terminal.progress import progress
from holdfast.errors import missing_part

if TYPE_CHECKING:
    from holdfast.recordings import Recording


def export_labels(
    paths: Sequence[Path], kind: str, out: Path, *, force: bool, as_json: bool
) -> None:
    """Write labels for another program, or as one CSV file per recording.

    Args:
        paths: recordings, or folders of recordings.
        kind: `csv`, or the format of a plug-in.
        out: folder for the files.
        force: overwrite existing files.
        as_json: print JSON.

    Raises:
        ValueError: an unknown format.
        HoldfastError: the plug-in of the format cannot be used, or is not installed.
        OutputError: a file exists or cannot be written.
        RecordingError: a recording cannot be read.
    """
    from holdfast.io import Dataset
    from holdfast.labelling.exchange.read_labels import LABEL_PLUGINS

    formats = (*LABEL_PLUGINS.names(), "csv")
    if kind not in formats:
        raise missing_part("labels", kind, f"the format {kind}") or ValueError(
            f"--export {' or '.join(formats)} expected, {kind!r} given"
        )
    recordings = Dataset(recordings_at(paths))
    if kind == "csv":
        written = _export_csv(recordings, out, force)
    else:
        save = LABEL_PLUGINS.require(kind, f"the format {kind}").save
        written = save(progress(recordings, "exporting"), out, force=force)
    if as_json:
        print_json({"format": kind, "written": [str(path) for path in written]})
    else:
        for path in written:
            print_line(str(path))


def _export_csv(recordings: "Sequence[Recording]", out: Path, force: bool) -> list[Path]:
    from holdfast.files import file_stem, refuse_overwrite, write_whole
    from holdfast.io import labels_to_csv

    out.mkdir(parents=True, exist_ok=True)
    written = []
    for recording in progress(recordings, "exporting"):
        target = out / f"{file_stem(recording.name)}.labels.csv"
        refuse_overwrite(target, force=force)
        labels = {name: module.labels for name, module in recording.modules.items()}
        write_whole(target, labels_to_csv(labels).encode(), force=force)
        written.append(target)
    return written


def import_labels(
    paths: Sequence[Path],
    source: Path,
    saving: SaveOptions,
    *,
    as_json: bool,
) -> None:
    """Import labels from an export of Label Studio, a CSV file or a folder.

    Args:
        paths: recordings, or folders of recordings.
        source: the file or folder.
        saving: how they are saved, and whose labels are read from Label Studio.
        as_json: print JSON.

    Raises:
        ValueError: one CSV file is given for several recordings.
        OutputError: a recording has labels of a person, or a file cannot be written.
        RecordingError: the labels cannot be read or do not fit.
    """
    from holdfast.errors import RecordingError
    from holdfast.labelling.exchange.read_labels import read_labels

    files = recordings_at(paths)
    if not source.exists():
        raise RecordingError(f"{source} does not exist; labels of Label Studio or CSV expected")
    if source.is_file() and source.suffix == ".csv" and len(files) > 1:
        raise ValueError(f"{source} has the labels of one recording; {len(files)} recordings given")
    documents = label_all(
        files,
        lambda recording: read_labels(source, recording, saving.annotator),
        saving,
        saving.author or saving.annotator or login_name(),
    )
    print_labelled(("source", str(source)), documents, saving, as_json=as_json)
