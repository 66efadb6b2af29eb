"""Recordings as MCAP while they are made: what has been written stays, whatever happens."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.io.header import Header, ModuleData, number_of
from holdfast.io.message_log import MARKERS_TOPIC, MessageLog
from holdfast.io.spans import spans
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Unit

MESSAGE_SECONDS = 0.1

_NEVER = -np.inf


class RecordingWriter:
    """Writes a recording while it is made; a kill loses at most half a second.

    Samples go to disk in messages of at most 0.1 s and chunks of at most 0.3 s of the
    stream's own time: the writer has no clock, so that `flush` is for streams that may fall
    silent. It is a context manager and is to be used by one thread.

    Args:
        path: of the MCAP file.
        sensors: by module.
        name: of the recording; that of the file where it is not given.
        units: by module, where readings are calibrated.
        metadata: as in `Recording`.
        media: as in `Recording`.
        force: replace what is at `path`.

    Raises:
        OutputError: the file exists already or cannot be written.
        RecordingError: the metadata are no plain JSON values.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> from holdfast.io import load_recording
        >>> from holdfast.sensors import sensor
        >>> with TemporaryDirectory() as folder:
        ...     with RecordingWriter(f"{folder}/a.mcap", {"thumb": sensor("anyskin")}) as writer:
        ...         writer.append("thumb", [0.0, 0.01], np.zeros((2, 5, 3)))
        ...         writer.mark(0.01, "grasped")
        ...     load_recording(f"{folder}/a.mcap").markers
        ((0.01, 'grasped'),)
    """

    def __init__(
        self,
        path: str | Path,
        sensors: Mapping[str, Sensor],
        *,
        name: str | None = None,
        units: Mapping[str, Unit] | None = None,
        metadata: Mapping[str, Any] | None = None,
        media: Sequence[tuple[str, float]] = (),
        force: bool = False,
    ) -> None:
        target = Path(path)
        given = units or {}
        header = Header(
            name=name or target.stem,
            file=target.stem,
            modules={
                module: ModuleData(sensor.to_dict(), given.get(module, sensor.unit))
                for module, sensor in sensors.items()
            },
            metadata=dict(metadata or {}),
            media=list(media),
        )
        self._sensors = dict(sensors)
        self._pending: dict[str, list[tuple[Array, npt.NDArray[Any]]]] = {m: [] for m in sensors}
        self._numbers: dict[str, str] = {}
        self._last = dict.fromkeys(sensors, _NEVER)
        self._newest = _NEVER
        self._log = MessageLog(target, header, force=force)

    def append(self, module: str, times: npt.ArrayLike, readings: npt.ArrayLike) -> None:
        """Takes the next samples of a module.

        Args:
            module: whose they are.
            times: (n,) later than those before [s].
            readings: (n, n_taxels, 3), of the same number type each time.

        Raises:
            RecordingError: unknown module, wrong shape or number type, times that do not
                increase.
            OutputError: the disk refuses.
        """
        when = np.array(times, dtype=np.float64)
        values = np.array(readings)
        self._check(module, when, values)
        if len(when) == 0:
            return
        self._pending[module].append((when, values))
        self._last[module] = float(when[-1])
        self._newest = max(self._newest, self._last[module])
        for name, parts in self._pending.items():
            if parts and parts[0][0][0] <= self._newest - MESSAGE_SECONDS:
                self._write(name, before=self._newest - MESSAGE_SECONDS)

    def mark(self, time: float, text: str, *, at_once: bool = True) -> None:
        """Writes a marker.

        Args:
            time: on the clock of the samples [s].
            text: what happened.
            at_once: False leaves it to the next `flush`, or to the samples that follow.

        Raises:
            OutputError: the disk refuses.
        """
        self._log.text(MARKERS_TOPIC, time, text)
        if at_once:
            self._log.flush()

    def flush(self) -> None:
        """Writes all that was given so far: a kill from now on does not lose it.

        Raises:
            OutputError: the disk refuses.
        """
        self._write_all()
        self._log.flush()

    @property
    def n_bytes(self) -> int:
        """How long the file is."""
        return self._log.n_bytes

    def close(self) -> None:
        """Writes what is left and the end of the file; again, it does nothing.

        Raises:
            OutputError: the disk refuses.
        """
        try:
            if not self._log.closed:
                self._write_all()
        finally:
            self._log.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _check(self, module: str, times: Array, values: npt.NDArray[Any]) -> None:
        if module not in self._sensors:
            raise RecordingError(
                f"samples of {module!r} given; this recording has {', '.join(self._sensors)}"
            )
        n_taxels = self._sensors[module].n_taxels
        if times.ndim != 1 or values.shape != (len(times), n_taxels, 3):
            raise RecordingError(
                f"{module}: times (n,) and readings (n, {n_taxels}, 3) expected, "
                f"{times.shape} and {values.shape} given"
            )
        number = number_of(values, f"readings of {module}")
        if self._numbers.setdefault(module, number) != number:
            raise RecordingError(f"{module}: {self._numbers[module]} expected, {number} given")
        steps = np.diff(times, prepend=self._last[module])
        if not (np.isfinite(times).all() and (steps > 0).all()):
            raise RecordingError(f"{module}: finite, strictly increasing times expected")

    def _write_all(self) -> None:
        for name, parts in self._pending.items():
            if parts:
                self._write(name, before=np.inf)

    def _write(self, module: str, before: float) -> None:
        """Writes the spans that begin no later than `before`; the rest stays pending."""
        parts = self._pending[module]
        times = np.concatenate([part[0] for part in parts])
        values = np.concatenate([part[1] for part in parts])
        left = len(times)
        for span in spans({module: times}, MESSAGE_SECONDS):
            cut = span[module]
            if times[cut.start] > before:
                left = cut.start
                break
            self._log.samples(f"/tactile/{module}", times[cut], values[cut])
        self._pending[module] = [(times[left:], values[left:])] if left < len(times) else []
