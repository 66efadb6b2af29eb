"""Attacks on the grip loop: clocks, estimates, bursts, pauses of its processes."""

import math
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec

from attack.result import Result
from holdfast.contact import ContactEstimate, ContactState, HandEstimate, Reason
from holdfast.live.stream_detector import StreamEstimate, StreamUpdate
from holdfast_grip import GripCommand, GripController, GripReason, Limits, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.hands import HandDevice, open_hand
from holdfast_grip.loop.grip_loop import GripLoop
from holdfast_grip.loop.runner import LoopRunner
from holdfast_grip.loop.watchdog import Watchdog

BENCHMARKS = Path(__file__).parents[1]
RATE = 150.0
FINGERS = ("thumb", "index", "middle")
TIMES = (math.nan, math.inf, -math.inf, 100.0, -100.0, 1e11, 0.3, -0.3)
"""Steps of a clock that a fault adds to the time [s]."""
N_STEPS = 200
HOSTILE_SHARE = 0.8
"""Share of the runs with faults."""
PATIENCE = 60.0
"""A process that takes longer counts as slow [s]."""
PAUSES = (0.05, 0.4)
"""Shortest and longest pause of a process [s]."""


class Tape(HandDevice):
    """Hand that keeps its commands."""

    name = "tape:"

    def __init__(self) -> None:
        self.commands: list[GripCommand] = []

    def open(self) -> None:
        """Do nothing."""

    def _send(self, command: GripCommand) -> None:
        self.commands.append(command)

    def close(self) -> None:
        """Do nothing."""


def attacks(scale: float) -> Iterator[Result]:
    """Yield the results of all attacks."""

    def n(full: int) -> int:
        return max(round(scale * full), 2)

    yield attack_clock(n(3000))
    yield attack_bursts(n(1000))
    yield attack_pauses(n(100))
    yield attack_watchdogs(n(20))


def attack_clock(n: int) -> Result:
    """Give a loop stamps that jump and numbers that are none, then reset it.

    Wrong: a command without a finite time or beyond the limits, or no HOLD after the reset.
    """
    result = Result("grip: clocks and numbers")
    for seed in range(n):
        result.timed(lambda seed=seed: _fuzzed(random.Random(seed), result))
    return result


def attack_bursts(n: int) -> Result:
    """Give a runner many updates at once, with a fault or a slip among them.

    Wrong: more than one command for a burst, or a fault or slip without effect.
    """
    result = Result("grip: bursts")
    for seed in range(n):
        result.timed(lambda seed=seed: _burst(random.Random(seed), result))
    return result


def attack_pauses(n: int) -> Result:
    """Stop the process of a loop for a while.

    Wrong: a command after the first of the watchdog that does not open the hand.
    """
    result = Result("grip: paused loops", limit=PATIENCE)
    for seed in range(n):
        result.timed(lambda seed=seed: _paused(random.Random(seed), result))
    return result


def attack_watchdogs(n: int) -> Result:
    """Stop the process of a watchdog.

    Wrong: the loop goes on without it, or its last command does not open the hand.
    """
    result = Result("grip: stopped watchdogs", limit=PATIENCE)
    for _ in range(n):
        result.timed(lambda: _without_watchdog(result), HandError)
    return result


def _hand(at: float, *, slips: bool = False, force: float = 1000.0) -> HandEstimate:
    state = ContactState.UNSTABLE if slips else ContactState.STABLE
    probability = 0.05 if slips else 0.95
    estimate = ContactEstimate(at, state, Reason.NONE, probability, 1.0, (force, 300.0, 0.0))
    return HandEstimate(at, ContactState.STABLE, dict.fromkeys(FINGERS, estimate))


def _held(hand: HandDevice, on_fault: str = "open", **parts: object) -> tuple[GripLoop, float]:
    """Return an armed loop that holds an object, and its time."""
    controller = GripController(Limits(on_fault=on_fault, recovery=0.1))  # type: ignore[arg-type]
    loop = GripLoop(controller, hand, armed=True, **parts)  # type: ignore[arg-type]
    at = 0.0
    while controller.state is LoopState.IDLE:
        at += 1 / RATE
        loop.follow(_hand(at), at)
    return loop, at


def _fuzzed(rng: random.Random, result: Result) -> bool:
    tape = Tape()
    loop, at = _held(tape, rng.choice(["hold", "open"]))
    faulty, hostile = False, rng.random() < HOSTILE_SHARE
    for _ in range(N_STEPS):
        at += 1 / RATE
        stamp, force = at, 1000.0 + rng.random()
        if hostile and rng.random() < 0.02:
            stamp += rng.choice(TIMES)
            at = stamp if rng.random() < 0.5 and math.isfinite(stamp) else at
        if hostile and rng.random() < 0.01:
            force = rng.choice([math.nan, math.inf, -1e300])
        state = loop.step(_hand(stamp, slips=rng.random() < 0.2, force=force), stamp).state
        faulty = faulty or state is LoopState.FAULT
    result.n_wrong += any(not _is_valid(command) for command in tape.commands)
    loop.resume()
    for _ in range(60):
        at += 1 / RATE
        loop.step(_hand(at), at)
    result.n_wrong += loop.last is None or loop.last.state is LoopState.FAULT
    return not faulty


def _is_valid(command: GripCommand) -> bool:
    limits = Limits()
    scales = [one.scale for one in command.fingers.values()]
    return math.isfinite(command.time) and all(
        limits.min_scale <= scale <= limits.max_scale for scale in scales
    )


def _burst(rng: random.Random, result: Result) -> bool:
    tape = Tape()
    loop, at = _held(tape)
    runner = LoopRunner(loop)
    kind, place, n = rng.choice(["", "slip", "fault"]), rng.randrange(5, 10), rng.randrange(15, 60)
    for k in range(n):
        at += 1 / RATE
        here = k == place
        force = math.nan if here and kind == "fault" else 1000.0 + k % 7
        estimate = _hand(at, slips=here and kind == "slip", force=force)
        runner.put(StreamUpdate(None, [StreamEstimate(estimate, FINGERS)], []))
    runner.run(lambda: True)
    last = tape.commands[-1]
    seen = {
        "": last.state is not LoopState.FAULT,
        "slip": any(one.scale > 1.0 for one in last.fingers.values()),
        "fault": last.release,
    }
    result.n_wrong += len(tape.commands) != 1 or not seen[kind]
    return last.state is not LoopState.FAULT


def _paused(rng: random.Random, result: Result) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hand"
        process = subprocess.Popen(
            [sys.executable, "-m", "attack.grip", str(path)], cwd=BENCHMARKS,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            if process.stdout is not None:
                process.stdout.readline()
            time.sleep(rng.uniform(0.05, 0.1))
            os.kill(process.pid, signal.SIGSTOP)
            time.sleep(rng.uniform(*PAUSES))
            os.kill(process.pid, signal.SIGCONT)
            time.sleep(0.3)
        finally:
            process.kill()
            process.communicate()
        time.sleep(0.5)  # the watchdog ends
        lines = path.read_bytes().splitlines()
    commands = [msgspec.json.decode(line, type=GripCommand) for line in lines]
    reasons = [command.reason for command in commands]
    if GripReason.WATCHDOG not in reasons:
        result.n_wrong += 1  # it takes over after the kill at the latest
        return False
    taken = commands[reasons.index(GripReason.WATCHDOG) :]
    result.n_wrong += not all(command.release for command in taken)
    return True


def _without_watchdog(result: Result) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hand"
        uri = f"log:{path}"
        try:
            with open_hand(uri) as hand, Watchdog(uri, "open", timeout=10.0) as watchdog:
                _run_loop(hand, watchdog, 10)
                os.kill(watchdog._process.pid, signal.SIGSTOP)
                _run_loop(hand, watchdog, 100_000)
                result.n_wrong += 1
        except HandError:
            last = msgspec.json.decode(path.read_bytes().splitlines()[-1], type=GripCommand)
            result.n_wrong += not last.release
            raise
    return True


def _run_loop(hand: HandDevice, watchdog: Watchdog, n_steps: int) -> None:
    """Step a loop at its rate; it leaves its grip to the next one."""
    loop, at = _held(hand, watchdog=watchdog)
    with loop:
        for _ in range(n_steps):
            at += 1 / RATE
            loop.step(_hand(at), at)
            time.sleep(1 / RATE)


def main(path: str) -> None:
    """Run a loop until it is killed; the program of the process that is stopped."""
    uri = f"log:{path}"
    with open_hand(uri) as hand, Watchdog(uri, "open") as watchdog:
        print("started", flush=True)
        _run_loop(hand, watchdog, 100_000)


if __name__ == "__main__":
    main(sys.argv[1])
