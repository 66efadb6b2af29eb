"""Servers that say what a test wants them to."""

import socket
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Thread

from websockets.exceptions import ConnectionClosed
from websockets.protocol import State
from websockets.sync.server import serve

from holdfast.sources.xela.client import _LOGGER

HANG_UP = object()
"""What makes a server end a connection."""


@contextmanager
def server(first=(), *, port=0, broken=False):
    """A server at a port, and a queue of what it says after `first` to whoever comes.

    Args:
        first: said to every client at once.
        port: 0 for any.
        broken: it hangs up at once, without a word.
    """
    said = SimpleQueue()

    def greet(connection):
        try:
            for word in first:
                connection.send(word)
            while not broken and (word := said.get()) is not HANG_UP:
                if connection.state is not State.OPEN:  # it is for whoever came after
                    said.put(word)
                    return
                connection.send(word, text=True)  # bytes too, be they no UTF-8
        except ConnectionClosed:
            pass

    with serve(greet, "127.0.0.1", port, compression=None, close_timeout=1, logger=_LOGGER) as one:
        thread = Thread(target=one.serve_forever)
        thread.start()
        try:
            yield one.socket.getsockname()[1], said
        finally:
            for _ in range(20):
                said.put(HANG_UP)
            one.shutdown()
            thread.join()


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]
