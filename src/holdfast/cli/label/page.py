"""`holdfast label`: run the labelling page."""

import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from holdfast.cli.label.inputs import (
    RuleOptions,
    current_time,
    login_name,
)
from holdfast.cli.options import ServerOptions
from holdfast.cli.terminal.console import print_json, print_message

if TYPE_CHECKING:
    from holdfast.labelling.review.audit import Suspect
END_TIMEOUT = 10.0
"""Time for which the preparation may go on after Ctrl-C [s]."""


def show_label_page(
    paths: Sequence[Path],
    options: RuleOptions,
    access: ServerOptions,
    author: str | None,
    *,
    browser: bool,
    as_json: bool,
    suspects: "Sequence[Suspect]" = (),
) -> None:
    """Run the labelling page until Ctrl-C.

    Args:
        paths: recordings, or folders of recordings.
        options: options of rules.
        access: address of the page, and who may open it.
        author: author of the labels; by default the login name.
        browser: open the page in a browser.
        as_json: print the address as JSON.
        suspects: labels that an audit contradicts.

    Raises:
        RecordingError: there are no recordings.
        ValueError: other hosts may connect, but there is no token.
        OutputError: the address is not available.
    """
    from holdfast.errors import HoldfastError
    from holdfast.labelling.labelled_files import recordings_at
    from holdfast.labelling.server.service import LabellingService
    from holdfast.labelling.server.workspace import Workspace
    from holdfast.web.guard import Guard
    from holdfast.web.server import open_browser, page_url, run_server

    token = access.find_token()
    guard = Guard(access.host, token)
    files = recordings_at(paths)
    workspace = Workspace(
        files,
        author=login_name() if author is None else author,
        clock=current_time,
        tare=options.tare,
        poses=options.tracking,
        suspects=suspects,
    )

    def announce(url: str) -> None:
        page = page_url(url, token)
        if as_json:
            print_json({"url": page, "recordings": len(files)})
            sys.stdout.flush()  # a program that reads the pipe waits for the address
        where = "is open in the browser" if browser and open_browser(page) else "is the page"
        what = f"{len(files)} recordings" if len(files) > 1 else files[0]
        print_message(f"{page} {where} for {what}; Ctrl-C stops it")

    def prepare() -> None:  # read the first recording while the browser starts
        with suppress(HoldfastError, ValueError, OSError):  # the page reports it
            workspace.changes(0)

    preparing = Thread(target=prepare, daemon=True)
    preparing.start()
    run_server(LabellingService(workspace, guard).app, access.host, access.port, announce)
    preparing.join(END_TIMEOUT)  # a library that is at work when Python ends stops with an error
