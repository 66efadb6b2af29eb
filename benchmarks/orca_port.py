"""An ORCA Touch hand of five fingers at 1 kHz through a pseudo-terminal: frames lost, and CPU time.

Another process acts as the hand. This process opens `orca:` and reads every frame; its CPU time is
given as a share of one core.

    uv run python benchmarks/orca_port.py --seconds 30
"""

import argparse
import json
import os
import subprocess
import sys
import time
import tty
from contextlib import suppress

import numpy as np

from holdfast.devices.sources import open_source
from holdfast.devices.sources.orca_frames import OrcaHand

FINGERS = {"thumb": 51, "index": 87, "middle": 87, "ring": 87, "pinky": 51}
RATE = 1000.0
"""Frames per second [Hz]."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--hand", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.hand:
        act_as_hand()
        return
    command = [sys.executable, __file__, "--hand"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as hand:
        path = hand.stdout.readline().strip() if hand.stdout else ""
        try:
            print(json.dumps(measure(path, options.seconds), indent=1))
        finally:
            hand.kill()


def measure(path: str, seconds: float) -> dict[str, float]:
    """Read the frames, whose first taxel counts them modulo 256."""
    counts: list[int] = []
    n_lost = n_refused = 0
    with open_source(f"orca://{path}") as source:
        cpu, start = time.process_time(), time.monotonic()
        while time.monotonic() - start < seconds:
            arrival = source.read(0.5)
            if arrival is not None:
                n_lost, n_refused = n_lost + arrival.n_lost, n_refused + arrival.n_refused
                if arrival.samples:
                    counts.append(round(10 * arrival.samples["thumb"][0, 2]))
        passed = time.monotonic() - start
        share = (time.process_time() - cpu) / passed
    missing = int(((np.diff(counts) - 1) % 256).sum())
    return {
        "rate": round(len(counts) / passed, 1), "missing": missing, "n_lost": n_lost,
        "n_refused": n_refused, "share_of_a_core": round(share, 3),
    }  # fmt: skip


def act_as_hand() -> None:
    """Answer requests, and send frames until killed."""
    hand = OrcaHand(FINGERS)
    line, host = os.openpty()
    tty.setraw(host)
    os.set_blocking(line, False)
    print(os.ttyname(host), flush=True)
    rng = np.random.default_rng(0)
    frames = []
    for count in range(256):
        forces = {name: 0.1 * rng.integers(0, 9, (n, 3)) for name, n in FINGERS.items()}
        forces["thumb"][0, 2] = 0.1 * count
        frames.append(hand.frame(forces))
    due, n = time.monotonic(), 0
    while True:
        with suppress(BlockingIOError):
            _send(line, hand.feed(os.read(line, 4096)))
        if not hand.is_streaming:
            due = time.monotonic()
        due += 1 / RATE
        time.sleep(max(due - time.monotonic(), 0.0))
        if hand.is_streaming:
            _send(line, frames[n % 256])
            n += 1


def _send(line: int, data: bytes) -> None:
    while data:
        try:
            data = data[os.write(line, data) :]
        except BlockingIOError:
            time.sleep(1e-4)


if __name__ == "__main__":
    main()
