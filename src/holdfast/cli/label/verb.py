"""`holdfast label`: the labelling page."""

import sys
from contextlib import suppress
from threading import Thread
from typing import Annotated

from holdfast.cli.csv_options import refuse_foreign
from holdfast.cli.label.inputs import (
    AuthorOption,
    PathsArgument,
    PosesOption,
    RuleOptions,
    TracksOption,
    current_time,
    login_name,
)
from holdfast.cli.options import (
    LOCALHOST,
    RARE,
    BrowserOption,
    FittingTareOption,
    JsonOption,
    ServerOptions,
)
from holdfast.cli.terminal.console import print_json, print_message
from holdfast.errors import require_extras

LABEL_ADDRESS = ServerOptions(LOCALHOST, port=8081)
"""Default address of the labelling page."""
END_TIMEOUT = 10.0
"""Time for which the preparation may go on after Ctrl-C [s]."""


def label(
    paths: PathsArgument,
    *,
    tare: FittingTareOption = None,
    poses: PosesOption = None,
    tracks: TracksOption = None,
    author: AuthorOption = None,
    access: Annotated[ServerOptions, RARE] = LABEL_ADDRESS,
    browser: BrowserOption = None,
    as_json: JsonOption = False,
) -> None:
    """Label recordings on a page or by a rule.

    Without a command, open the labelling page: draw labels with the mouse, set states with keys,
    undo changes, and accept the proposals of a rule. Every change is saved at once. Labels are
    stored in NAME.labels.json beside the recording. The recording itself is never changed. Each
    command has its own help: holdfast label auto --help. See docs/labels.md.

    Example:
      holdfast label recordings/
      holdfast label auto signal recordings/ --dry-run
      holdfast label export csv labels/ recordings/
    """
    require_extras("label")
    from holdfast.errors import HoldfastError
    from holdfast.labelling.labelled_files import recordings_at
    from holdfast.labelling.server.service import LabellingService
    from holdfast.labelling.server.workspace import Workspace
    from holdfast.web.guard import Guard
    from holdfast.web.server import open_browser, page_url, run_server

    refuse_foreign(paths)
    token = access.find_token()
    guard = Guard(access.host, token)
    files = recordings_at(paths)
    workspace = Workspace(
        files,
        author=login_name() if author is None else author,
        clock=current_time,
        tare=tare,
        poses=RuleOptions(tare, poses, tracks).tracking,
    )

    def announce(url: str) -> None:
        page = page_url(url, token)
        if as_json:
            print_json({"url": page, "recordings": len(files)})
            sys.stdout.flush()  # a program that reads the pipe waits for the address
        shown = browser is not False and open_browser(page)
        where = "is open in the browser" if shown else "is the page"
        what = f"{len(files)} recordings" if len(files) > 1 else files[0]
        print_message(f"{page} {where} for {what}; Ctrl-C stops it")

    def prepare() -> None:  # read the first recording while the browser starts
        with suppress(HoldfastError, ValueError, OSError):  # the page reports it
            workspace.changes(0)

    preparing = Thread(target=prepare, daemon=True)
    preparing.start()
    run_server(LabellingService(workspace, guard).app, access.host, access.port, announce)
    preparing.join(END_TIMEOUT)  # a library that is at work when Python ends stops with an error
