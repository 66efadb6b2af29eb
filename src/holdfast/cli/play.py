"""`holdfast play`: a simulated device that sends a recording or the twin."""

import sys
from contextlib import ExitStack, suppress
from typing import Annotated

import typer

from holdfast.cli.options import (
    LOCALHOST,
    RARE,
    HostOption,
    JsonOption,
    OnceOption,
    PortOption,
    SourceArgument,
    awaited,
    check_speed,
)
from holdfast.cli.terminal.console import message_if_slow, print_json, print_message
from holdfast.cli.terminal.control import handle_stop_signals
from holdfast.cli.terminal.progress import show_clients
from holdfast.errors import require_extras


def play(
    source: SourceArgument,
    *,
    version: Annotated[str, typer.Option(help="Version of the server: 1.7 or 1.8."), RARE] = "1.8",
    host: HostOption = LOCALHOST,
    port: PortOption = 5000,
    speed: Annotated[
        float,
        typer.Option(help="Speed: 1 is real time; at others, clients report faults of the clock."),
    ] = 1.0,
    once: OnceOption = False,
    whole_hand: Annotated[
        bool | None,
        typer.Option(
            "--whole-hand/--separate",
            help="Send the fingertips within the packet of a whole hand, or as sensors 1, 2, ...",
            show_default="whole hand if the modules have the names of an Allegro hand",
        ),
        RARE,
    ] = None,
    orca: Annotated[
        bool, typer.Option("--orca", help="Act as an ORCA Touch hand at a pseudo-terminal.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    r"""Send a recording or the twin as a XELA server or an ORCA Touch hand does.

    A program for xela_server receives the same packets over a WebSocket, in real time. Their
    times are those of the recording, shifted to now. The modules of an Allegro hand are sent as
    one sensor of 368 taxels, in which missing modules are at rest. Other modules, or all with
    --separate, are sent as sensors 1, 2, ... Readings in newtons are sent as calibrated values,
    with counts computed from a data sheet. With --json, the address is printed as JSON, and at
    the end the number of packets. Stop it with Ctrl-C.

    With --orca, a serial port is made, and a program that opens it gets the forces of the fingers
    as from an ORCA Touch hand, once it has requested them.

    SOURCE is the path of a recording, or twin:?object=can&seed=1. It begins when the first client
    connects. When another one connects, the next grasp of the twin begins for all clients (a
    recording begins again), so that each client can take its tare while nothing is touched. It is
    repeated, unless --once is given, which waits for a client and plays it once.

    Example:
      holdfast play twin:?object=can
      holdfast play grasp.parquet --once
      holdfast detect builtin:any xela://127.0.0.1:5000
      holdfast play "twin:?sensor=orca-finger" --orca
    """
    check_speed(source, speed)
    if not speed:
        raise ValueError(f"--speed: a speed above 0 expected, {speed:g} given")
    if source.startswith("twin:"):
        require_extras("twin", "parquet")
    with ExitStack() as stack:
        # The imports are inside: they are part of the wait.
        with message_if_slow(awaited(source)):
            from holdfast.devices.sources import open_source
            from holdfast.devices.sources.xela.encoder import is_part_of_hand
            from holdfast.live.publishers.orca_port import OrcaPort
            from holdfast.live.publishers.xela_server import XelaServer

            opened = stack.enter_context(open_source(source, speed=speed, loop=not once))
        server: XelaServer | OrcaPort
        if orca:
            server, what = OrcaPort(opened, restart=not once), "an ORCA Touch hand"
            modules = server.modules
        else:
            whole = is_part_of_hand(opened.sensors) if whole_hand is None else whole_hand
            server = XelaServer(
                opened, version=version, host=host, port=port, whole_hand=whole,
                wait=once, restart=not once,
            )  # fmt: skip
            what, modules = f"a XELA server {version}", server.encoder.modules
        with suppress(KeyboardInterrupt), handle_stop_signals(), server:  # Ctrl-C is the usual end
            if as_json:
                names = {str(number): list(names) for number, names in modules.items()}
                print_json(
                    {"uri": server.uri, "version": version, "sensors": names, "source": source}
                )
                sys.stdout.flush()  # a program that reads the pipe waits for the address
            print_message(f"{server.uri} sends {source} as {what}; Ctrl-C stops it")
            if hint := getattr(opened, "hint", ""):
                print_message(hint)
            show_clients(server)
    if isinstance(server, XelaServer) and server.failure is not None:
        raise server.failure
    if as_json:
        print_json({"packets": server.n_packets})
    print_message(f"{server.n_packets} packets sent")
