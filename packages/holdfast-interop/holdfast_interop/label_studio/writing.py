"""Recordings for Label Studio: tasks with labels, signals as CSV, and the labelling config.

There are three kinds of files: `label-studio.json` with a task for each recording,
`label-studio.xml` with the labelling config of the project, and `<name>.signals.csv` for each
recording. Label Studio needs access to the CSV files: either it serves the folder itself
(LOCAL_FILES_SERVING_ENABLED=true, LOCAL_FILES_DOCUMENT_ROOT the folder above), or another server
does, at `url`.
"""

import csv
from collections.abc import Iterable, Mapping
from io import StringIO
from math import isfinite
from pathlib import Path
from typing import Any
from urllib.parse import quote
from xml.sax.saxutils import quoteattr

import msgspec
import numpy as np

from holdfast.contact import LABEL_STATES, Cause, ContactState
from holdfast.csv_cells import csv_text, text_cell
from holdfast.errors import OutputError, RecordingError
from holdfast.features import DEFAULT_WINDOW
from holdfast.files import file_stem, refuse_overwrite, write_whole
from holdfast.labelling.server.signals import SERIES, signal_values
from holdfast.recordings import Recording
from holdfast_interop.label_studio.reading import label_name, state_of

TASKS, CONFIG, SIGNALS = "label-studio.json", "label-studio.xml", ".signals.csv"
TARE_DURATION = 0.5
"""Duration of the tare at the start of a recording [s]."""
LABEL_COLOURS = {
    ContactState.STABLE: "#2a9d5c",
    ContactState.UNSTABLE: "#d1495b",
    ContactState.NO_CONTACT: "#8a8f98",
}


def save_label_studio(
    recordings: Iterable[Recording],
    folder: str | Path,
    *,
    url: str | None = None,
    predictions: bool = False,
    window: int = DEFAULT_WINDOW,
    force: bool = False,
) -> Path:
    """Write recordings and their labels for Label Studio, one recording at a time.

    Args:
        recordings: with or without labels.
        folder: for the files; it is created if it does not exist.
        url: of the folder, for Label Studio; by default its local file serving.
        predictions: write labels as predictions, which a person accepts or corrects, and not as
            annotations, which are final.
        window: N_w of sigma.
        force: replace existing files.

    Returns:
        The path of the tasks.

    Raises:
        OutputError: a file exists already or cannot be written.
        RecordingError: there is no recording, or two have the same name.
    """
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise OutputError(f"cannot write {target}: {cause.strerror}") from cause
    for name in (TASKS, CONFIG):
        refuse_overwrite(target / name, force=force)
    base = f"/data/local-files/?d={quote(target.resolve().name)}" if url is None else url
    tasks: dict[str, dict[str, Any]] = {}
    units: dict[str, str] = {}
    extra: set[str] = set()
    # One recording at a time, as a data set may be larger than the memory.
    for recording in recordings:
        # Names become files and tasks: one would replace the other.
        if recording.name in tasks:
            raise RecordingError(
                f"two recordings have the name {recording.name!r}; different names expected"
            )
        signals = file_stem(recording.name) + SIGNALS
        write_whole(target / signals, signals_csv(recording, window).encode(), force=force)
        link = f"{base.rstrip('/')}/{quote(signals)}"
        tasks[recording.name] = task_of(recording, link, predictions=predictions)
        units |= {name: str(module.unit) for name, module in recording.modules.items()}
        extra |= {
            label_name(x.state, x.cause) for m in recording.modules.values() for x in m.labels
        }
    if not tasks:
        raise RecordingError("no recordings given; at least one expected")
    write_whole(target / CONFIG, labelling_config(units, extra).encode(), force=force)
    document = msgspec.json.format(msgspec.json.encode(list(tasks.values()))) + b"\n"
    write_whole(target / TASKS, document, force=force)
    return target / TASKS


def task_of(recording: Recording, link: str, *, predictions: bool = False) -> dict[str, Any]:
    """Return the task of a recording, as plain JSON values.

    Args:
        recording: with or without labels.
        link: URL of the signals, for Label Studio.
        predictions: write labels as predictions, not as annotations.
    """
    results = []
    for finger, module in recording.modules.items():
        for number, label in enumerate(module.labels):
            meta = {"evidence": label.evidence, "author": label.author}
            value = {
                "start": float(label.start),
                "end": float(label.end),
                "instant": False,
                "timeserieslabels": [label_name(label.state, label.cause)],
            }
            results.append(
                {
                    "id": f"{finger}-{number}",
                    "type": "timeserieslabels",
                    "from_name": finger,
                    "to_name": f"{finger}-signals",
                    "value": value,
                    "score": float(label.confidence),
                    "meta": {name: text for name, text in meta.items() if text},
                }
            )
    version: dict[str, Any] = {"model_version": "holdfast"} if predictions else {}
    labelled = [version | {"result": results}] if results else []
    return {
        "data": {"csv": link, "recording": recording.name, "digest": recording.digest},
        "annotations": [] if predictions else labelled,
        "predictions": labelled if predictions else [],
    }


def signals_csv(recording: Recording, window: int = DEFAULT_WINDOW) -> str:
    """Return a CSV table: time [s] and, by finger, F_a, F_x, F_y, F_z, sigma [unit of readings].

    The tare is the mean of the first half second. Rows are the samples of the finger with most
    samples; other fingers have the values of their latest sample. Unknown values are empty cells.

    Args:
        recording: the recording.
        window: N_w of sigma.
    """
    longest = max(recording.modules.values(), key=lambda module: module.n_samples)
    cells = [list(map(repr, longest.times.tolist()))]
    for module in recording.modules.values():
        # Row 0 is before the first sample of the finger.
        values = np.full((module.n_samples + 1, len(SERIES)), np.nan)
        if module.n_samples:
            values[1:] = signal_values(module, TARE_DURATION, window)
        latest = values[np.searchsorted(module.times, longest.times, side="right")]
        cells += [
            [f"{value:.7g}" if isfinite(value) else "" for value in column]
            for column in latest.T.tolist()
        ]
    text = StringIO()
    names = [f"{finger}_{name}" for finger in recording.modules for name in SERIES]
    text.write(csv_text([["time", *names]]))
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows(zip(*cells, strict=True))
    return text.getvalue()


def labelling_config(units: Mapping[str, str], extra: Iterable[str] = ()) -> str:
    """Return the labelling config: for each finger its signals, and a group of labels of its name.

    Args:
        units: of the readings, by finger.
        extra: names of labels beside the usual ones.
    """
    usual = [label_name(state) for state in LABEL_STATES]
    usual += [label_name(ContactState.UNSTABLE, cause) for cause in Cause]
    names = list(dict.fromkeys([*usual, *sorted(extra)]))
    # A label has the colour of its state, whatever its cause.
    labels = "\n".join(
        f"    <Label value={quoteattr(name)} "
        f"background={quoteattr(LABEL_COLOURS[state_of(name)[0]])}/>"
        for name in names
    )
    parts = []
    for finger, unit in units.items():
        channels = "\n".join(
            f"    <Channel column={quoteattr(text_cell(f'{finger}_{name}'))} "
            f"legend={quoteattr(name)} units={quoteattr(unit)}/>"
            for name in SERIES
        )
        series = quoteattr(f"{finger}-signals")
        parts.append(
            f"  <Header value={quoteattr(finger)}/>\n"
            f'  <TimeSeriesLabels name={quoteattr(finger)} toName={series} choice="single">\n'
            f"{labels}\n  </TimeSeriesLabels>\n"
            f'  <TimeSeries name={series} valueType="url" value="$csv" sep="," timeColumn="time">\n'
            f"{channels}\n  </TimeSeries>"
        )
    body = "\n".join(parts)
    return f"<View>\n{body}\n</View>\n"
