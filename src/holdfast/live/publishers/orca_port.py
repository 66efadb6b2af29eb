"""Send the samples of a source at a pseudo-terminal, as an ORCA Touch hand does."""

import os
import select
from collections.abc import Sequence
from threading import Event, Thread
from typing import Self

import numpy as np

from holdfast.devices.sources import Source
from holdfast.devices.sources.orca.frames import FINGER_PLACES, OrcaHand
from holdfast.devices.sources.xela.encoder import SampleBatcher
from holdfast.errors import SourceError

POLL_INTERVAL = 0.02
"""Maximum time to wait for the source, or for the host, before the other is served [s]."""
MAX_REQUESTS = 4096
"""Bytes of requests to read at a time."""


class OrcaPort:
    """ORCA Touch hand at a pseudo-terminal that sends the samples of a source, in a thread.

    The source is read while a host has the stream requested and the port open. A frame has the
    newest readings of all fingers.

    Args:
        source: an open source; the caller closes it.
        restart: begin the next recording of the source for each host.

    Attributes:
        port: path of the port.
        modules: name of each finger, by the number of its slot from 1.
        n_packets: number of frames sent.
        failure: the exception that ended it; None if there was none.

    Raises:
        ValueError: the hand cannot have the modules of the source.
        SourceError: this system has no pseudo-terminals.
    """

    def __init__(self, source: Source, *, restart: bool = False) -> None:
        for name, sensor in source.sensors.items():
            if name not in FINGER_PLACES or sensor.unit != "N":
                raise ValueError(
                    f"an ORCA Touch hand has {', '.join(FINGER_PLACES)} in N; the source has "
                    f"{name} in {sensor.unit} (twin:?sensor=orca-finger fits)"
                )
        if not hasattr(os, "openpty"):
            raise SourceError("this system has no pseudo-terminals; Linux or macOS expected")
        self._hand = OrcaHand({name: one.n_taxels for name, one in source.sensors.items()})
        self._at_rest = {name: np.zeros((n, 3)) for name, n in self._hand.fingers.items()}
        self._batcher = SampleBatcher(source.sensors, own_stamps=False)
        self.modules: dict[int, Sequence[str]] = {
            list(FINGER_PLACES).index(name) + 1: (name,) for name in self._hand.fingers
        }
        self._source, self._restarts = source, restart
        self._was_streaming = False
        self.n_packets = 0
        self.failure: Exception | None = None
        self._stopping, self._ended = Event(), Event()
        self._thread = Thread(target=self._run, name="holdfast-orca", daemon=True)

    @property
    def n_clients(self) -> int:
        """Number of hosts that get frames, 0 or 1."""
        return int(self._hand.is_streaming)

    @property
    def uri(self) -> str:
        """URI for `open_source`."""
        return f"orca://{self.port}"

    def wait(self, timeout: float) -> bool:
        """Wait at most `timeout` [s] for the end. Return whether it has ended."""
        return self._ended.wait(timeout)

    def __enter__(self) -> Self:
        self._line, host = os.openpty()
        self.port = os.ttyname(host)
        # Closed here: then reading fails while no host has the port open.
        os.close(host)
        os.set_blocking(self._line, False)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join()
        os.close(self._line)

    def _run(self) -> None:
        try:
            while not self._stopping.is_set() and not self._source.ended:
                self._serve()
                if not self._hand.is_streaming:
                    self._stopping.wait(POLL_INTERVAL)
                    continue
                arrival = self._source.read(POLL_INTERVAL)
                if arrival is not None and arrival.samples:
                    for batch in self._batcher.add(arrival.samples, arrival.time):
                        self._send(self._hand.frame({**self._at_rest, **batch.samples}))
                        self.n_packets += 1
        except Exception as failure:  # the caller reads it
            self.failure = failure
        finally:
            self._ended.set()

    def _serve(self) -> None:
        """Answer the requests of the host."""
        try:
            requests = os.read(self._line, MAX_REQUESTS)
        except BlockingIOError:
            return
        except OSError:  # no host has the port open
            self._hand.is_streaming = False
        else:
            self._send(self._hand.feed(requests))
        if self._hand.is_streaming and not self._was_streaming and self._restarts:
            self._source.restart()
        self._was_streaming = self._hand.is_streaming

    def _send(self, data: bytes) -> None:
        """Send all bytes, unless the host closes the port; a slow host delays the source."""
        while data and not self._stopping.is_set():
            try:
                data = data[os.write(self._line, data) :]
            except BlockingIOError:
                select.select([], [self._line], [], POLL_INTERVAL)
            except OSError:
                return
