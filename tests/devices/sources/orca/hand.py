"""Frames of an ORCA Touch hand, and a hand at a pseudo-terminal, without the code under test."""

import os
import struct
import threading
import time
import tty

import numpy as np

FINGERS = {"thumb": 51, "index": 87, "middle": 87, "ring": 87, "pinky": 51}
CONNECTED_BITS = {
    "thumb": (0, 2), "index": (0, 6), "middle": (1, 2), "ring": (1, 6), "pinky": (2, 2)
}  # fmt: skip
SLOTS = {name: slot for slot, name in enumerate(CONNECTED_BITS)}


def lrc(data):
    return data + bytes([(256 - sum(data)) % 256])


def response(function, address, data):
    return lrc(b"\xaa\x55\x00" + struct.pack("<BHH", function, address, len(data)) + data)


def touch_frame(data, error=0):
    return lrc(b"\xaa\x56\x00" + struct.pack("<HB", 1 + len(data), error) + data)


def encoder_frame(seed=0):
    body = b"\x00" + np.random.default_rng(seed).bytes(34)
    return lrc(b"\xaa\xa9\x00" + struct.pack("<H", len(body)) + body)


def some_frames(n, fingers=FINGERS, seed=0):
    """Frames and their forces (n, n_taxels, 3) [N]."""
    rng = np.random.default_rng(seed)
    counts = rng.integers((-128, -128, 0), (128, 128, 256), (n, sum(fingers.values()), 3))
    data = [b"".join(struct.pack("bbB", *taxel) for taxel in frame) for frame in counts.tolist()]
    return list(map(touch_frame, data)), 0.1 * counts


def answer(request, fingers=FINGERS):
    """The response to one of the client's requests."""
    function, address = struct.unpack("<BH", request[3:6])
    if function == 0x10:
        return response(function, address, b"\x00")
    if address == 0x10:
        connected = bytearray(4)
        for name in fingers:
            byte, bit = CONNECTED_BITS[name]
            connected[byte] |= 1 << bit
        return response(function, address, bytes(connected))
    counts = bytearray(56)
    for name, n_taxels in fingers.items():
        struct.pack_into("<H", counts, 4 + 8 * SLOTS[name], n_taxels)
    return response(function, address, bytes(counts))


class Hand(threading.Thread):
    """A hand that answers and streams frames, each for a period [s], until it is reset."""

    def __init__(self, frames, fingers=FINGERS, period=0.005):
        super().__init__(daemon=True)
        self.frames, self.fingers, self.period = iter(frames), fingers, period
        self.streams = False
        self.n_armed = 0
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self._stopping = threading.Event()
        self.start()

    def run(self):
        due = time.monotonic()
        while not self._stopping.is_set():
            try:
                request = os.read(self._master, 64)
            except BlockingIOError:
                request = b""
            if request:
                self.send(answer(request, self.fingers))
                if request[3:6] == b"\x10\x17\x00":
                    self.streams, due = True, time.monotonic()
                    self.n_armed += 1
            if self.streams and (frame := next(self.frames, None)) is not None:
                self.send(frame)
                due += self.period
            self._stopping.wait(max(due - time.monotonic(), 0.0) if self.streams else 0.005)

    def send(self, data):
        while data and not self._stopping.is_set():
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                time.sleep(0.001)

    def hush(self):
        self._stopping.set()
        self.join()

    def close(self):
        self.hush()
        os.close(self._master)
        os.close(self._slave)
