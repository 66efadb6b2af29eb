"""The format `xela-messages`: logs of XELA's server, each message a line of JSON as it was sent.

It is an importer, with the functions of `io/importers`; the live decoder reads the messages. Other
lines, such as the stamps of a terminal, are left out.
"""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt

from holdfast.devices.sources.xela.decoder import XelaDecoder
from holdfast.devices.sources.xela.packet import InvalidPacket, read_packet
from holdfast.errors import RecordingError, SourceError
from holdfast.io.importers import IF_IN_CONTACT
from holdfast.io.importers.table import natural_order
from holdfast.recordings import Recording, Tactile

LOG_SUFFIXES = (".jsonl", ".json", ".log", ".txt")
HINT = IF_IN_CONTACT
MAX_MESSAGE_LENGTH = 1 << 20
"""Longest line that is read [characters]; a whole hand sends 20,000."""
MAX_LINES_BEFORE = 100
"""Number of lines in which the first message must be."""


def can_read(path: Path) -> bool:
    """Return whether `path` is such a log, or a folder with one."""
    return any(_has_messages(file) for file in _files(path))


def parts(path: Path) -> list[Path]:
    """Return the file, or the logs of a folder.

    Raises:
        RecordingError: there is none.
    """
    if path.is_file():
        return [path]
    if not (files := [file for file in _files(path) if _has_messages(file)]):
        raise RecordingError(f"no log of XELA messages in {path}; lines of JSON as sent expected")
    return files


def read(path: Path) -> Iterator[Recording]:
    """Yield the recording in a log.

    Raises:
        RecordingError: it has no samples, or its sensors are unknown.
    """
    decoder = XelaDecoder()
    times: dict[str, list[float]] = {}
    readings: dict[str, list[npt.NDArray[np.generic]]] = {}
    n_lost = n_refused = 0
    for line in _messages(path):
        with suppress(InvalidPacket):  # a line that was cut does not end the log
            packet = read_packet(line)
            if packet is None:
                continue
            # The first message with samples defines the sensors, as for a connection.
            try:
                if not decoder.sensors and not decoder.identify(line):
                    continue
            except SourceError as cause:
                raise RecordingError(f"{path}: {cause}") from cause
            for arrival in decoder.decode(line, packet.time):
                n_lost, n_refused = n_lost + arrival.n_lost, n_refused + arrival.n_refused
                for name, sample in arrival.samples.items():
                    times.setdefault(name, []).append(arrival.time)
                    readings.setdefault(name, []).append(sample)
    if not times:
        state = "has no samples" if path.stat().st_size else "is empty"
        raise RecordingError(f"{path} {state}; messages of a XELA server expected")
    modules = {
        name: Tactile(decoder.sensors[name], np.array(times[name]), np.array(readings[name]))
        for name in times
    }
    counts = {"n_lost": n_lost, "n_refused": n_refused}
    # Zero is left out: metadata of a log without losses say nothing about them.
    counted = {name: count for name, count in counts.items() if count}
    yield Recording(path.stem, modules, {"source": path.name, **decoder.metadata, **counted})


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path] if path.suffix.lower() in LOG_SUFFIXES else []
    files = (
        file for file in path.glob("*") if file.suffix.lower() in LOG_SUFFIXES and file.is_file()
    )
    return sorted(files, key=natural_order)


def _has_messages(path: Path) -> bool:
    """Return whether one of the first lines is a message with samples."""
    with suppress(OSError, UnicodeError, RecordingError):
        for line, _ in zip(_messages(path), range(MAX_LINES_BEFORE), strict=False):
            with suppress(InvalidPacket, SourceError):
                return XelaDecoder().identify(line)
    return False


def _messages(path: Path) -> Iterator[str]:
    """Yield the lines that begin with a brace.

    Raises:
        RecordingError: a line is too long.
    """
    with path.open(encoding="utf-8-sig") as file:
        while line := file.readline(MAX_MESSAGE_LENGTH + 1):
            if len(line) > MAX_MESSAGE_LENGTH:
                raise RecordingError(
                    f"{path}: a line of more than {MAX_MESSAGE_LENGTH} characters given"
                )
            if line.startswith("{"):
                yield line
