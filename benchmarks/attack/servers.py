"""Servers that do not do what XELA's server does: the client reports it, and goes on."""

import base64
import hashlib
import random
import re
import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread

from attack.result import Result
from holdfast.devices.sources import open_source
from holdfast.devices.sources.xela import client
from holdfast.errors import HoldfastError

MAGIC = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
READ_TIME = 0.1
"""Time for which an open source is read [s]."""
LIMIT = 4.0
"""An input that takes longer is slow [s]; opening waits 0.5 s here for the first packet."""


def frame(data: bytes, opcode: int = 1, *, final: bool = True) -> bytes:
    """Return a frame of a WebSocket server."""
    n = len(data)
    size = bytes([n]) if n < 126 else struct.pack(">BH", 126, n) if n < 65536 else b""
    return bytes([128 * final | opcode]) + (size or struct.pack(">BQ", 127, n)) + data


def packet(k: int) -> bytes:
    """Return packet number `k` of one taxel."""
    stamp = time.time() + k / 150
    return b'{"message": %d, "time": %.6f, "1": {"model": "uSPa11", "data": "8000,8000,%04X"}}' % (
        k, stamp, 0x8000 + k % 9,
    )  # fmt: skip


def good(n: int) -> bytes:
    """Return packets in frames."""
    return b"".join(frame(packet(k)) for k in range(n))


HEADLESS: dict[str, bytes] = {
    "closes at once": b"",
    "random bytes": random.Random(0).randbytes(100_000),
    "a page": b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nhi",
    "an error": b"HTTP/1.1 500 No\r\n\r\n",
    "an endless header": b"HTTP/1.1 101 OK\r\n" + b"A: b\r\n" * 200_000,
    "an endless line": b"HTTP/1.1 101 " + b"x" * 3_000_000,
    "a redirect": b"HTTP/1.1 302 F\r\nLocation: ws://127.0.0.1:9/\r\nContent-Length: 0\r\n\r\n",
    "a wrong key": b"HTTP/1.1 101 S\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Accept: AAAA\r\n\r\n",
}
"""Answers to the handshake."""
SPOKEN: dict[str, bytes] = {
    "nothing": b"",
    "only its welcome": frame(b'{"message": "Welcome"}'),
    "other JSON": frame(b'{"a": [1, 2]}') * 100,
    "no JSON": frame(b"\x00\xff") * 100,
    "deep JSON": frame(b"[" * 60_000) * 3,
    "a huge packet": frame(b" " * 3_000_000),
    "a length of 2**63 - 1": b"\x81\x7f" + struct.pack(">Q", 2**63 - 1),
    "an unknown opcode": frame(b"", 11),
    "a fragment without end": frame(b'{"message": 1', final=False),
    "pings": frame(b"x" * 100, 9) * 2000,
    "a long ping": frame(b"x" * 200, 9),
    "a close with an odd code": frame(struct.pack(">H", 5), 8),
    "packets, then it closes": good(5),
    "packets, then no JSON": good(5) + frame(b"{") * 1000,
    "packets, then a huge one": good(5) + frame(b"1" * 2_000_000),
    "packets, then half a frame": good(5) + good(6)[-20:-5],
    "the same packet": frame(packet(1)) * 1000,
}
"""What is sent after a good handshake."""


@contextmanager
def speaking(answer: bytes | None, data: bytes) -> Iterator[int]:
    """Run a server that sends `answer` to the handshake, or a good one and then `data`."""
    ended = Event()

    def serve(listener: socket.socket) -> None:
        while not ended.is_set():
            with suppress(OSError):
                connection, _ = listener.accept()
                with connection:
                    connection.settimeout(1.0)
                    connection.sendall(_greeting(connection) + data if answer is None else answer)
                    ended.wait(READ_TIME)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(0.1)
        thread = Thread(target=serve, args=(listener,))
        thread.start()
        try:
            yield listener.getsockname()[1]
        finally:
            ended.set()
            thread.join()


def _greeting(connection: socket.socket) -> bytes:
    head = b""
    while b"\r\n\r\n" not in head:
        head += connection.recv(4096)
    key = re.search(rb"Sec-WebSocket-Key: (\S+)", head)
    digest = hashlib.sha1((key[1] if key else b"") + MAGIC, usedforsecurity=False).digest()
    return (
        b"HTTP/1.1 101 Switching\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Accept: " + base64.b64encode(digest) + b"\r\n\r\n"
    )


def attack_client(rounds: int) -> Result:
    """Open and read a source of each server; only documented errors may be raised."""
    result = Result("hostile XELA servers", limit=LIMIT)
    before, client.XELA_OPEN_TIMEOUT = client.XELA_OPEN_TIMEOUT, 0.5
    cases = [
        *((HEADLESS[name], b"") for name in HEADLESS),
        *((None, one) for one in SPOKEN.values()),
    ]
    try:
        for _ in range(rounds):
            for answer, data in cases:
                with speaking(answer, data) as port:
                    result.timed(_reading(port), HoldfastError)
    finally:
        client.XELA_OPEN_TIMEOUT = before
    return result


def _reading(port: int) -> Callable[[], bool]:
    def read() -> bool:
        with open_source(f"xela://127.0.0.1:{port}") as source:
            end = time.monotonic() + READ_TIME
            while time.monotonic() < end:
                source.read(0.05)
        return True

    return read


def attack_reconnection(kills: int) -> Result:
    """Kill the server in the middle of a packet; the source must go on, with increasing times."""
    result = Result("XELA server killed in a packet", limit=LIMIT)
    dice = random.Random(0)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(0.2)
        sent, ended = [1], Event()

        def serve() -> None:
            while not ended.is_set():
                with suppress(OSError):
                    connection, _ = listener.accept()
                    with connection:
                        first = sent[0]
                        sent[0] += 20
                        data = b"".join(frame(packet(first + k)) for k in range(20))
                        cut = data[: -dice.randrange(1, 100)]
                        connection.sendall(_greeting(connection) + cut)

        thread = Thread(target=serve)
        thread.start()
        last, values = -1.0, set(range(0x8000, 0x8009))
        with open_source(f"xela://127.0.0.1:{listener.getsockname()[1]}") as source:

            def one_life() -> bool:
                nonlocal last
                while True:
                    arrival = source.read(2.0)
                    if arrival is None:
                        raise RuntimeError("nothing came within 2 s")
                    if arrival.samples:
                        (sample,) = arrival.samples.values()
                        right = arrival.time > last and int(sample[0, 2]) in values
                        result.n_wrong += not right
                        last = arrival.time
                    if any("connected again" in notice for notice in arrival.notices):
                        return True

            for _ in range(kills):
                result.timed(one_life)
        ended.set()
        listener.close()
        thread.join()
    return result
