"""A server of files on loopback that can do what servers on the internet do wrong."""

import re
import time
from contextlib import contextmanager, suppress
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.parse import unquote


class FileServer:
    """A server of a folder.

    Attributes:
        requests: path and range of each request.
        cut_after: number of bytes after which the next answers end, one for each answer.
        ranges: whether parts of files are sent.
        status: of all answers, in place of a file.
        replaced: content by path, in place of that of the folder.
        headers: that replace those of all answers; one without a value is left out.
        slow: `headers` or `body` arrive a byte in 0.05 s, for at most 3 s.
    """

    def __init__(self, folder):
        self.folder = folder
        self.requests, self.cut_after, self.ranges = [], [], True
        self.status, self.replaced, self.url = None, {}, ""
        self.headers, self.slow = {}, ""


class _Handler(BaseHTTPRequestHandler):
    def __init__(self, state, *given):
        self.state = state
        super().__init__(*given)

    def do_GET(self):
        state, path = self.state, unquote(self.path).lstrip("/")
        wanted = re.fullmatch(r"bytes=(\d+)-", self.headers.get("Range", ""))
        start = int(wanted[1]) if wanted and state.ranges else 0
        state.requests.append((path, start))
        file = state.folder / path
        data = state.replaced.get(path) or (file.read_bytes() if file.is_file() else None)
        if data is None or state.status:
            self.send_error(state.status or 404)
            return
        if start > len(data):
            self.send_error(416)
            return
        if state.slow == "headers":
            self._drip(b"HTTP/1.0 200 OK\r\nX: " + b"x" * 60)
            return
        headers = {"Content-Length": str(len(data) - start)}
        if start:
            headers["Content-Range"] = f"bytes {start}-{len(data) - 1}/{len(data)}"
        headers |= state.headers
        status = 302 if "Location" in headers else 206 if start else 200
        self.send_response(status)
        for name, value in headers.items():
            if value is not None:
                self.send_header(name, value)
        self.end_headers()
        if state.slow == "body":
            self._drip(data)
            return
        end = state.cut_after.pop(0) if state.cut_after else len(data)
        self.wfile.write(data[start : start + end])

    def _drip(self, data):
        with suppress(OSError):
            for byte in data[:60]:
                self.wfile.write(bytes([byte]))
                time.sleep(0.05)

    def log_message(self, *given):
        """Print nothing."""


@contextmanager
def serving(folder):
    """Serve a folder; yield the `FileServer`."""
    state = FileServer(folder)
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Handler, state)) as server:
        state.url = f"http://127.0.0.1:{server.server_address[1]}"
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield state
        finally:
            server.shutdown()
            thread.join()
