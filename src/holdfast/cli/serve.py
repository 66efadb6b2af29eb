"""`holdfast serve`: the estimates of a source on a web page and for other programs."""

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.extensions import PublisherOptions
from holdfast.cli.options import (
    LOCALHOST,
    BrowserOption,
    DetectorOptions,
    JsonOption,
    ModelArgument,
    OnceOption,
    ServerOptions,
    SourceArgument,
    SpeedOption,
    StartOptions,
    awaited,
    check_speed,
    report_missing_slip_rules,
)
from holdfast.cli.terminal.console import message_if_slow, print_json, print_message

ADDRESS = ServerOptions(LOCALHOST, port=8080)


def serve(
    model: ModelArgument,
    source: SourceArgument,
    *,
    access: ServerOptions = ADDRESS,
    record_to: Annotated[
        Path, typer.Option(help="Folder for recordings that are started on the page.")
    ] = Path("recordings"),
    speed: SpeedOption = 1.0,
    once: OnceOption = False,
    browser: BrowserOption = None,
    options: DetectorOptions,
    start: StartOptions,
    publishers: PublisherOptions,
    as_json: JsonOption = False,
) -> None:
    r"""Show the estimates of a source on a web page, and publish them.

    The page shows the state, force, sigma, probability, taxels and faults of every finger. It
    can also take the tare and record. Other programs read the WebSocket /api/v1/estimates (every
    sample) or /api/v1/live (twenty times per second), see docs/live-page.md. Without --host, only
    this machine can connect. With --json, the address is printed as JSON. Stop it with Ctrl-C.

    SOURCE is the path of a recording, xela://HOST:PORT (or xela://auto), twin:?object=can,
    ros2:///xServTopic or serial:///dev/ttyACM0?sensor=anyskin.

    Example:
      holdfast serve builtin:any twin:?object=can
      holdfast serve model.json xela://auto --ros2
      holdfast serve model.json grasp.parquet --host 0.0.0.0 \
        --token-file secret.txt
    """
    from holdfast.devices.sources import open_source
    from holdfast.live.session import Session, publishing

    token = access.find_token()  # a wrong token is refused before anything is loaded
    check_speed(source, speed)
    with message_if_slow(f"loading the detector for {source}" if awaited(source) else ""):
        loaded = options.load_model(model)

    unopened = open_source(source, speed=speed, loop=not once)
    with ExitStack() as stack:
        with message_if_slow(awaited(unopened.name)):
            stack.enter_context(unopened)
        # The server takes longest to import: a source that is not there is refused before it.
        from holdfast.live.web.serving import run_page
        from holdfast.web.guard import Guard
        from holdfast.web.server import open_browser, page_url, wants_browser

        guard = Guard(access.host, token)

        def announce(url: str) -> None:
            report_missing_slip_rules(loaded)
            page = page_url(url, token)
            if as_json:
                print_json({"url": page, "model": loaded.name, "source": source})
                sys.stdout.flush()  # a program that reads the pipe waits for the address
            opened = "has opened and " * (wants_browser(browser) and open_browser(page))
            print_message(
                f"{page} {opened}shows the estimates of {loaded.name} for {source}; Ctrl-C stops it"
            )

        session = stack.enter_context(Session(options.create_stream(loaded, unopened, start)))
        sinks = [
            plugin.publisher(session.stream, chosen) for _, plugin, chosen in publishers.chosen()
        ]
        stack.enter_context(publishing(session, sinks, print_message))
        run_page(
            session, announce, host=access.host, port=access.port, guard=guard, folder=record_to,
            report=print_message, stay=not once,
        )  # fmt: skip
