"""`holdfast label`: the page on which labels are drawn."""

import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from holdfast.cli.label.inputs import Asking, Serving, login_name, now, recordings_at
from holdfast.cli.serve import open_page
from holdfast.cli.terminal.console import print_json, say

if TYPE_CHECKING:
    from holdfast.labelling.review.audit import Suspect
    from holdfast.labelling.server.workspace import Workspace


def show_label_page(
    paths: Sequence[Path],
    asking: Asking,
    serving: Serving,
    author: str | None,
    suspects: "Sequence[Suspect]" = (),
) -> None:
    """Serves the label page of recordings until Ctrl-C.

    Args:
        paths: of recordings, or folders of them.
        asking: what rules are given.
        serving: where, and to whom.
        author: who labels; the login name by default.
        suspects: labels that an audit contradicts.

    Raises:
        RecordingError: there is no recording.
        ValueError: the network may not be served without a token.
        OutputError: the address cannot be listened at.
    """
    from holdfast.features import Tare
    from holdfast.labelling.server.service import LabellingService
    from holdfast.labelling.server.workspace import Workspace
    from holdfast.web.guard import Guard
    from holdfast.web.server import run_server

    guard = Guard(serving.host, serving.token)
    files = recordings_at(paths)
    shelf = Workspace(
        files,
        author=login_name() if author is None else author,
        clock=now,
        tare=Tare.parse(asking.tare),
        poses=asking.tracking,
        suspects=suspects,
    )

    def tell(url: str) -> None:
        page = url if serving.token is None else f"{url}?token={serving.token}"
        if serving.as_json:
            print_json({"url": page, "recordings": len(files)})
            sys.stdout.flush()
        opened = serving.browser and open_page(page)
        where = "is open in the browser" if opened else "is the page"
        say(f"{page} {where} for {_what(files)}; Ctrl-C ends it")

    for work in (_prepare, Workspace.warm_up):
        Thread(target=work, args=(shelf,), daemon=True).start()
    run_server(LabellingService(shelf, guard).app, serving.host, serving.port, tell)


def _what(files: Sequence[Path]) -> str:
    return f"{len(files)} recordings" if len(files) > 1 else str(files[0])


def _prepare(shelf: "Workspace") -> None:
    """Reads the first recording while the browser starts."""
    from holdfast.errors import HoldfastError

    with suppress(HoldfastError, ValueError, OSError):  # the page tells
        shelf.changes(0)
