"""A stand-in for XELA's server: what a source gives, sent to whoever connects."""

import asyncio
import logging
import time
from collections.abc import Iterator
from contextlib import suppress
from threading import Event, Thread
from typing import Self

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed

from holdfast.errors import OutputError
from holdfast.sources import Source
from holdfast.sources.xela.encoder import (
    NEW_VERSION,
    SampleBatch,
    SampleBatcher,
    XelaEncoder,
)

HOST, PORT = "127.0.0.1", 5000
PATIENCE = 0.2
"""How long the source is waited for before it is looked whether to stop [s]."""
BACKLOG = 32 * 2**20
"""A client that is so many bytes behind is dropped; nobody waits for it."""
CLOSING = 1.0
"""How long clients have to say goodbye [s]."""
FAREWELL = 10.0
"""How long, at the end of a recording, clients have to take what they have not read yet [s]."""

_QUIET = logging.getLogger("holdfast.live.xela_server")
_QUIET.addHandler(logging.NullHandler())


class XelaServer:
    """Acts as a XELA server for a source, in threads of its own.

    Stamps are the times of the source, shifted by one constant that makes the first one now. A
    packet is sent when the source gives it. A client that does not read holds up nobody.

    Args:
        source: that is open; whoever opened it closes it.
        version: of the server, 1.7 or 1.8.
        host: address to listen at.
        port: 0 for any that is free.
        whole_hand: send fingertips as part of a whole hand.
        wait: begin when the first client is there.

    Attributes:
        encoder: that makes the packets.
        n_packets: that were sent.
        failure: why it ended, where it failed.

    Raises:
        ValueError: the source cannot be sent so.

    Example:
        >>> with XelaServer(source, port=0) as server:  # doctest: +SKIP
        ...     print(server.uri)
    """

    def __init__(
        self,
        source: Source,
        *,
        version: str = NEW_VERSION,
        host: str = HOST,
        port: int = PORT,
        whole_hand: bool = False,
        wait: bool = False,
    ) -> None:
        self.encoder = XelaEncoder(source.sensors, version=version, whole_hand=whole_hand)
        self._batcher = SampleBatcher(source.sensors, own_stamps=self.encoder.has_own_stamps)
        self._source = source
        self._address = host, port
        self.n_packets = 0
        self.failure: Exception | None = None
        self._refusal: Exception | None = None
        self._clients: set[ServerConnection] = set()
        self._began = Event()
        self._stopping = Event()
        self._over = Event()
        self._someone = Event()
        if not wait:
            self._someone.set()
        self._shift: float | None = None
        self._serving = Thread(target=self._serve, name="holdfast-play", daemon=True)
        self._feeding = Thread(target=self._feed, name="holdfast-play-source", daemon=True)

    @property
    def n_clients(self) -> int:
        """How many are connected."""
        return len(self._clients)

    @property
    def ended(self) -> bool:
        """Whether the source is over, or sending it failed."""
        return self._over.is_set()

    @property
    def uri(self) -> str:
        """By which `open_source` finds it, with the names of the modules."""
        host, port = self._address
        shown = "127.0.0.1" if host in ("0.0.0.0", "::", "") else host
        place = f"xela://[{shown}]:{port}" if ":" in shown else f"xela://{shown}:{port}"
        if self.encoder.is_hand:
            return place
        names = ",".join(f"{number}:{name}" for number, (name,) in self.encoder.modules.items())
        return f"{place}?fingers={names}"

    def wait(self, timeout: float) -> bool:
        """Waits until it has ended, for `timeout` [s] at the most; whether it has."""
        return self._over.wait(timeout)

    def __enter__(self) -> Self:
        self._serving.start()
        self._began.wait()
        if self._refusal is not None:
            self._serving.join()
            raise self._refusal
        self._feeding.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._feeding.join()
        self._loop.call_soon_threadsafe(self._stop.set)
        self._serving.join()

    def _feed(self) -> None:
        """Reads the source, and hands its packets to the loop that sends them."""
        try:
            while not self._stopping.is_set() and not self._someone.wait(PATIENCE):
                pass
            while not self._stopping.is_set() and not self._source.ended:
                arrival = self._source.read(PATIENCE)
                if arrival is not None and arrival.samples:
                    self._tell(self._batcher.add(arrival.samples, arrival.time))
            self._tell(self._batcher.flush())
        except Exception as failure:  # told by whoever started it
            self.failure = failure
        finally:
            if not self._stopping.is_set() and self.failure is None:
                self._wait_for_readers()
            self._over.set()

    def _tell(self, due: Iterator[SampleBatch]) -> None:
        for batch in due:
            self._loop.call_soon_threadsafe(self._send, self._packet(batch))

    def _packet(self, batch: SampleBatch) -> str:
        now = time.time()
        if self._shift is None:
            self._shift = now - batch.time
        times = {name: one + self._shift for name, one in batch.times.items()}
        packet = self.encoder.packet(batch.samples, batch.time + self._shift, now, times)
        return packet.decode()

    def _wait_for_readers(self) -> None:
        asyncio.run_coroutine_threadsafe(self._emptied(), self._loop).result()

    async def _emptied(self) -> None:
        """Waits until the last packet is on its way to everybody."""
        until = time.monotonic() + FAREWELL
        while any(_behind(client) for client in self._clients):
            if self._stopping.is_set() or time.monotonic() > until:
                return
            await asyncio.sleep(0.01)

    def _serve(self) -> None:
        asyncio.run(self._run())

    async def _run(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._stop = asyncio.Event()
        host, port = self._address
        try:
            server = await serve(
                self._greet, host, port,
                compression=None, close_timeout=CLOSING, max_size=2**16, logger=_QUIET,
            )  # fmt: skip
        except (OSError, OverflowError) as cause:
            self._refusal = OutputError(
                f"cannot listen at {host}:{port} ({_reason(cause)}); --port 0 finds a free port"
            )
            self._began.set()
            return
        async with server:
            self._address = host, next(iter(server.sockets)).getsockname()[1]
            self._began.set()
            await self._stop.wait()

    async def _greet(self, client: ServerConnection) -> None:
        """Tells a client "Welcome", then lets it have all packets until it leaves."""
        with suppress(ConnectionClosed):
            await client.send(self.encoder.welcome().decode())
            self._clients.add(client)
            self._someone.set()
            try:
                async for _ in client:  # a XELA server takes no commands
                    pass
            finally:
                self._clients.discard(client)

    def _send(self, packet: str) -> None:
        for client in [one for one in self._clients if _behind(one) > BACKLOG]:
            client.transport.abort()
        broadcast(self._clients, packet)
        self.n_packets += 1


def _behind(client: ServerConnection) -> int:
    """Bytes that wait to be sent to a client."""
    waiting: int = client.transport.get_write_buffer_size()
    return waiting


def _reason(cause: Exception) -> str:
    text = getattr(cause, "strerror", None) or str(cause)
    return "it is in use" if "in use" in text else text
