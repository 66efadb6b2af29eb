"""Recordings for Label Studio: tasks with their labels, signals as CSV, and the labelling config.

Three kinds of files: `label-studio.json` with a task for each recording, `label-studio.xml`
with the labelling config of the project, and `<name>.signals.csv` for each recording. Label
Studio has to be told where the CSV files are: either it serves the folder itself
(LOCAL_FILES_SERVING_ENABLED=true, LOCAL_FILES_DOCUMENT_ROOT the folder above), or `url` is
where something else does.
"""

import csv
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any
from urllib.parse import quote
from xml.sax.saxutils import quoteattr

import msgspec
import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.errors import OutputError, RecordingError
from holdfast.features import FEATURE_NAMES, fingertip_force, haar_features
from holdfast.files import refuse_overwrite, write_whole
from holdfast.labelling.exchange.label_studio import STATES, label_name, state_of
from holdfast.recordings import Label, Recording, Tactile
from holdfast.sensors.types import Array

TASKS, CONFIG, SIGNALS = "label-studio.json", "label-studio.xml", ".signals.csv"
SHOWN = ("F_a", "F_x", "F_y", "F_z", "sigma")
"""Signals of each finger."""
TARE = 0.5
"""How long the first part of a recording is that counts as no force [s]."""
COLOURS = {
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
    window: int = 14,
    force: bool = False,
) -> Path:
    """Writes recordings and their labels for Label Studio, one recording at a time.

    Args:
        recordings: with or without labels.
        folder: where the files go; it is made where it does not exist.
        url: of the folder, as Label Studio reaches it; by default by its local file serving.
        predictions: write the labels as predictions, which a person accepts or corrects, and
            not as annotations, which are done.
        window: N_w of sigma.
        force: replace files that are there.

    Returns:
        The path of the tasks.

    Raises:
        OutputError: a file exists already or cannot be written.
        RecordingError: two recordings have the same name, one's name cannot be a file's, or
            there is no recording.
    """
    target = Path(folder)
    _make(target)
    for name in (TASKS, CONFIG):
        refuse_overwrite(target / name, force=force)
    base = f"/data/local-files/?d={quote(target.resolve().name)}" if url is None else url
    tasks: dict[str, dict[str, Any]] = {}
    units: dict[str, str] = {}
    extra: set[str] = set()
    for recording in recordings:
        _check_name(recording.name, tasks)
        signals = recording.name + SIGNALS
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
    """The task of a recording, as plain JSON values.

    Args:
        recording: with or without labels.
        link: where Label Studio finds the signals.
        predictions: labels go there, and not among the annotations.
    """
    results = [
        _result(finger, number, label)
        for finger, module in recording.modules.items()
        for number, label in enumerate(module.labels)
    ]
    made: dict[str, Any] = {"model_version": "holdfast"} if predictions else {}
    labelled = [made | {"result": results}] if results else []
    return {
        "data": {"csv": link, "recording": recording.name, "digest": recording.digest},
        "annotations": [] if predictions else labelled,
        "predictions": labelled if predictions else [],
    }


def signals_csv(recording: Recording, window: int = 14) -> str:
    """Times [s] and, of each finger, F_a, F_x, F_y, F_z and sigma [unit of its readings].

    The mean of the first half second is taken off. Rows are the samples of the finger that
    has most; another shows its latest. A cell without a value is empty.

    Args:
        recording: whose signals are written.
        window: N_w of sigma.
    """
    longest = max(recording.modules.values(), key=lambda module: module.n_samples)
    columns = [
        column
        for module in recording.modules.values()
        for column in _held(module, longest.times, window).T
    ]
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", *_column_names(recording.modules)])
    cells = [list(map(repr, longest.times.tolist())), *(list(_cells(each)) for each in columns)]
    writer.writerows(zip(*cells, strict=True))
    return text.getvalue()


def labelling_config(units: Mapping[str, str], extra: Iterable[str] = ()) -> str:
    """The labelling config: for each finger its signals, and a group of labels called as it is.

    Args:
        units: of the readings of each finger.
        extra: names of labels beside the usual.
    """
    usual = [label_name(state) for state in STATES]
    usual += [label_name(ContactState.UNSTABLE, cause) for cause in Cause]
    names = list(dict.fromkeys([*usual, *sorted(extra)]))
    body = "\n".join(_finger_config(finger, unit, names) for finger, unit in units.items())
    return f"<View>\n{body}\n</View>\n"


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise OutputError(f"cannot write {folder}: {cause.strerror}") from cause


def _check_name(name: str, known: Collection[str]) -> None:
    if name in known:
        raise RecordingError(f"two recordings are called {name!r}; each needs its own name")
    if Path(name).name != name or "\\" in name:
        raise RecordingError(f"recording {name!r} cannot lend its name to a file")


def _result(finger: str, number: int, label: Label) -> dict[str, Any]:
    meta = {"evidence": label.evidence, "author": label.author}
    return {
        "id": f"{finger}-{number}",
        "type": "timeserieslabels",
        "from_name": finger,
        "to_name": _series(finger),
        "value": {
            "start": float(label.start),
            "end": float(label.end),
            "instant": False,
            "timeserieslabels": [label_name(label.state, label.cause)],
        },
        "score": float(label.confidence),
        "meta": {name: text for name, text in meta.items() if text},
    }


def _series(finger: str) -> str:
    return f"{finger}-signals"


def _column_names(fingers: Iterable[str]) -> list[str]:
    return [f"{finger}_{name}" for finger in fingers for name in SHOWN]


def _held(module: Tactile, times: Array, window: int) -> Array:
    """(n, 5) signals of a finger: at each time those of its latest sample."""
    shown = np.full((module.n_samples + 1, len(SHOWN)), np.nan)  # row 0: before the first
    if module.n_samples:
        first = float(module.times[0])
        try:
            tip = fingertip_force(
                module.readings, module.sensor, (first, first + TARE), module.times
            )
        except ValueError:  # no finite reading to take the baseline from
            tip = np.full((module.n_samples, 3), np.nan)
        places = [FEATURE_NAMES.index(name) for name in SHOWN]
        shown[1:, :4] = np.column_stack([np.linalg.norm(tip, axis=1), tip])
        shown[1:, 4] = haar_features(tip, window)[:, places[4]]
    held: Array = shown[np.searchsorted(module.times, times, side="right")]
    return held


def _cells(values: Array) -> Iterator[str]:
    return (f"{value:.7g}" if np.isfinite(value) else "" for value in values.tolist())


def _finger_config(finger: str, unit: str, names: Sequence[str]) -> str:
    labels = "\n".join(
        f"    <Label value={quoteattr(name)} background={quoteattr(_colour(name))}/>"
        for name in names
    )
    channels = "\n".join(
        f"    <Channel column={quoteattr(column)} legend={quoteattr(name)} "
        f"units={quoteattr(unit)}/>"
        for column, name in zip(_column_names([finger]), SHOWN, strict=True)
    )
    series = quoteattr(_series(finger))
    return (
        f"  <Header value={quoteattr(finger)}/>\n"
        f'  <TimeSeriesLabels name={quoteattr(finger)} toName={series} choice="single">\n'
        f"{labels}\n  </TimeSeriesLabels>\n"
        f'  <TimeSeries name={series} valueType="url" value="$csv" sep="," timeColumn="time">\n'
        f"{channels}\n  </TimeSeries>"
    )


def _colour(name: str) -> str:
    return COLOURS[state_of(name)[0]]
