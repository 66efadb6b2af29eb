"""`holdfast hold`: control the grip force of a hand by the estimates of a source."""

import math
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import (
    DetectorOptions,
    IgnoreOption,
    JsonOption,
    ModelArgument,
    SecondsOption,
    SourceArgument,
    SpeedOption,
    StartOptions,
    check_seconds,
)
from holdfast.cli.terminal.console import print_line, print_message
from holdfast.cli.terminal.control import StopRequest, handle_stop_signals
from holdfast_grip.options import (
    GripSettings,
    check_armed,
    connect_hand,
    find_source_and_hand,
    open_loop,
)

if TYPE_CHECKING:
    from holdfast.devices.sources import Source
    from holdfast.live.recorder import Recorder
    from holdfast.live.session import Session
    from holdfast.live.stream_detector import StreamUpdate
    from holdfast_grip import GripCommand
    from holdfast_grip.loop.grip_loop import GripLoop


def hold(
    model: ModelArgument,
    source: SourceArgument,
    settings: GripSettings,
    *,
    record: Annotated[
        Path | None, typer.Option("--record", help="Record samples and the log to NAME.mcap.")
    ] = None,
    seconds: SecondsOption = None,
    speed: SpeedOption = 1.0,
    ignore: IgnoreOption = "",
    start: StartOptions,
    as_json: JsonOption = False,
) -> None:
    r"""Control the grip force of a hand by the estimates of a source.

    The loop begins when the hand holds something and has been STABLE for 0.2 s. Without --armed
    nothing is sent. With it, a second process watches this one, and brings the hand into its
    safe state if it dies. With SOURCE twin:... and --hand twin:, the twin is both.

    Hands on topics of ROS 2 (no ROS needed): ros2:plexus, ros2:v4, ros2:v5, ros2:v5-envelop,
    ros2:controller, ros2:gripper and ros2:width-gripper. Of ROS 1 (with rospy): ros1:positions,
    ros1:efforts, ros1:envelop, ros1:gripper and ros1:width-gripper. Another program closes the
    hand; the loop takes over when the grip begins.
    docs/hands.md has their topics and parameters. With --json, each new command is a line of JSON.

    No command was ever tried on a real hand: read docs/grip.md first.

    Example:
      holdfast hold builtin:twin twin:?object=can --hand twin: --armed --speed 0
      holdfast hold builtin:any xela://auto --hand log:commands.jsonl
      holdfast hold model.json xela://auto --hand call:my_gripper:set_force \
        --armed --confirm call:my_gripper:set_force \
        --max-scale 1.2 --on-fault open
      holdfast hold builtin:any xela://auto \
        --hand "ros2:plexus?effort=0.1&max_effort=0.3"
    """
    from holdfast.live.session import Session

    settings.check()
    check_seconds(seconds)
    options = DetectorOptions(ignore=ignore)
    loaded = options.load_model(model)
    opened, commanded = find_source_and_hand(source, settings.hand, speed=speed)
    check_armed(settings)
    with ExitStack() as stack:
        stop = stack.enter_context(handle_stop_signals())
        watchdog = connect_hand(stack, settings, commanded)
        stack.enter_context(opened)
        stream = options.create_stream(loaded, opened, start)
        log = _new_log(stack, record, opened, as_json=as_json)
        session = stack.enter_context(Session(stream))  # ends after the loop, which reads it
        loop = stack.enter_context(open_loop(settings, commanded, stream, watchdog, log.event))
        stop.graceful = True
        _run(loop, session, log, seconds, stop)
    _report(loop, settings)


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

    def update(self, update: "StreamUpdate", *, wait: bool = False) -> None:
        """Record the samples, and print the notices of the source; a listener of a session."""
        if update.arrival is None:
            return
        for notice in update.arrival.notices:
            print_message(notice)
        if self._recorder is not None:
            self._recorder.put(update.arrival, wait=wait)

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


def _run(
    loop: "GripLoop", session: "Session", log: _Log, seconds: float | None, stop: StopRequest
) -> None:
    """Step the loop until the source ends, the time is over, or Ctrl-C."""
    from holdfast_grip.loop.runner import LoopRunner

    source = session.source
    runner = LoopRunner(loop, source.speed if source.paced else 0.0, log.command)
    end = math.inf if seconds is None else time.monotonic() + seconds

    def is_over() -> bool:
        return stop.requested or time.monotonic() >= end

    if not source.paced:
        # Read the source and step the loop in turn, so that the same seed gives the same
        # commands.
        stream = session.stream
        while not (is_over() or stream.source.ended):
            update = stream.read()
            log.update(update, wait=True)
            runner.process(update)
        runner.process(stream.finish())
        return
    # Reads of the source may block for longer than the loop may wait.
    session.add_listener(log.update)
    session.add_listener(runner.put)
    session.start()
    runner.run(lambda: session.ended or is_over())
    if session.failure is not None:
        raise session.failure


def _report(loop: "GripLoop", settings: GripSettings) -> None:
    hand, state = settings.hand, loop.controller.state
    if not settings.armed:
        print_message(f"dry run: nothing was sent to {hand}; the loop ended in {state}")
        return
    print_message(
        f"{loop.n_sent} commands sent to {hand}; the loop ended in {state}, and the hand keeps "
        "its last command"
    )
