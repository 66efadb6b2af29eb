"""`holdfast info`: the content of a recording, or of a folder of recordings."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import mean
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.model_info import is_model, print_model
from holdfast.cli.options import (
    JsonOption,
    PlotOptions,
    TareOption,
)
from holdfast.cli.terminal.console import (
    print_error,
    print_json,
    print_line,
    print_lines,
    print_paragraph,
    print_table,
)
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from holdfast.contact import Fault
    from holdfast.detector import Detector
    from holdfast.features import Tare
    from holdfast.labelling.review.scan import ModuleScan
    from holdfast.recordings import Label, Recording

MAX_VALUE_LENGTH = 90
"""Maximum number of characters of a metadata value in the table."""
SAMPLES_OF_PART = 4096
"""Samples that are read at a time; it bounds the memory."""


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
    from holdfast.features import Tare

    kind = "model" if is_model(path) else "folder" if path.is_dir() else "recording"
    if figure.plot is not None and kind != "recording":
        raise ValueError(f"--plot draws one recording; the {kind} {path} given")
    if model is not None and figure.plot is None:
        raise ValueError("--model is for the figure; --plot FILE expected beside it")
    if kind == "model":
        print_model(path, as_json)
    elif kind == "folder":
        _print_folder(path, Tare.parse(tare), as_json)
    else:
        _print_file(path, figure, Tare.parse(tare), model, as_json)


def _print_file(
    path: Path, figure: PlotOptions, tare: "Tare", model: str | None, as_json: bool
) -> None:
    from holdfast.io import load_recording
    from holdfast.model import Model

    def draw() -> "Figure":
        from holdfast.plots.recording import plot_recording

        loaded = None if model is None else Model.load(model)
        return plot_recording(recording or load_recording(path), tare, model=loaded)

    figure.check()
    whole = figure.plot is not None or tare.kind == "interval"
    recording = load_recording(path) if whole else None
    document = _document(recording, tare, path)
    figure.save(draw)
    if as_json:
        print_json(document)
    else:
        _print_one(document)


def _print_folder(folder: Path, tare: "Tare", as_json: bool) -> None:
    from holdfast.errors import RecordingError
    from holdfast.io import load_dataset

    paths = load_dataset(folder).paths
    documents: list[dict[str, Any]] = []
    for path in progress(paths, "reading"):
        try:
            documents.append(_document(None, tare, path))
        except RecordingError as cause:
            documents.append({"name": path.stem, "error": str(cause)})
    if as_json:
        print_json({"recordings": documents})
    else:
        _print_all(documents)
    failures = [document["error"] for document in documents if "error" in document]
    for failure in failures[:-1]:
        print_error(failure)
    if failures:
        raise RecordingError(failures[-1])


def _document(recording: "Recording | None", tare: "Tare", path: Path) -> dict[str, Any]:
    """Return the content of the recording; None if it is read from its path, in parts."""
    from holdfast.io import read_chunks
    from holdfast.labelling.review.findings import findings_of_scan, hidden_labels
    from holdfast.labelling.review.scan import RecordingScan

    scan, faults = RecordingScan(), _Faults(tare)
    for part in [recording] if recording else read_chunks(path, SAMPLES_OF_PART):
        scan.add(part)
        faults.add(part)
        truth = part.truth
    found, hidden = scan.recording, hidden_labels(path)
    findings = findings_of_scan(scan) + ([] if hidden is None else [hidden])
    return {
        "name": found.name,
        "modules": {
            name: _module(module, faults.counts.get(name, {}))
            for name, module in scan.modules.items()
        },
        "start": found.start,
        "duration": found.duration,
        "complete": found.complete,
        "metadata": found.metadata,
        "markers": [{"time": time, "text": text} for time, text in found.markers],
        "media": [{"path": path, "offset": offset} for path, offset in found.media],
        "truth": truth
        and {
            "n_samples": scan.n_truth,
            "hand": list(truth.hand),
            "fingers": {finger: list(arrays) for finger, arrays in truth.fingers.items()},
        },
        "digest": recording.digest if recording else _digest(path),
        "findings": [finding._asdict() for finding in findings],
    }


def _digest(path: Path) -> str | None:
    """Return the digest of a recording; None if its file has none and it is too large to load."""
    from holdfast.errors import RecordingError
    from holdfast.labelling.server.workspace import summary_of

    try:
        return summary_of(path).digest
    except RecordingError:  # its parts were read without an error
        return None


def _module(module: "ModuleScan", faults: Mapping["Fault", int]) -> dict[str, Any]:
    force = module.force
    return {
        "sensor": module.sensor.name,
        "n_taxels": module.sensor.n_taxels,
        "unit": module.sensor.unit,
        "n_samples": force.n_samples,
        "rate": force.rate,
        "gaps": force.n_gaps,
        "repeats": int(module.repeats.sum()),
        "labels": label_seconds(module.labels),
        "faults": {fault.value: n for fault, n in faults.items() if n},
    }


class _Faults:
    """Number of samples of each module with each fault that a detector finds."""

    def __init__(self, tare: "Tare") -> None:
        import msgspec

        from holdfast.model import Model

        self.counts: dict[str, dict[Fault, int]] = {}
        self._model = msgspec.structs.replace(Model.load("builtin:noise-floor"), tare=str(tare))
        self._detectors: dict[str, Detector] = {}

    def add(self, part: "Recording") -> None:
        """Add a recording, or its next part."""
        from holdfast.contact import Fault
        from holdfast.detector import Detector

        for name, module in part.modules.items():
            if not module.n_samples:
                continue
            alone = replace(part, modules={name: module}, truth=None)
            if name not in self._detectors:
                self._detectors[name] = Detector.for_recording(self._model, alone)
                self.counts[name] = dict.fromkeys(Fault, 0)
            masks = self._detectors[name].run(alone).fingers[name].faults
            for bit, fault in enumerate(Fault):
                self.counts[name][fault] += int((masks >> bit & 1).sum())


def label_seconds(labels: "Iterable[Label]") -> dict[str, float]:
    """Return the total duration of the labels of each state [s]."""
    seconds = dict.fromkeys(_label_states(), 0.0)
    for label in labels:
        seconds[label.state.value.lower()] += label.end - label.start
    return seconds


def _label_states() -> list[str]:
    from holdfast.contact import LABEL_STATES

    return [state.value.lower() for state in LABEL_STATES]


def _print_one(document: Mapping[str, Any]) -> None:
    complete = "yes" if document["complete"] else "no: the end of the file is cut off"
    rows = [
        ("duration", f"{document['duration']:.3f} s from {document['start']:.3f} s"),
        ("complete", complete),
        ("digest", document["digest"] or "not known: loading the recording takes too much memory"),
        *((key, _shorten(value)) for key, value in document["metadata"].items()),
        *((f"media at {x['offset']:g} s", x["path"]) for x in document["media"]),
    ]
    if document["truth"]:
        rows.append(("truth", _shorten(", ".join(_channels(document["truth"])))))
    print_table(("recording", document["name"]), rows)
    print_line()
    _print_modules(document["modules"])
    _print_findings(document["findings"])
    if document["markers"]:
        from holdfast.recordings import shown_origin

        origin = shown_origin(document["start"])
        print_line()
        if origin:
            print_line("markers since the first sample")
        print_table(
            ("marker [s]", "text"),
            [(f"{m['time'] - origin:.3f}", m["text"]) for m in document["markers"]],
        )


def _print_findings(findings: list[Mapping[str, str]]) -> None:
    """Print one paragraph for each finding."""
    if findings:
        print_lines(("", "findings:"))
    for finding in findings:
        text = f"{finding['module']}: {finding['text']}" if finding["module"] else finding["text"]
        print_paragraph(text, "- ", "  ")


def _channels(truth: Mapping[str, Any]) -> list[str]:
    fingers = truth["fingers"].items()
    return [*truth["hand"], *(f"{finger}.{name}" for finger, names in fingers for name in names)]


def _print_modules(modules: Mapping[str, Mapping[str, Any]]) -> None:
    """Print two tables: the samples of each module, then its labels and faults."""
    print_table(
        ("module", "sensor", "taxels", "unit", "samples", "rate [Hz]", "gaps", "repeats"),
        [
            (name, m["sensor"], m["n_taxels"], m["unit"], m["n_samples"], f"{m['rate']:.1f}",
             m["gaps"], m["repeats"])
            for name, m in modules.items()
        ],
    )  # fmt: skip
    print_line()
    print_table(
        ("module", *_label_headings(), "faults"),
        [
            (
                name,
                *_label_cells([m]),
                ", ".join(f"{x} {n}" for x, n in m["faults"].items()) or "none",
            )
            for name, m in modules.items()
        ],
    )


def _label_headings() -> list[str]:
    return [f"{state} [s]" for state in _label_states()]


def _label_cells(modules: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the duration of the labels of each state, the mean over the modules."""
    return [f"{mean(m['labels'][state] for m in modules):.2f}" for state in _label_states()]


def _print_all(documents: list[dict[str, Any]]) -> None:
    """Print two tables: the labels of each recording, then its samples and findings."""
    readable = [document for document in documents if "error" not in document]
    if readable:
        print_table(
            ("labels of", *_label_headings()),
            [(x["name"], *_label_cells([*x["modules"].values()])) for x in readable],
        )
        print_line()
    print_table(
        ("recording", "modules", "samples", "rate [Hz]", "duration [s]", "gaps", "state"),
        [_summary(document) for document in documents],
    )


def _summary(document: Mapping[str, Any]) -> tuple[object, ...]:
    """Return a row of the table of recordings."""
    if "error" in document:
        return (document["name"], *5 * ("-",), "unreadable")
    modules = list(document["modules"].values())
    rates = sorted(m["rate"] for m in modules if m["n_samples"])
    faults = sorted({fault for m in modules for fault in m["faults"]})
    findings = dict.fromkeys(finding["kind"] for finding in document["findings"])
    return (
        document["name"],
        len(modules),
        sum(m["n_samples"] for m in modules),
        f"{rates[len(rates) // 2]:.1f}",
        f"{document['duration']:.2f}",
        sum(m["gaps"] for m in modules),
        ", ".join(([] if document["complete"] else ["cut off"]) + [*faults, *findings]) or "ok",
    )


def _shorten(value: object) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else " ".join(str(value).split())
    return text if len(text) <= MAX_VALUE_LENGTH else f"{text[: MAX_VALUE_LENGTH - 3]}..."
