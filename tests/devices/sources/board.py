"""A board of magnetometers at a pseudo terminal, like that of a real board."""

import os
import select
import threading
import tty

import numpy as np


def packet(sample, temperature=25.0):
    """A binary packet of a sample (n_mags, 3)."""
    rows = np.column_stack([np.full(len(sample), temperature), sample])
    return rows.astype("<f4").tobytes() + b"\r\n"


def some(n, n_mags=5, seed=0):
    """(n, n_mags, 3) readings."""
    rng = np.random.default_rng(seed)
    return rng.normal(0, 300, (n, n_mags, 3)).astype(np.float32)


class Board:
    """A board that sends the bytes of a test. Its path is the same after it is plugged in again."""

    def __init__(self, folder):
        self.path = folder / "ttyACM0"
        self._stop = threading.Event()
        self._thread = None
        self.plug()

    def plug(self):
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path.symlink_to(os.ttyname(self._slave))

    def unplug(self):
        self.hush()
        self.path.unlink()
        os.close(self._slave)
        os.close(self._master)

    def send(self, *parts):
        for part in parts:
            left = part
            while left:
                try:
                    left = left[os.write(self._master, left) :]
                except BlockingIOError:  # the buffer is full
                    ready = select.select([], [self._master], [], 0.05)[1]
                    if not ready and self._stop.is_set():
                        return

    def keep_sending(self, parts, period=0.005):
        """Sends each part, one after the other, until `hush`."""

        def work():
            for part in parts:
                self.send(part)
                if self._stop.wait(period):
                    return

        self._stop.clear()
        self._thread = threading.Thread(target=work)
        self._thread.start()

    def hush(self):
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
