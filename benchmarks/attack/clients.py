"""Clients and pages that attack `holdfast serve` and `holdfast play`, each in a process."""

import json
import resource
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import IO

from attack.result import Result
from holdfast.devices.sources import Source, open_source
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

TOKEN = "a-secret-of-the-attack"
HOST = b"Host: 127.0.0.1\r\n"
SECURE = b"X-Content-Type-Options: nosniff"
UPGRADE = (
    b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
)


@dataclass
class Process:
    """Process of a server under attack."""

    process: "subprocess.Popen[str]"
    port: int
    log: IO[str]

    def resident(self) -> float:
        """Return its resident memory [MB]."""
        text = Path(f"/proc/{self.process.pid}/statm").read_text(encoding="ascii")
        return int(text.split()[1]) * resource.getpagesize() / 1e6

    def descriptors(self) -> int:
        """Return the number of its open files."""
        return len(list(Path(f"/proc/{self.process.pid}/fd").iterdir()))

    def log_size(self) -> int:
        """Return how much it has logged [bytes]."""
        self.log.seek(0, 2)
        return self.log.tell()


@contextmanager
def running(*words: str, descriptors: int) -> Iterator[Process]:
    """Run `holdfast` with few file descriptors; its first line of JSON names the address."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (descriptors, descriptors))

    command = [Path(sys.executable).with_name("holdfast"), *words, "--port", "0", "--json"]
    with TemporaryFile("w+") as log:
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=log, text=True,
            preexec_fn=limit,  # noqa: PLW1509 (this process has one thread here)
        )  # fmt: skip
        try:
            document = json.loads(process.stdout.readline() if process.stdout else "")
            address = (document.get("url") or document["uri"]).partition("//")[2]
            port = int(address.partition("/")[0].partition("?")[0].rpartition(":")[2])
            yield Process(process, port, log)
        finally:
            process.terminate()
            process.communicate()


@contextmanager
def recording() -> Iterator[str]:
    """Write a recording of a hand with four fingertips."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "hand.parquet"
        fingers = ("thumb", "index", "middle", "ring")
        save_recording(synthetic_recording("hand", 0, fingers), path)
        yield str(path)


def attack_serve(held: int) -> list[Result]:
    """Hold connections, send invalid requests and unfinished bodies, and never read."""
    with (
        recording() as path,
        TemporaryDirectory() as folder,
        running(
            "serve",
            "builtin:twin",
            path,
            "--token",
            TOKEN,
            "--record-to",
            folder,
            descriptors=256,
        ) as server,
    ):
        return [
            _hold(server, "serve: half-open connections", b"GET / HTTP/1.1\r\n" + HOST, held),
            _hold(server, "serve: connections without a byte", b"", held),
            _hold(server, "serve: unfinished bodies", _post(b'{"name": "'), held // 4),
            _hold(server, "serve: WebSockets that never read", _socket(), 60),
            _requests(server),
        ]


def _post(data: bytes) -> bytes:
    return (
        b"POST /api/v1/markers HTTP/1.1\r\n" + HOST + b"Content-Length: 60000\r\n"
        b"Authorization: Bearer " + TOKEN.encode() + b"\r\n\r\n" + data * 1000
    )


def _socket() -> bytes:
    head = b"GET /api/v1/estimates?token=" + TOKEN.encode() + b" HTTP/1.1\r\n"
    return head + HOST + UPGRADE + b"\r\n"


def _hold(server: Process, name: str, data: bytes, n: int) -> Result:
    """Hold `n` connections that sent some bytes; another client must get its answer at once."""
    result = Result(name)
    memory, files = server.resident(), server.descriptors()
    with ExitStack() as stack:
        for k in range(n):
            one = stack.enter_context(socket.socket())
            one.settimeout(5.0)
            with suppress(OSError):
                one.connect(("127.0.0.1", server.port))
                one.sendall(data)
            if k % 20 == 0:
                result.timed(lambda: _ask(server))
        grown = server.resident() - memory
        result.note = (
            f"{n} held; {server.descriptors()} of 256 descriptors, {files} before; "
            f"memory +{grown:.0f} MB; log {server.log_size()} bytes"
        )
    return result


def _ask(server: Process) -> bool:
    request = urllib.request.Request(
        f"http://127.0.0.1:{server.port}/api/v1/state", headers={"Authorization": f"Bearer {TOKEN}"}
    )
    with urllib.request.urlopen(request, timeout=20) as answer:
        return isinstance(json.load(answer), dict)


DEEP = b"[" * 50_000
GET, POST = b"GET %b HTTP/1.1\r\n" + HOST, b"POST /api/v1/%b HTTP/1.1\r\n" + HOST
BEARER = b"Authorization: Bearer " + TOKEN.encode() + b"\r\n"


def _with_body(path: bytes, body: bytes) -> bytes:
    return POST % path + BEARER + b"Content-Length: %d\r\n\r\n" % len(body) + body


REQUESTS = [
    *(GET % path + b"\r\n" for path in (
        b"/", b"/none", b"/page/../../pyproject.toml", b"/page/%2e%2e/service.py", b"/web/",
        b"/page//etc/passwd", b"/api/v1/state", b"/api/v1/live", b"/%00", b"/%ff", b"*",
        b"/api/v1/info?token=%ff", b"/api/v1/info?token=" + b"x" * 6000, b"/" + b"a" * 9000,
    )),
    *(GET % b"/api/v1/info" + b"Authorization: " + one + b"\r\n\r\n" for one in (
        b"Bearer s\xc3\xa9cret", b"Bearer \xff", b"Basic YTpi", b"Bearer", b"Bearer " + b"x" * 5000,
    )),
    *(GET % b"/" + one + b"\r\n\r\n" for one in (
        b"Origin: http://evil.example", b"Origin: \xff", b"Host: evil", b"Content-Length: x",
        b"Content-Length: 5\r\nTransfer-Encoding: chunked", b"Transfer-Encoding: odd",
        b"Expect: 100-continue", b"Upgrade: h2c\r\nConnection: Upgrade", b"Range: bytes=9-1",
        b"If-Modified-Since: \xff", b"Cookie: " + b"a=b; " * 1000, b"A" * 9000 + b": b",
    )),
    *(_with_body(path, body) for path in (b"markers", b"recording", b"tare", b"none") for body in (
        DEEP, b'{"text": ' + DEEP, b'{"name": ' + DEEP, b"\xff", b"{}", b'{"text": 5}',
        b"x" * 70_000, b'{"name": "../../x"}', b'{"text": "\\ud800"}',
    )),
    b"GET / HTTP/9.9\r\n\r\n", b"\x16\x03\x01\x02\x00\x01", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    b"DELETE /api/v1/recording HTTP/1.1\r\n" + HOST + BEARER + b"\r\n",
    b"\r\n\r\n\r\n", b"\x00" * 99,
]  # fmt: skip
"""Requests that are not valid, or not allowed."""


def _requests(server: Process) -> Result:
    result = Result("serve: odd requests")
    for data in REQUESTS:
        result.timed(lambda d=data: _send(server, d, result))
    result.note = result.note or f"log {server.log_size()} bytes"
    return result


def _send(server: Process, data: bytes, result: Result) -> bool:
    """Send a request; return whether its status is below 400."""
    with socket.create_connection(("127.0.0.1", server.port), 5.0) as one:
        one.settimeout(0.5)
        head = b""
        with suppress(OSError):
            one.sendall(data)
            while b"\r\n\r\n" not in head and (more := one.recv(65536)):
                head = (head + more).removeprefix(b"HTTP/1.1 100 Continue\r\n\r\n")
    if not head:
        return False
    status = int(head.split()[1])
    result.n_wrong += SECURE not in head
    if status >= 500:
        raise RuntimeError(f"status {status} for {data[:60]!r}")
    return status < 400


def attack_play(clients: int, seconds: float) -> Result:
    """Clients of `play` that never read; memory stays bounded, and a good client loses nothing."""
    result = Result(
        "play: clients that never read", limit=2.0
    )  # a repeated recording pauses for 1 s
    with recording() as path, running("play", path, "--whole-hand", descriptors=512) as server:
        with ExitStack() as stack:
            source = stack.enter_context(open_source(f"xela://127.0.0.1:{server.port}"))
            before, most = server.resident(), 0.0
            for _ in range(clients):
                one = stack.enter_context(socket.socket())
                one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                one.connect(("127.0.0.1", server.port))
                one.sendall(b"GET / HTTP/1.1\r\n" + HOST + UPGRADE + b"\r\n")
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                result.timed(lambda: _read_one(source, result))
                most = max(most, server.resident() - before)
        result.note = f"{clients} clients for {seconds:.0f} s; memory +{most:.0f} MB at most"
    return result


def _read_one(source: Source, result: Result) -> bool:
    arrival = source.read(1.0)
    if arrival is not None:
        result.n_wrong += arrival.n_lost
    return arrival is not None
