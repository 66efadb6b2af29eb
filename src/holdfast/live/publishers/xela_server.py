"""Send the samples of a source to clients, in the protocol of XELA's server."""

import asyncio
import logging
import math
import time
from collections.abc import Iterator
from contextlib import suppress
from http import HTTPStatus
from threading import Event, Thread
from typing import Self

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from holdfast.devices.sources import Source
from holdfast.devices.sources.xela.encoder import (
    NEW_VERSION,
    SampleBatch,
    SampleBatcher,
    XelaEncoder,
)
from holdfast.errors import listen_error
from holdfast.web.connections import (
    BACKLOG,
    HEADER_TIMEOUT,
    is_local,
    log_exceptions_briefly,
    refusal,
)

HOST, PORT = "127.0.0.1", 5000
STOP_CHECK_INTERVAL = 0.2
"""Maximum time to wait for the source before the stop flag is checked [s]."""
MAX_BACKLOG = 32 * 2**20
"""Maximum unsent data of a client [bytes]; a client with more is disconnected."""
MAX_TOTAL_BACKLOG = 64 * 2**20
"""Maximum unsent data of all clients [bytes]; the slowest ones are disconnected first."""
MAX_CLIENTS = 64
"""Maximum number of clients."""
CLOSE_TIMEOUT = 1.0
"""Time for the closing handshake of a client [s]."""
MIN_PAUSE = 0.5
"""A longer step between the times of the source is a pause between two grasps [s]."""
DRAIN_TIMEOUT = 10.0
"""Maximum time, after the source has ended, to wait for clients that read slowly [s]."""

_SILENT_LOGGER = logging.getLogger("holdfast.live.publishers.xela_server")
_SILENT_LOGGER.addHandler(logging.NullHandler())


class XelaServer:
    """XELA server that sends the samples of a source; it runs in its own threads.

    The time stamps are the times of the source, shifted so that the first one is the current time;
    again so after each pause of the source, and when a client connects to a server without
    clients. Time stamps never go back. Packets are
    sent as soon as the source provides the samples. A client that does not read delays no other
    client, and is disconnected. Requests of web pages from another origin are refused.

    Args:
        source: an open source; the caller closes it.
        version: of the server protocol, 1.7 or 1.8.
        host: address to listen at.
        port: 0 for any free port.
        whole_hand: send fingertips as part of a whole hand.
        wait: start to read the source when the first client connects.
        restart: begin the next recording of the source for each client that connects, and do not
            read it while there is no client. A client then receives it from its beginning.

    Attributes:
        encoder: encoder of the packets.
        n_packets: number of packets sent.
        failure: the exception that ended the server; None if there was none.

    Raises:
        ValueError: the protocol cannot represent the sensors of the source.

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
        restart: bool = False,
    ) -> None:
        self.encoder = XelaEncoder(source.sensors, version=version, whole_hand=whole_hand)
        self._source = source
        self._batcher = self._new_batcher()
        self._address = host, port
        self.n_packets = 0
        self.failure: Exception | None = None
        self._start_failure: Exception | None = None
        # Clients that get packets; and those that wait for the beginning of the next recording.
        # The event loop alone changes both.
        self._clients: set[ServerConnection] = set()
        self._joining: set[ServerConnection] = set()
        # Set by the event loop (listening, a client was seen, one joined), by the thread of the
        # source (ended) and by `__exit__` (stopping); the others wait for them.
        self._listening = Event()
        self._stopping = Event()
        self._ended = Event()
        self._client_seen = Event()
        if not wait:
            self._client_seen.set()
        self._restarts = restart
        self._joined = Event()
        # From times of the source to stamps since 1970, and the time of the last packet. The
        # thread of the source alone changes them.
        self._time_offset = self._sent_time = -math.inf
        self._has_offset = False
        self._server_thread = Thread(
            target=lambda: asyncio.run(self._run()), name="holdfast-play", daemon=True
        )
        self._source_thread = Thread(
            target=self._read_source, name="holdfast-play-source", daemon=True
        )

    @property
    def n_clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients) + len(self._joining)

    @property
    def ended(self) -> bool:
        """Whether the source has ended, or sending has failed."""
        return self._ended.is_set()

    @property
    def port(self) -> int:
        """Port on which it listens."""
        return self._address[1]

    @property
    def uri(self) -> str:
        """URI for `open_source`, with the names of the modules."""
        host, port = self._address
        shown = "127.0.0.1" if host in ("0.0.0.0", "::", "") else host
        address = f"xela://[{shown}]:{port}" if ":" in shown else f"xela://{shown}:{port}"
        if self.encoder.is_hand:
            return address
        names = ",".join(f"{number}:{name}" for number, (name,) in self.encoder.modules.items())
        return f"{address}?fingers={names}"

    def wait(self, timeout: float) -> bool:
        """Wait at most `timeout` [s] for the end. Return whether it has ended."""
        return self._ended.wait(timeout)

    def __enter__(self) -> Self:
        self._server_thread.start()
        self._listening.wait()
        if self._start_failure is not None:
            self._server_thread.join()
            raise self._start_failure
        self._source_thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._source_thread.join()
        self._loop.call_soon_threadsafe(self._stop.set)
        self._server_thread.join()

    def _read_source(self) -> None:
        """Read the source, and pass its packets to the event loop that sends them."""
        try:
            if self._restarts:
                # Encode the first samples now: readings of another kind fail before a client comes.
                arrival = self._source.read(STOP_CHECK_INTERVAL)
                if arrival is not None and arrival.samples:
                    for batch in self._batcher.add(arrival.samples, arrival.time):
                        self._packet(batch)
            while not self._stopping.is_set() and not self._source.ended:
                arrival = self._source.read(STOP_CHECK_INTERVAL) if self._may_read() else None
                if arrival is not None and arrival.samples:
                    self._queue_packets(self._batcher.add(arrival.samples, arrival.time))
            self._queue_packets(self._batcher.flush())
        except Exception as failure:  # the caller reads it
            self.failure = failure
        finally:
            if not self._stopping.is_set() and self.failure is None:
                asyncio.run_coroutine_threadsafe(self._drain(), self._loop).result()
            self._ended.set()

    def _may_read(self) -> bool:
        """Return whether to read the source now, after a wait for clients if necessary."""
        if not self._restarts:
            return self._client_seen.wait(STOP_CHECK_INTERVAL)
        if self._joined.is_set():
            self._joined.clear()
            # Clients that joined receive nothing from before.
            self._queue_packets(self._batcher.flush())
            self._batcher = self._new_batcher()
            self._has_offset = self._has_offset and bool(self._clients)
            self._source.restart()
            self._loop.call_soon_threadsafe(self._admit)
        elif not self.n_clients:
            self._joined.wait(STOP_CHECK_INTERVAL)
            return False
        return True

    def _new_batcher(self) -> SampleBatcher:
        return SampleBatcher(self._source.sensors, own_stamps=self.encoder.has_own_stamps)

    def _admit(self) -> None:
        """Send packets to the clients that joined, too."""
        self._clients |= self._joining
        self._joining.clear()

    def _queue_packets(self, batches: Iterator[SampleBatch]) -> None:
        for batch in batches:
            self._loop.call_soon_threadsafe(self._send, self._packet(batch))

    def _packet(self, batch: SampleBatch) -> str:
        now = time.time()
        # A grasp that began later than the source planned would be late to its end.
        paused = batch.time - self._sent_time > MIN_PAUSE
        self._sent_time = batch.time
        if paused or not self._has_offset:  # time stamps never go back
            self._time_offset = max(self._time_offset, now - batch.time)
            self._has_offset = True
        times = {name: sample_time + self._time_offset for name, sample_time in batch.times.items()}
        packet = self.encoder.packet(batch.samples, batch.time + self._time_offset, now, times)
        return packet.decode()

    async def _drain(self) -> None:
        """Wait until the last packet has been sent to all clients."""
        deadline = time.monotonic() + DRAIN_TIMEOUT
        # There is no event for an empty buffer of a transport.
        while any(_unsent_bytes(client) for client in self._clients):
            if self._stopping.is_set() or time.monotonic() > deadline:
                return
            await asyncio.sleep(0.01)

    async def _run(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._stop = asyncio.Event()
        log_exceptions_briefly(self._loop)
        host, port = self._address
        try:
            server = await serve(
                self._serve_client, host, port,
                process_request=self._refusal, compression=None, max_size=2**16,
                open_timeout=HEADER_TIMEOUT, close_timeout=CLOSE_TIMEOUT, backlog=BACKLOG,
                logger=_SILENT_LOGGER,
            )  # fmt: skip
        except (OSError, OverflowError) as cause:
            self._start_failure = listen_error(host, port, cause)
            self._listening.set()
            return
        async with server:
            self._address = host, next(iter(server.sockets)).getsockname()[1]
            self._listening.set()
            await self._stop.wait()

    def _refusal(self, client: ServerConnection, request: Request) -> Response | None:
        """Return the response to a client that is refused; None if it is accepted."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        # A second header could show another host to us than to a proxy before us.
        if len(hosts) != 1 or len(origins) > 1:
            return client.respond(HTTPStatus.BAD_REQUEST, "one host and one origin expected\n")
        origin = origins[0] if origins else None
        why = refusal(hosts[0], origin, only_local=is_local(self._address[0]))
        if why is not None:
            return client.respond(HTTPStatus.FORBIDDEN, f"{why}\n")
        if len(self._clients | self._joining) >= MAX_CLIENTS:
            text = f"{MAX_CLIENTS} clients are connected; disconnect one of them\n"
            return client.respond(HTTPStatus.SERVICE_UNAVAILABLE, text)
        return None

    async def _serve_client(self, client: ServerConnection) -> None:
        """Send "Welcome" to a client, then all packets until it disconnects."""
        with suppress(ConnectionClosed):
            await client.send(self.encoder.welcome().decode())
            self._joining.add(client)
            if not self._restarts:
                self._admit()
            self._client_seen.set()
            self._joined.set()
            try:
                async for _ in client:  # a XELA server takes no commands
                    pass
            finally:
                self._clients.discard(client)
                self._joining.discard(client)

    def _send(self, packet: str) -> None:
        for client in _too_slow(
            {connection: _unsent_bytes(connection) for connection in self._clients}
        ):
            client.transport.abort()
        broadcast(self._clients, packet)
        self.n_packets += 1


def _unsent_bytes(client: ServerConnection) -> int:
    """Return the number of bytes that wait to be sent to a client."""
    n_bytes: int = client.transport.get_write_buffer_size()
    return n_bytes


def _too_slow(backlogs: dict[ServerConnection, int]) -> list[ServerConnection]:
    """Return the clients to disconnect, given the unsent data of each client [bytes]."""
    # The slowest first: disconnecting few frees most.
    total, slow = sum(backlogs.values()), []
    for client in sorted(backlogs, key=backlogs.__getitem__, reverse=True):
        if backlogs[client] <= MAX_BACKLOG and total <= MAX_TOTAL_BACKLOG:
            break
        total -= backlogs[client]
        slow.append(client)
    return slow
