"""Set up the recording of a source: its file, its header, and when it is over."""

import math
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from holdfast.devices.sources import Arrival, Source
from holdfast.devices.uri import is_uri
from holdfast.errors import OutputError, SourceError
from holdfast.files import file_stem, refuse_overwrite
from holdfast.live.recorder import Recorder

READ_TIMEOUT = 0.1
"""Time to wait for the source before keys and signals are checked [s]."""
EXTRA_TIME = 1.0
"""Time after the wanted duration at which reading stops, also without samples [s]."""

_SUFFIX = ".mcap"


def arrivals_for(
    source: Source, seconds: float | None, speed: float = 1.0
) -> Iterator[Arrival | None]:
    """Yield arrivals until `seconds` are over; None if nothing arrives for a while.

    Args:
        source: an open source.
        seconds: duration by the clock of the source [s]; None for until the source ends.
        speed: of the source; 0 if it is not paced.
    """
    duration = math.inf if seconds is None else seconds
    end = time.monotonic() + (duration / speed + EXTRA_TIME if speed else math.inf)
    first = math.nan
    while not source.ended and time.monotonic() < end:
        arrival = source.read(READ_TIMEOUT)
        if arrival is not None and arrival.samples:
            first = arrival.time if math.isnan(first) else first
            # The source's own clock counts; the other one only if it falls silent.
            if arrival.time - first >= duration:
                return
        yield arrival


def recording_path(source: str, out: Path, object_name: str, *, force: bool) -> Path:
    """Return the file to write, and check that it can be written.

    In a folder, it is named as the source recording, or as the object or device with the time.

    Args:
        source: path or URI that is recorded.
        out: `NAME.mcap`, or a folder.
        object_name: name of the object; empty if it is not known.
        force: replace an existing file.

    Raises:
        ValueError: the suffix is another one, or the file is the source.
        OutputError: the file exists already, or its folder does not.
    """
    path = out
    if out.is_dir() or not out.suffix:
        name = file_stem(Path(source).stem)
        if is_uri(source):
            # The name of an object becomes part of the file name, which does not begin with a dot.
            what = re.sub(r"[^\w.-]+", "_", object_name or source.partition(":")[0]).strip("._")
            name = f"{file_stem(what or 'grasp')}-{time.strftime('%Y%m%d-%H%M%S')}"
        path = out / f"{name}{_SUFFIX}"
    elif out.suffix != _SUFFIX:
        raise ValueError(
            f"{out}: NAME{_SUFFIX} expected (holdfast import converts recordings to .parquet)"
        )
    if path.exists() and Path(source).exists() and path.samefile(source):
        raise ValueError(f"{path} is the source: choose another name")
    # A new folder is made later, by `create_recorder`: nothing is in it that could be replaced.
    if path == out or out.exists():
        refuse_overwrite(path, force=force)
    return path


def create_recorder(
    source: Source,
    path: Path,
    metadata: Mapping[str, Any],
    *,
    force: bool = False,
    fsync: bool = False,
) -> Recorder:
    """Create the file of an open source, its folder and its recorder.

    Args:
        source: whose modules and metadata are recorded.
        path: from `recording_path`.
        metadata: of the user; they outrank those of the source.
        force: replace an existing file.
        fsync: as in `Recorder`.

    Raises:
        OutputError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise OutputError(f"cannot write to {path.parent}: {cause.strerror}") from cause
    recorded_at = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    facts = {**source.metadata, "recorded_at": recorded_at, **metadata}
    return Recorder(path, source.sensors, metadata=facts, force=force, fsync=fsync)


@contextmanager
def recording(source: Source, recorder: Recorder) -> Iterator[None]:
    """Close the recorder at the end; remove a file without samples, which is of no use.

    Raises:
        OutputError: the file could not be written; the text names the part that was.
        SourceError: no samples arrived.
    """
    try:
        with recorder:
            yield
    except OutputError as failure:
        if not recorder.status.n_samples:
            recorder.path.unlink(missing_ok=True)
        kept = recorder.path.exists()
        hint = f"; see the recorded part with: holdfast info {recorder.path}" if kept else ""
        raise OutputError(f"{failure}{hint}") from failure
    if not recorder.status.n_samples:
        recorder.path.unlink(missing_ok=True)
        raise SourceError(f"{source.name} sent no samples: nothing was recorded")


def typed_metadata(object_name: str, case: str, settings: Sequence[str]) -> dict[str, Any]:
    """Return the metadata that a user typed; of `settings`, texts of numbers become numbers.

    Args:
        object_name: name of the object.
        case: of the experiment.
        settings: other metadata, each as `KEY=VALUE`.

    Raises:
        ValueError: a setting has another form, or its key is given twice.

    Example:
        >>> typed_metadata("can", "", ["mass=0.25", "by=Ann"])
        {'object': 'can', 'mass': 0.25, 'by': 'Ann'}
    """
    pairs: dict[str, Any] = {"object": object_name, "case": case}
    pairs = {key: text for key, text in pairs.items() if text}
    for pair in settings:
        key, equals, text = pair.partition("=")
        if not (key and equals):
            raise ValueError(f"--set KEY=VALUE expected, {pair!r} given")
        if key in pairs:
            raise ValueError(f"--set: {key} is given twice")
        # `re.ASCII`, because `\d` matches digits of other scripts as well; 15 digits are exact
        # in every program that reads the number as a float.
        if re.fullmatch(r"-?\d{1,15}", text, re.ASCII):
            pairs[key] = int(text)
        elif re.fullmatch(r"-?\d+\.\d+", text, re.ASCII):
            pairs[key] = float(text)
        else:
            pairs[key] = text
    return pairs
