"""`holdfast info`: the content of a recording, or of a folder of recordings."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.csv_options import refuse_foreign
from holdfast.cli.info.text import print_folder, print_model, print_recording
from holdfast.cli.options import JsonOption, PlotOptions, TareOption
from holdfast.cli.terminal.console import print_error, print_json
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from holdfast.detection import Tare


def info(
    path: Annotated[Path, typer.Argument(help="A recording, a folder of recordings, or a model.")],
    *,
    figure: PlotOptions,
    tare: TareOption = "0.5",
    model: Annotated[
        str | None,
        typer.Option(help="Model whose decisions about slips the figure shows, beside the truth."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Show the content of a recording, a folder of them, or a model.

    Print modules, sensors, number of samples, rates, gaps (steps in time of over three periods),
    repeats (samples equal to the one before), seconds of each label, number of samples with
    faults, metadata, and findings that matter for labels and training: constant readings, a start
    in contact, hidden labels (docs/command-line.md defines every word).

    The figure shows forces, sigma, labels, markers and slip (if the recording has truth) of each
    finger over time; with --model, the probability of a slip and where the finger is decided to
    slide, too. The tare is used for the figure and the faults; choose a time without contact.

    Of a model, print sensor, rate, features, threshold, contact and hold, the slip rule and how
    its threshold was chosen, and the recordings on which it was trained and tuned.

    Example:
      holdfast info real/
      holdfast info builtin:any
      holdfast info grasp.parquet --plot grasp.pdf
      holdfast info grasp.mcap --plot grasp.svg --tare first --json
      holdfast info grasp.mcap --plot slips.png --model model.json
    """
    from holdfast.detection import Tare

    is_model = str(path).startswith("builtin:") or (path.suffix == ".json" and path.is_file())
    # A folder may have the suffix .json, and a model has no samples to draw.
    kind = "model" if is_model else "folder" if path.is_dir() else "recording"
    if figure.plot is not None and kind != "recording":
        raise ValueError(f"--plot draws one recording; the {kind} {path} given")
    if model is not None and figure.plot is None:
        raise ValueError("--model is for the figure; --plot FILE expected beside it")
    if kind == "model":
        from holdfast.cli.info.model_facts import facts_of
        from holdfast.detection import Model

        facts = facts_of(Model.load(path))
        print_json(facts) if as_json else print_model(facts, path.name)
    elif kind == "folder":
        show_folder(path, Tare.parse(tare), as_json=as_json)
    else:
        refuse_foreign([path])
        show_recording(path, figure, Tare.parse(tare), model, as_json=as_json)


def show_recording(
    path: Path, figure: PlotOptions, tare: "Tare", model: str | None, *, as_json: bool
) -> None:
    """Print the content of a recording, and draw its figure if it is wanted."""
    from holdfast.detection import Model
    from holdfast.io import load_recording
    from holdfast.labelling.review.content import content_of

    def draw() -> "Figure":
        from holdfast.plots.recording import plot_recording

        loaded = None if model is None else Model.load(model)
        return plot_recording(recording or load_recording(path), tare, model=loaded)

    figure.check()
    # Only then is the whole needed; in parts, a recording may be larger than the memory.
    whole = figure.plot is not None or tare.kind == "interval"
    recording = load_recording(path) if whole else None
    content = content_of(path, tare, recording)
    figure.save(draw)
    print_json(content) if as_json else print_recording(content)


def show_folder(folder: Path, tare: "Tare", *, as_json: bool) -> None:
    """Print a line for each recording of a folder.

    Raises:
        RecordingError: one cannot be read; the others are printed before.
    """
    from holdfast.errors import RecordingError
    from holdfast.io import load_dataset
    from holdfast.labelling.review.content import content_of

    contents: list[dict[str, Any]] = []
    for path in progress(load_dataset(folder).paths, "reading"):
        try:
            contents.append(content_of(path, tare))
        except RecordingError as cause:
            contents.append({"name": path.stem, "error": str(cause)})
    print_json({"recordings": contents}) if as_json else print_folder(contents)
    failures = [content["error"] for content in contents if "error" in content]
    for failure in failures[:-1]:
        print_error(failure)
    if failures:
        # The others are shown all the same; this sets the exit code.
        raise RecordingError(failures[-1])
