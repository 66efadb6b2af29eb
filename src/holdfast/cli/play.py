"""`holdfast play`: a stand-in for XELA's server, fed from a recording or the twin."""

import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import check_speed
from holdfast.cli.terminal.console import print_json, say

if TYPE_CHECKING:
    from holdfast.live.xela_server import XelaServer

LOOK_EVERY = 0.2
"""How often it is looked whether it has ended [s]."""
REFRESH = 1.0
"""How often the line with the rate is written anew on a terminal [s]."""


def play(
    source: Annotated[str, typer.Argument(help="A recording's path, or a URI: see above.")],
    version: Annotated[str, typer.Option(help="Of the server: 1.7 or 1.8.")] = "1.8",
    host: Annotated[str, typer.Option(help="Address to listen at.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port; 0 finds a free one.")] = 5000,
    speed: Annotated[
        float, typer.Option(help="1 is real time; slower, clients take the samples as late.")
    ] = 1.0,
    once: Annotated[
        bool, typer.Option("--once", help="Wait for a client, play once, and end.")
    ] = False,
    whole_hand: Annotated[
        bool | None,
        typer.Option(
            "--whole-hand/--separate",
            help="Fingertips inside the packet of a hand, or as sensors 1, 2, ...; by default "
            "the former where they are called as an Allegro hand's.",
        ),
    ] = None,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print where it listens, and at the end how much it sent."),
    ] = False,
) -> None:
    """Acts as a XELA server for a recording or the twin.

    Programs that read xela_server read this instead: the same packets over a WebSocket, at the
    pace of the recording, whose times they carry, shifted to now. Modules of an Allegro hand
    become one sensor of 368 taxels, with those that are missing at rest; others, or all with
    --separate, the server's sensors 1, 2, ... Readings in newtons are sent as calibrated
    values, with counts made up from a data sheet. Ctrl-C ends it.

    SOURCE is the path of a recording, or twin:?object=can&seed=1; it begins anew when it is
    over, unless --once is given.

    Example:
      holdfast play twin:?object=can
      holdfast play grasp.parquet --once --separate --version 1.7
      holdfast detect builtin:twin xela://127.0.0.1:5000
    """
    from holdfast.live.xela_server import XelaServer
    from holdfast.sources import open_source
    from holdfast.sources.xela.encoder import is_part_of_hand

    check_speed(source, speed)
    if not speed:
        raise ValueError(f"--speed: a speed above 0 expected, {speed:g} given")
    with open_source(source, speed=speed, loop=not once) as opened:
        whole = is_part_of_hand(opened.sensors) if whole_hand is None else whole_hand
        server = XelaServer(
            opened, version=version, host=host, port=port, whole_hand=whole, wait=once
        )
        with _interruptible(), server:
            _tell_begin(server, source, version, as_json=as_json)
            _follow(server)
    if server.failure is not None:
        raise server.failure
    if as_json:
        print_json({"packets": server.n_packets})
    say(f"{server.n_packets} packets sent")


@contextmanager
def _interruptible() -> Iterator[None]:
    """Ctrl-C and SIGTERM end what is inside, in order."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with suppress(KeyboardInterrupt):
            yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _tell_begin(server: "XelaServer", source: str, version: str, *, as_json: bool) -> None:
    if as_json:
        modules = {str(number): list(names) for number, names in server.encoder.modules.items()}
        print_json({"uri": server.uri, "version": version, "sensors": modules, "source": source})
        sys.stdout.flush()
    say(f"{server.uri} plays {source} as a XELA server {version}; Ctrl-C ends it")


def _follow(server: "XelaServer") -> None:
    """Tells who listens until it has ended: on a terminal all the time, else where it changes."""
    began, sent, told = time.monotonic(), 0, -1
    while not server.wait(LOOK_EVERY):
        now = time.monotonic()
        if sys.stderr.isatty() and now - began >= REFRESH:
            rate = (server.n_packets - sent) / (now - began)
            sys.stderr.write(f"\r{_clients(server.n_clients)}, {rate:.1f} packets/s \033[K")
            began, sent = now, server.n_packets
        elif not sys.stderr.isatty() and server.n_clients != told:
            told = server.n_clients
            say(_clients(told))
    if sys.stderr.isatty():
        say("")


def _clients(number: int) -> str:
    return "1 client" if number == 1 else f"{number} clients"
