"""Panels: what plug-ins add to the live page and its service."""

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from msgspec import Struct

if TYPE_CHECKING:
    from aiohttp import web

    from holdfast.devices.sources import Source
    from holdfast.live.session import Session

EventListener = Callable[[str, float], None]
"""Function that gets each event of a panel as a text, and its time [s]. It must return at once."""


class Panel(Protocol):
    """What runs beside a session, and is shown and controlled on the live page.

    Attributes:
        name: key of its document in the live documents; its files are at `/panels/NAME`.
        folder: with `panel.html`, a part of the page; `panel.css`; and `panel.js`, which exports a
            class `Panel(page)` with `start(hello)`, `update(document)` and `setLink(link)`.
        document_type: type of its documents.
    """

    name: str
    folder: Path
    document_type: type[Struct]

    def document(self) -> Any:  # noqa: ANN401 (of `document_type`)
        """Return its state."""

    def summary(self) -> str:
        """Return its state in a line, which is a marker at the beginning of a recording."""

    def routes(self, report: Callable[[str], None]) -> "list[web.AbstractRouteDef]":
        """Return routes under `/api/v1/NAME`; `report` adds a notice to the page."""

    def add_listener(self, listener: EventListener) -> None:
        """Call `listener` with every event from now on; a recording gets them as markers."""


class PanelOpener(Protocol):
    """Opens a panel, in the order of its functions. `PanelOptions` makes it of checked options."""

    def source(self) -> "Source | None":
        """Return the source if the panel has to make it; else None. It is not open yet."""

    def connect(self, stack: ExitStack) -> None:
        """Do what takes time, before the source is opened."""

    def open(self, session: "Session") -> AbstractContextManager[Panel]:
        """Run the panel beside a session."""
