"""The connection to XELA's server: opened, kept, and made again. It owns socket and clock."""

import logging
import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress

from websockets.exceptions import ConnectionClosed, ConnectionClosedOK, WebSocketException
from websockets.sync.client import ClientConnection, connect

from holdfast.errors import SourceError
from holdfast.sensors import Sensor
from holdfast.sources.base import Arrival, Source, notice_arrival
from holdfast.sources.xela.decoder import Decoder
from holdfast.sources.xela.packet import Refusal
from holdfast.sources.xela.places import Place

PATIENCE = 5.0
"""How long entering waits for a packet with samples [s]."""
CONNECT = 1.0
"""How long one attempt to connect may take [s]; a read may last so much longer than asked."""
BACKOFF, LONGEST_BACKOFF = 0.5, 2.0
"""Before the first and before later attempts to connect again [s]; it doubles."""
SILENCE = 1.5
"""Without a new sample for so long, a connected server is silent [s]; it may pause for 1 s."""
PING, PONG = 10.0, 5.0
"""How often the server is asked whether it is there, and how long it may take [s]."""
LARGEST = 2**20
"""A packet of more bytes is refused, with its connection; that of a whole hand has 20,000."""
QUEUED = 4096
"""Packets that wait here for a reader that is busy (of a whole hand 80 MB, for 27 s); more
wait at the server, which may drop a client that does not answer."""
ELSEWHERE = "; xela_server binds the address of the network card: try xela://auto"
"""What helps where one address was tried."""

_QUIET = logging.getLogger("holdfast.sources.xela")
_QUIET.addHandler(logging.NullHandler())


class XelaSource(Source):
    """The sensors of one XELA server.

    Args:
        name: what it was asked for by.
        places: to try, in order.
        names: of the sensors by the server's number.
        calibrated: take the readings in newtons.
        sensor: of separate sensors with that number of taxels.
    """

    def __init__(
        self,
        name: str,
        places: tuple[Place, ...],
        names: Mapping[int, str] | None = None,
        *,
        calibrated: bool = False,
        sensor: Sensor | None = None,
    ) -> None:
        self.name = name
        self._places = places
        self._place = places[0]
        self._options = (names, calibrated, sensor)
        self._decoder = self._new_decoder()
        self._connection: ClientConnection | None = None
        self._pending: deque[Arrival] = deque()
        self._forget()

    def open(self) -> None:
        """Connects, and waits until the modules are known.

        Raises:
            SourceError: nothing listens, it says nothing, or not what is expected.
        """
        self.close()
        self._decoder = self._new_decoder()
        self._connection = self._connected()
        text, received = self._first()
        self.sensors = self._decoder.sensors
        self.metadata = {"source": self.name, **self._decoder.metadata}
        self._heard_at = received
        notices = [notice for skin in self._decoder.skins.values() for notice in skin.notices]
        first, *others = self._decoder.take(text, received)
        self._pending.append(first._replace(notices=(*notices, *first.notices)))
        self._pending.extend(others)
        self._is_open = True

    def read(self, timeout: float) -> Arrival | None:
        """What arrived next, or None where nothing did within `timeout` [s]."""
        deadline = time.monotonic() + timeout
        while self._is_open and not self._pending:
            left = deadline - time.monotonic()
            if self._connection is None:
                self._try_again(left)
            else:
                self._listen(self._connection, left)
            if left <= 0:
                break
        return self._pending.popleft() if self._pending else None

    def close(self) -> None:
        """Closes the connection; again, it does nothing."""
        self._disconnect()
        self._pending.clear()
        self._forget()

    def _new_decoder(self) -> Decoder:
        names, calibrated, sensor = self._options
        return Decoder(names, calibrated=calibrated, sensor=sensor)

    def _forget(self) -> None:
        self._is_open = False
        self._lost_at = self._heard_at = time.monotonic()
        self._again_at = 0.0
        self._backoff = BACKOFF
        self._silent = False

    def _connected(self) -> ClientConnection:
        """The connection to the first place where a server is."""
        failures: list[Exception] = []
        for place in self._places:
            try:
                connection = _connect(place)
            except (OSError, WebSocketException) as failure:
                failures.append(failure)
            else:
                self._place = place
                return connection
        raise SourceError(self._unreachable(failures)) from failures[-1]

    def _first(self) -> tuple[bytes, float]:
        """The first packet that tells which modules there are, and when it came."""
        deadline = time.monotonic() + PATIENCE
        refusal: Refusal | None = None
        while (left := deadline - time.monotonic()) > 0 and self._connection is not None:
            try:
                text = self._connection.recv(left, decode=False)
                received = time.monotonic()
                if self._decoder.learn(text):
                    return text, received
            except Refusal as why:
                refusal = why
            except TimeoutError:
                break
            except ConnectionClosed as why:
                raise SourceError(f"{self._place} closed the connection: {why}") from why
        if refusal is not None:
            raise SourceError(f"what {self._place} sends makes no sense: {refusal}") from refusal
        raise SourceError(
            f"connected to {self._place}, but no samples came in {PATIENCE:g} s: is it a XELA "
            "server, with its sensors plugged in?"
        )

    def _listen(self, connection: ClientConnection, timeout: float) -> None:
        """Takes the next packet, within `timeout` [s]."""
        until_silent = self._heard_at + SILENCE - time.monotonic()
        wait = timeout if self._silent else min(timeout, max(until_silent, 0.0))
        try:
            text = connection.recv(max(wait, 0.0), decode=False)
            received = time.monotonic()
        except TimeoutError:
            self._notice_silence()
        except ConnectionClosed as why:
            self._lose(why)
        else:
            self._take(text, received)

    def _take(self, text: bytes, received: float) -> None:
        arrivals = self._decoder.take(text, received)
        if any(arrival.samples for arrival in arrivals):
            if self._silent:
                silence = received - self._heard_at
                self._pending.append(
                    notice_arrival(received, f"samples again after {silence:.1f} s")
                )
            self._silent = False
            self._heard_at = received
        else:
            self._notice_silence()
        self._pending.extend(arrivals)

    def _notice_silence(self) -> None:
        now = time.monotonic()
        if not self._silent and now - self._heard_at >= SILENCE:
            self._silent = True
            self._pending.append(notice_arrival(now, f"no new sample for {SILENCE:g} s"))

    def _lose(self, why: Exception) -> None:
        self._disconnect()
        now = self._lost_at = time.monotonic()
        self._backoff = BACKOFF
        self._again_at = now + self._backoff
        reason = "the server ended it" if isinstance(why, ConnectionClosedOK) else why
        self._pending.append(notice_arrival(now, f"connection lost ({reason})"))

    def _try_again(self, timeout: float) -> None:
        """Waits until it is time to connect again, and does; within `timeout` and `CONNECT`."""
        wait = self._again_at - time.monotonic()
        if wait > 0:
            time.sleep(max(min(wait, timeout), 0.0))
        if wait > timeout:
            return
        try:
            self._connection = self._connected()
        except SourceError:
            self._backoff = min(2 * self._backoff, LONGEST_BACKOFF)
            self._again_at = time.monotonic() + self._backoff
            return
        now = self._heard_at = time.monotonic()
        self._silent = False
        self._decoder.reconnected()
        self._pending.append(
            notice_arrival(now, f"connected again after {now - self._lost_at:.1f} s")
        )

    def _disconnect(self) -> None:
        connection, self._connection = self._connection, None
        if connection is None:
            return
        with suppress(OSError, WebSocketException):
            connection.close()
        keepalive = getattr(connection, "keepalive_thread", None)
        if keepalive is not None:
            keepalive.join(CONNECT)

    def _unreachable(self, failures: list[Exception]) -> str:
        where = " or ".join(map(str, self._places))
        if all(isinstance(failure, ConnectionRefusedError) for failure in failures):
            return (
                f"nothing listens at {where}{ELSEWHERE if len(self._places) == 1 else ''}; "
                "without a hand, `holdfast play` stands in for it"
            )
        if any(isinstance(failure, WebSocketException) for failure in failures):
            return f"what listens at {where} is no XELA server: {failures[-1]}"
        return f"{where} cannot be reached: {failures[-1]}"


def _connect(place: Place) -> ClientConnection:
    return connect(
        f"ws://{place}",
        compression=None,
        proxy=None,
        open_timeout=CONNECT,
        ping_interval=PING,
        ping_timeout=PONG,
        close_timeout=CONNECT,
        max_size=LARGEST,
        max_queue=QUEUED,
        logger=_QUIET,
    ).__enter__()
