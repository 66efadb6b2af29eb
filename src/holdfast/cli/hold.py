"""`holdfast hold`: control the grip force of a hand by the estimates of a source."""

import math
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from enum import StrEnum
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import (
    IgnoreOption,
    ModelArgument,
    RatePolicy,
    SourceArgument,
    SpeedOption,
    create_stream_detector,
    load_model,
)
from holdfast.cli.terminal.console import print_line, print_message
from holdfast.cli.terminal.stopping import StopRequest, handle_stop_signals

if TYPE_CHECKING:
    from holdfast.contact import HandEstimate
    from holdfast.control import GripCommand, GripController, Limits
    from holdfast.control.hands import Hand
    from holdfast.control.loop import GripLoop
    from holdfast.control.watchdog import Watchdog
    from holdfast.live.recorder import Recorder
    from holdfast.live.session import Session
    from holdfast.live.stream_detector import StreamDetector, StreamUpdate
    from holdfast.sources import Source


class FaultAction(StrEnum):
    """What the hand does in a fault."""

    HOLD = "hold"
    OPEN = "open"


TICK = 0.01
"""Time without samples after which the loop is updated, so that it notices silence [s]."""
TWIN = "twin:"


def hold(
    model: ModelArgument,
    source: SourceArgument,
    hand: Annotated[
        str,
        typer.Option(
            "--hand",
            help="URI of the hand: twin:, ros2:KIND?..., ros1:KIND?..., log:PATH or "
            "call:MODULE:FUNCTION.",
        ),
    ],
    law: Annotated[str, typer.Option("--law", help="Law of grip force.")] = "holdfast",
    armed: Annotated[
        bool, typer.Option("--armed", help="Send commands; without it, this is a dry run.")
    ] = False,
    confirm: Annotated[
        str, typer.Option("--confirm", help="URI of the hand again, with --armed.")
    ] = "",
    max_scale: Annotated[
        float, typer.Option("--max-scale", help="Largest multiple of the first force.")
    ] = 2.0,
    min_scale: Annotated[
        float, typer.Option("--min-scale", help="Smallest multiple of the first force.")
    ] = 1.0,
    max_force: Annotated[
        float | None,
        typer.Option(
            "--max-force",
            help="Largest normal force of a finger [unit of the readings, or N with --newtons].",
            show_default="no limit",
        ),
    ] = None,
    on_fault: Annotated[
        FaultAction, typer.Option("--on-fault", help="What the hand does in a fault.")
    ] = FaultAction.HOLD,
    newtons: Annotated[
        float | None,
        typer.Option("--newtons", help="Calibration: newtons for each unit of the readings."),
    ] = None,
    record: Annotated[
        Path | None, typer.Option("--record", help="Record samples and the log to NAME.mcap.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Stop after this time [s].")] = None,
    speed: SpeedOption = 1.0,
    ignore: IgnoreOption = "",
    as_json: Annotated[
        bool, typer.Option("--json", help="Print each new command as a line of JSON.")
    ] = False,
) -> None:
    r"""Control the grip force of a hand by the estimates of a source.

    The loop begins when the hand holds something and has been STABLE for 0.2 s. Without --armed
    nothing is sent. With it, a second process watches this one, and brings the hand into its
    safe state if it dies. With SOURCE twin:... and --hand twin:, the twin is both.

    Hands on topics of ROS 2 (no ROS needed): ros2:plexus, ros2:v4, ros2:v5, ros2:v5-envelop and
    ros2:gripper. Of ROS 1 (with rospy): ros1:positions, ros1:efforts, ros1:envelop and
    ros1:gripper. Another program closes the hand; the loop takes over when the grip begins.
    docs/grip.md has their topics and parameters.

    No command was ever tried on a real hand: read docs/grip.md first.

    Example:
      holdfast hold builtin:twin "twin:?object=can&seed=1" --hand twin: --armed --speed 0
      holdfast hold builtin:any xela://auto --hand log:commands.jsonl
      holdfast hold model.json xela://auto --hand call:my_gripper:set_force --armed \
        --confirm call:my_gripper:set_force --max-scale 1.2 --on-fault open
      holdfast hold builtin:any xela://auto --hand "ros2:plexus?effort=0.1&max_effort=0.2"
    """
    from holdfast.control import GripController, Limits

    limits = Limits(min_scale=min_scale, max_scale=max_scale, max_force=max_force,
                    on_fault=on_fault.value)  # fmt: skip
    if seconds is not None and not seconds > 0:
        raise ValueError(f"--seconds: more than 0 s expected, {seconds:g} given")
    loaded = load_model(model, None, None)
    opened, commanded = _open(source, hand, speed)
    _check_armed(hand, armed, confirm)
    with ExitStack() as stack:
        stop = stack.enter_context(handle_stop_signals())
        watchdog = _connect(stack, commanded, limits) if armed and hand != TWIN else None
        stack.enter_context(opened)
        stream = create_stream_detector(loaded, opened, RatePolicy.RESAMPLE, ignore)
        controller = GripController(limits, law, sensors=stream.fingers, newtons_per_unit=newtons)
        commanded.check(limits, stream.fingers)
        log = _new_log(stack, record, opened, as_json=as_json)
        updates = stack.enter_context(_reading(stream, threaded=opened.paced))
        loop = _new_loop(stack, controller, commanded, log, watchdog, armed=armed)
        stop.graceful = True
        _run(loop, _until(updates, seconds, stop), log, paced=opened.paced)
    _report(loop, hand, armed=armed)


def _open(source: str, hand: str, speed: float) -> "tuple[Source, Hand]":
    """Return source and hand, the same object if both are the twin."""
    from holdfast.control.hands import open_hand
    from holdfast.control.live_twin import LiveTwin
    from holdfast.sources import open_source

    if hand == TWIN:
        if not source.startswith(TWIN):
            raise ValueError(f"--hand twin: needs the source twin:..., {source} given")
        twin = LiveTwin(source, speed=speed)
        return twin, twin
    return open_source(source, speed=speed), open_hand(hand)


def _check_armed(hand: str, armed: bool, confirm: str) -> None:
    """Check that a hand that moves was named twice."""
    if not armed or hand in (TWIN, confirm):
        return
    if not confirm and sys.stdin.isatty():
        confirm = typer.prompt(f"This moves a hand. Type its URI ({hand})", err=True)
    if confirm != hand:
        raise ValueError(f"--armed moves the hand: confirm it with --confirm {hand}")


class _Log:
    """Log of the loop: lines on the terminal, and markers of the recording."""

    def __init__(self, recorder: "Recorder | None", *, as_json: bool) -> None:
        self._recorder = recorder
        self._as_json = as_json
        self._last: GripCommand | None = None

    def event(self, text: str, at: float) -> None:
        """Log an event of the loop."""
        if self._recorder is not None:
            self._recorder.add_marker(text, at)
        if not self._as_json:
            print_line(f"{at:10.3f} s  {text}")

    def update(self, update: "StreamUpdate", *, paced: bool) -> None:
        """Record the samples, and print the notices of the source."""
        if update.arrival is None:
            return
        for notice in update.arrival.notices:
            print_message(notice)
        if self._recorder is not None:
            self._recorder.put(update.arrival, wait=not paced)

    def command(self, command: "GripCommand") -> None:
        """Print a command that differs from the last one."""
        last, self._last = self._last, command
        changed = last is None or (last.state, last.fingers) != (command.state, command.fingers)
        if self._as_json and changed:
            import msgspec

            print_line(msgspec.json.encode(command).decode())


def _new_log(stack: ExitStack, record: Path | None, source: "Source", *, as_json: bool) -> _Log:
    if record is None:
        return _Log(None, as_json=as_json)
    from holdfast.live.recorder import Recorder

    if record.suffix != ".mcap":
        raise ValueError(f"--record: NAME.mcap expected, {record} given")
    recorder = Recorder(record, source.sensors, metadata=dict(source.metadata))
    return _Log(stack.enter_context(recorder), as_json=as_json)


def _connect(stack: ExitStack, hand: "Hand", limits: "Limits") -> "Watchdog":
    """Connect to the hand, and start its watchdog, which takes the longest time.

    It is done before the source is opened, so that no samples wait for it.
    """
    from holdfast.control.hands import Claim
    from holdfast.control.watchdog import Watchdog

    stack.enter_context(Claim(hand.resource))
    stack.enter_context(hand)
    watchdog = Watchdog(hand.name, limits.on_fault)
    stack.callback(watchdog.kill)
    watchdog.start()
    return watchdog


def _new_loop(
    stack: ExitStack,
    controller: "GripController",
    hand: "Hand",
    log: _Log,
    watchdog: "Watchdog | None",
    *,
    armed: bool,
) -> "GripLoop":
    """Return the loop. At its end, the watchdog ends at once, before anything else closes."""
    from holdfast.control.loop import GripLoop

    if watchdog is not None:
        stack.push(watchdog)
    loop = GripLoop(controller, hand, armed=armed, watchdog=watchdog, log=log.event)
    return stack.enter_context(loop)


def _run(
    loop: "GripLoop", updates: "Iterator[StreamUpdate | None]", log: _Log, *, paced: bool
) -> None:
    """Step the loop with every estimate, and with the last one while nothing arrives."""
    last: HandEstimate | None = None
    received = time.monotonic()
    for update in updates:
        if update is not None:
            log.update(update, paced=paced)
        estimates = update.estimates if update is not None else []
        for one in estimates:
            last, received = one.estimate, time.monotonic()
            log.command(loop.step(last, last.time))
        if last is not None and not estimates and paced:
            log.command(loop.step(last, last.time + time.monotonic() - received))


def _until(
    updates: "Iterator[StreamUpdate | None]", seconds: float | None, stop: StopRequest
) -> "Iterator[StreamUpdate | None]":
    """Yield the updates until the time is over or the user stops."""
    end = math.inf if seconds is None else time.monotonic() + seconds
    for update in updates:
        if stop.requested or time.monotonic() >= end:
            return
        yield update


@contextmanager
def _reading(
    stream: "StreamDetector", *, threaded: bool
) -> "Iterator[Iterator[StreamUpdate | None]]":
    """Yield what the source sends; with a thread, None after `TICK` without anything.

    A read of a silent device may take longer than a heartbeat of the watchdog, so it must not
    delay the loop: neither while it runs nor at its end.
    """
    if not threaded:
        yield _direct(stream)
        return
    from holdfast.live.session import Session

    queue: SimpleQueue[StreamUpdate] = SimpleQueue()
    session = Session(stream)
    session.add_listener(queue.put)
    session.start()
    try:
        yield _queued(session, queue)
    finally:
        session.stop()


def _direct(stream: "StreamDetector") -> "Iterator[StreamUpdate]":
    while not stream.source.ended:
        yield stream.read()
    yield stream.finish()


def _queued(
    session: "Session", queue: "SimpleQueue[StreamUpdate]"
) -> "Iterator[StreamUpdate | None]":
    while not (session.ended and queue.empty()):
        try:
            yield queue.get(timeout=TICK)
        except Empty:
            yield None
    if session.failure is not None:
        raise session.failure


def _report(loop: "GripLoop", hand: str, *, armed: bool) -> None:
    state = loop.controller.state
    if not armed:
        print_message(f"dry run: nothing was sent to {hand}; the loop ended in {state}")
        return
    print_message(
        f"{loop.n_sent} commands sent to {hand}; the loop ended in {state}, and the hand keeps "
        "its last command"
    )
