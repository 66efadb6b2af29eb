"""`holdfast hold`: control the grip force of a hand by the estimates of a source."""

import math
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.options import (
    DetectorOptions,
    IgnoreOption,
    JsonOption,
    ModelArgument,
    SecondsOption,
    SpeedOption,
    StartOptions,
    check_seconds,
    check_source,
)
from holdfast.cli.terminal.console import print_message
from holdfast.cli.terminal.control import handle_stop_signals
from holdfast_grip.options import (
    TWIN,
    GripSettings,
    check_armed,
    connect_hand,
    find_source_and_hand,
    open_loop,
)


def hold(
    model: ModelArgument,
    source: Annotated[
        str | None,
        typer.Argument(
            help="Path of a recording, or URI of a source (see above). "
            "Without MODEL: twin:..., which builtin:twin was trained on.",
            callback=check_source,
        ),
    ] = None,
    *,
    settings: GripSettings,
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

    The loop begins when the hand holds something and has been STABLE for 0.4 s. Without --armed
    nothing is sent. With it, a second process watches this one, and brings the hand into its
    safe state if it dies. With SOURCE twin:... and --hand twin:, the twin is both.

    Hands on topics of ROS 2 (no ROS needed): ros2:plexus, ros2:v4, ros2:v5, ros2:v5-envelop,
    ros2:controller, ros2:gripper and ros2:width-gripper. Another program closes the hand; the
    loop takes over when the grip begins.
    docs/hands.md has their topics and parameters. With --json, each new command is a line of JSON.

    MODEL is one that was taught on this hand (holdfast teach). builtin:any reports no slip until
    then, so the force rises by instability alone.

    No command was ever tried on a real hand: read docs/grip.md first.

    Example:
      holdfast hold twin:?object=can --hand twin: --armed --speed 0
      holdfast hold taught.json xela://auto --hand log:commands.jsonl
      holdfast hold taught.json xela://auto --hand call:my_gripper:set_force \
        --armed --confirm call:my_gripper:set_force \
        --max-scale 1.2 --on-fault open
      holdfast hold taught.json xela://auto \
        --hand "ros2:plexus?effort=0.1&max_effort=0.3"
    """
    from holdfast.live.session import Session
    from holdfast_grip.hold_log import HoldLog
    from holdfast_grip.loop.runner import LoopRunner, run_session

    settings.check()
    check_seconds(seconds)
    if source is None:
        if not model.startswith(TWIN):
            raise ValueError(
                f"{model} given; MODEL SOURCE expected, with a model that was taught on this hand "
                "(holdfast teach), or twin:... alone"
            )
        model, source = "builtin:twin", model
    options = DetectorOptions(ignore=ignore)
    loaded = options.load_model(model)
    opened, commanded = find_source_and_hand(source, settings.hand, speed=speed)
    check_armed(settings)
    with ExitStack() as stack:
        stop = stack.enter_context(handle_stop_signals())
        watchdog = connect_hand(stack, settings, commanded)
        stack.enter_context(opened)
        stream = options.create_stream(loaded, opened, start)
        log = HoldLog.open(stack, record, opened, as_json=as_json)
        session = stack.enter_context(Session(stream))  # ends after the loop, which reads it
        loop = stack.enter_context(open_loop(settings, commanded, stream, watchdog, log.event))
        stop.graceful = True
        runner = LoopRunner(loop, opened.speed if opened.paced else 0.0, log.command)
        end = math.inf if seconds is None else time.monotonic() + seconds
        run_session(runner, session, log.update, lambda: stop.requested or time.monotonic() >= end)
    hand, state = settings.hand, loop.controller.state
    if not settings.armed:
        print_message(f"dry run: nothing was sent to {hand}; the loop ended in {state}")
        return
    print_message(
        f"{loop.n_sent} commands sent to {hand}; the loop ended in {state}, and the hand keeps "
        "its last command"
    )
