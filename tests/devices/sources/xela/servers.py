"""Servers that send the messages of a test."""

import logging
import socket
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Thread

from websockets.exceptions import ConnectionClosed
from websockets.protocol import State
from websockets.sync.server import serve

LOGGER = logging.getLogger("holdfast.devices.sources.xela")
HANG_UP = object()
"""Message that makes the server close a connection."""


@contextmanager
def server(first=(), *, port=0, broken=False):
    """A server at a port, and a queue of its messages after `first` to each client.

    Args:
        first: sent to every client at once.
        port: 0 for any free port.
        broken: it closes each connection at once.
    """
    queue = SimpleQueue()

    def send(connection):
        try:
            for message in first:
                connection.send(message)
            while not broken and (message := queue.get()) is not HANG_UP:
                if connection.state is not State.OPEN:  # it is for the next client
                    queue.put(message)
                    return
                connection.send(message, text=True)  # bytes too, be they no UTF-8
        except ConnectionClosed:
            pass

    with serve(send, "127.0.0.1", port, compression=None, close_timeout=1, logger=LOGGER) as one:
        thread = Thread(target=one.serve_forever)
        thread.start()
        try:
            yield one.socket.getsockname()[1], queue
        finally:
            for _ in range(20):
                queue.put(HANG_UP)
            one.shutdown()
            thread.join()


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]
