"""A server of files on loopback that can do what servers on the internet do wrong."""

from contextlib import contextmanager
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.parse import unquote


class FileServer:
    """A server of a folder.

    Attributes:
        requests: path of each request.
        cut_after: number of bytes after which the next answers end, one for each answer.
        status: of all answers, in place of a file.
        replaced: content by path, in place of that of the folder.
    """

    def __init__(self, folder):
        self.folder = folder
        self.requests, self.cut_after = [], []
        self.status, self.replaced, self.url = None, {}, ""


class _Handler(BaseHTTPRequestHandler):
    def __init__(self, state, *given):
        self.state = state
        super().__init__(*given)

    def do_GET(self):
        state, path = self.state, unquote(self.path).lstrip("/")
        state.requests.append(path)
        file = state.folder / path
        data = state.replaced.get(path) or (file.read_bytes() if file.is_file() else None)
        if data is None or state.status:
            self.send_error(state.status or 404)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        end = state.cut_after.pop(0) if state.cut_after else len(data)
        self.wfile.write(data[:end])

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
