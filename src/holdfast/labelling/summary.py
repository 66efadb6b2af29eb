"""What is known of a recording at a glance, without reading all of its samples."""

from dataclasses import dataclass
from pathlib import Path

from holdfast.errors import RecordingError
from holdfast.io import load_recording, mcap, parquet
from holdfast.io.header import Header
from holdfast.recordings import Recording


@dataclass(frozen=True)
class Summary:
    """A recording at a glance.

    Attributes:
        name: of the recording.
        duration: about how long it is [s].
        fingers: its modules.
        digest: of its samples.
        n_inside: how many labels it has inside.
    """

    name: str
    duration: float
    fingers: tuple[str, ...]
    digest: str
    n_inside: int


def summary_of(path: Path) -> Summary:
    """What the header of a recording says; it is read whole where the header does not know.

    Raises:
        RecordingError: it cannot be read.
    """
    try:
        header, complete = _header(path)
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror or cause}") from cause
    if header is None or not (complete and header.digest):
        return _whole(load_recording(path, labels=False))
    return Summary(
        header.name if path.stem == header.file else path.stem,
        max(_duration(header), default=0.0),
        tuple(header.modules),
        header.digest,
        sum(len(module.labels) for module in header.modules.values()),
    )


def _header(path: Path) -> tuple[Header | None, bool]:
    if path.suffix not in (".parquet", ".mcap"):
        return None, False
    source = parquet if path.suffix == ".parquet" else mcap
    header, samples, complete = source.chunks(path)
    getattr(samples, "close", lambda: None)()
    return header, complete


def _duration(header: Header) -> list[float]:
    """About how long each module says something [s]."""
    return [
        max((module.n_samples or 0) - 1, 0) / float(module.sensor["rate"])
        for module in header.modules.values()
    ]


def _whole(recording: Recording) -> Summary:
    modules = recording.modules
    return Summary(
        recording.name,
        recording.duration,
        tuple(modules),
        recording.digest,
        sum(len(module.labels) for module in modules.values()),
    )
