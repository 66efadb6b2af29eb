"""Connection to XELA's server. This module owns the socket and the clock."""

import logging
import socket
import time
from collections.abc import Mapping
from contextlib import suppress

from websockets.exceptions import (
    ConnectionClosed,
    ConnectionClosedOK,
    InvalidHandshake,
    WebSocketException,
)
from websockets.sync.client import ClientConnection, connect

from holdfast.devices.sources.base import DeviceSource
from holdfast.devices.sources.xela.addresses import ServerAddress
from holdfast.devices.sources.xela.decoder import XelaDecoder
from holdfast.devices.sources.xela.packet import InvalidPacket
from holdfast.errors import SourceError
from holdfast.sensors import Sensor

XELA_OPEN_TIMEOUT = 5.0
"""Longest wait for the first packet with samples [s]."""
XELA_CONNECT_TIMEOUT = 1.0
"""Longest time of one attempt to connect [s]; a read may take longer than its timeout by this."""
MIN_HANDSHAKE_TIME = 0.1
"""Minimum time for the handshake, even if the connection took longer [s]."""
XELA_SILENCE_TIMEOUT = 1.5
"""A connected server without a new sample for this time is silent [s]; it may pause for 1 s."""
PING_INTERVAL, PING_TIMEOUT = 10.0, 5.0
"""Time between two pings of the server, and longest wait for the answer [s]."""
MAX_PACKET_SIZE = 2**20
"""A longer packet is refused and ends its connection [bytes]; a whole hand sends 20,000."""
MAX_QUEUED_PACKETS = 4096
"""Packets that wait in this process if the reader is busy: 80 MB and 27 s of a whole hand. More
packets wait at the server, which may drop a client that does not read."""
TRY_AUTO = "; xela_server binds the address of the network card: try xela://auto"
"""Advice if only one address was tried."""

_LOGGER = logging.getLogger("holdfast.devices.sources.xela")
_LOGGER.addHandler(logging.NullHandler())


class XelaSource(DeviceSource):
    """Source of the sensors of one XELA server.

    Args:
        name: URI of the source.
        addresses: network addresses to try, in order.
        names: names of the sensors by the server's number.
        calibrated: take readings in newtons.
        sensor: layout of the separate sensors with this number of taxels.
    """

    silence_timeout = XELA_SILENCE_TIMEOUT

    def __init__(
        self,
        name: str,
        addresses: tuple[ServerAddress, ...],
        names: Mapping[int, str] | None = None,
        *,
        calibrated: bool = False,
        sensor: Sensor | None = None,
    ) -> None:
        super().__init__()
        self.name = name
        self._addresses = addresses
        self._address = addresses[0]  # the one with the server, for messages
        self._options = (names, calibrated, sensor)
        self._decoder = self._new_decoder()
        self._connection: ClientConnection | None = None

    def open(self) -> None:
        """Connect, and wait until the modules are known.

        Raises:
            SourceError: no server listens, it sends nothing, or other data than expected.
        """
        self.close()
        # A new one: the server may have other sensors than when it was open before.
        self._decoder = self._new_decoder()
        self._connection = self._connected()
        # The modules are known by a packet, and the first packets may define none.
        deadline = time.monotonic() + XELA_OPEN_TIMEOUT
        invalid: InvalidPacket | None = None
        text = b""
        while not text and (left := deadline - time.monotonic()) > 0:
            try:
                message = self._connection.recv(left, decode=False)
                received = time.monotonic()
                text = message if self._decoder.identify(message) else b""
            except InvalidPacket as why:
                invalid = why  # the next one may be valid: the first may have been cut
            except TimeoutError:
                break
            except ConnectionClosed as why:
                raise SourceError(f"{self._address} closed the connection: {why}") from why
        if not text and invalid is not None:
            raise SourceError(f"{self._address} sends invalid packets: {invalid}") from invalid
        if not text:
            raise SourceError(
                f"connected to {self._address}, but no samples came in {XELA_OPEN_TIMEOUT:g} s: is "
                "it a XELA server, with its sensors plugged in?"
            )
        self.sensors = self._decoder.sensors
        self.metadata = {"source": self.name, **self._decoder.metadata}
        self.begin_reading(received)
        notices = [text for device in self._decoder.devices.values() for text in device.notices]
        first, *others = self._decoder.decode(text, received)
        first = first._replace(notices=(*notices, *first.notices))
        self.queue([first, *others], received)
        self.note_clock()

    def _new_decoder(self) -> XelaDecoder:
        names, calibrated, sensor = self._options
        return XelaDecoder(names, calibrated=calibrated, sensor=sensor)

    def _connected(self) -> ClientConnection:
        """Connect to the first address with a server."""
        failures: list[Exception] = []
        for address in self._addresses:
            try:
                connection = _connect(address)
            except (OSError, WebSocketException) as failure:
                failures.append(failure)
            else:
                self._address = address
                return connection
        where = " or ".join(map(str, self._addresses))
        # The most helpful first: no server at all, another server, anything else.
        if all(isinstance(failure, ConnectionRefusedError) for failure in failures):
            why = (
                f"no server listens at {where}{TRY_AUTO if len(self._addresses) == 1 else ''}; "
                "without a hand, use `holdfast play`"
            )
        elif any(isinstance(failure, WebSocketException) for failure in failures):
            why = f"the server at {where} is no XELA server: {failures[-1]}"
        else:
            why = f"{where} cannot be reached: {failures[-1]}"
        raise SourceError(why) from failures[-1]

    def receive(self, timeout: float) -> bool:
        """Process what the device sends within `timeout` [s]; return False if nothing came."""
        if self._connection is None:
            return False
        try:
            text = self._connection.recv(timeout, decode=False)
            received = time.monotonic()
        except TimeoutError:
            return False
        except ConnectionClosed as why:
            self.disconnect()
            self.lose("the server closed it" if isinstance(why, ConnectionClosedOK) else why)
            return False
        self.queue(self._decoder.decode(text, received), received)
        return True

    def reconnect(self) -> bool:
        """Try to connect again; return whether the device is connected."""
        try:
            self._connection = self._connected()
        except SourceError:
            return False
        self._decoder.reconnected()
        return True

    def disconnect(self) -> None:
        """Close the connection, if there is one."""
        # Set to None first: nothing uses it while it closes.
        connection, self._connection = self._connection, None
        if connection is None:
            return
        with suppress(OSError, WebSocketException):
            connection.close()
        # It ends a little after the connection: no thread outlives the source.
        keepalive = getattr(connection, "keepalive_thread", None)
        if keepalive is not None:
            keepalive.join(XELA_CONNECT_TIMEOUT)


def _connect(server: ServerAddress) -> ClientConnection:
    """Connect to a server. A redirect to another server is refused."""
    deadline = time.monotonic() + XELA_CONNECT_TIMEOUT
    connected = socket.create_connection((server.host, server.port), XELA_CONNECT_TIMEOUT)
    connected.settimeout(None)
    try:
        return connect(
            f"ws://{server}",
            sock=connected,  # websockets follows redirects only with sockets of its own
            compression=None,
            proxy=None,
            open_timeout=max(deadline - time.monotonic(), MIN_HANDSHAKE_TIME),
            ping_interval=PING_INTERVAL,
            ping_timeout=PING_TIMEOUT,
            close_timeout=XELA_CONNECT_TIMEOUT,
            max_size=MAX_PACKET_SIZE,
            max_queue=MAX_QUEUED_PACKETS,
            logger=_LOGGER,
        ).__enter__()
    except (ValueError, AssertionError) as cause:  # it answered before it was asked
        raise InvalidHandshake(str(cause) or "it answers no handshake") from cause
