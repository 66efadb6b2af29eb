"""Send the samples of a source at a pseudo-terminal, as an ORCA Touch hand does."""

import os
import select
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Self

import numpy as np

from holdfast.devices.sources import Source
from holdfast.devices.sources.orca_frames import FINGER_PLACES, OrcaHand
from holdfast.devices.sources.xela.encoder import SampleBatcher
from holdfast.errors import SourceError

POLL_INTERVAL = 0.02
"""Maximum time to wait for the source, or for the host, before the other is served [s]."""
MAX_REQUESTS = 4096
"""Bytes of requests to read at a time."""


class OrcaPort:
    """ORCA Touch hand at a pseudo-terminal that sends the samples of a source, during `wait`.

    The source is read while a host has the port open and the stream requested.

    Args:
        source: an open source; the caller closes it.
        restart: begin the next recording of the source for each host.

    Attributes:
        port: path of the port.
        uri: URI for `open_source`.
        modules: name of each finger, by the number of its slot from 1.
        n_clients: number of hosts that get frames, 0 or 1.
        n_packets: number of frames sent.

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
        self._hand = OrcaHand({name: skin.n_taxels for name, skin in source.sensors.items()})
        self._at_rest = {name: np.zeros((n, 3)) for name, n in self._hand.fingers.items()}
        self._batcher = SampleBatcher(source.sensors, own_stamps=False)
        self.modules: dict[int, Sequence[str]] = {
            slot: (name,) for slot, name in enumerate(FINGER_PLACES, 1) if name in self._at_rest
        }
        self._source, self._restarts = source, restart
        self.n_clients = self.n_packets = 0

    def __enter__(self) -> Self:
        self._line, host = os.openpty()
        self.port = os.ttyname(host)
        self.uri = f"orca://{self.port}"
        # Closed here: then reading fails while no host has the port open.
        os.close(host)
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._line)

    def wait(self, timeout: float) -> bool:
        """Serve the host for `timeout` [s]. Return whether the source has ended."""
        end = time.monotonic() + timeout
        while time.monotonic() < end and not self._source.ended:
            self._serve()
            if not self._hand.is_streaming:
                time.sleep(POLL_INTERVAL)
            elif (arrival := self._source.read(POLL_INTERVAL)) is not None and arrival.samples:
                for batch in self._batcher.add(arrival.samples, arrival.time):
                    self._send(self._hand.frame({**self._at_rest, **batch.samples}))
                    self.n_packets += 1
        return self._source.ended

    def _serve(self) -> None:
        """Answer the requests of the host."""
        if select.select([self._line], [], [], 0.0)[0]:
            try:
                self._send(self._hand.feed(os.read(self._line, MAX_REQUESTS)))
            except OSError:  # no host has the port open
                self._hand.is_streaming = False
        if self._hand.is_streaming > self.n_clients and self._restarts:
            self._source.restart()
        self.n_clients = int(self._hand.is_streaming)

    def _send(self, data: bytes) -> None:
        """Send bytes; a slow host delays the source, and one that closes the port gets none."""
        with suppress(OSError):
            os.write(self._line, data)
