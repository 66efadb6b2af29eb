"""Screen of the guided protocol of `holdfast teach` in a terminal, and its keys."""

from typing import TYPE_CHECKING

from holdfast.cli.terminal.console import print_message, visible
from holdfast.cli.terminal.progress import LiveDisplay

if TYPE_CHECKING:
    from holdfast.live.teaching.protocol import View

TEACH_KEYS = {
    "\n": "next",
    " ": "next",
    "r": "repeat",
    "s": "skip",
    **{digit: f"throw away {digit}" for digit in "123456789"},
}
"""Action of each key; `q` quits."""
TEACH_KEY_HELP = "Enter goes on   r repeats   s skips the step   1-9 throw a slide away   q quits"
ACTIVE_KEY_HELP = "Enter goes on before the time   r begins again   s skips the step   q quits"
SCREEN_WIDTH = 80
"""Width of the screen [characters]."""
BAR_WIDTH = 60
"""Width of the bar of the time that is over [characters]."""
SAFETY = (
    "holdfast sends nothing to any hand. Before you go on:",
    "  1  The hand holds by its own controller, at a low force.",
    "  2  The object can fall on something soft.",
    "  3  You can stop the robot.",
)
"""Conditions that a person confirms before the protocol begins."""


def screen_lines(view: "View", progress: str) -> list[str]:
    """Return the lines of the screen, each at most 80 characters.

    Args:
        view: what a person sees.
        progress: how far the protocol is.
    """
    large = "   ".join(" ".join(word) for word in view.words.split())
    left = "" if view.left is None else f"{view.left:.0f} s"
    done = round(BAR_WIDTH * view.share)
    bar = "#" * done + "-" * (BAR_WIDTH - done) if view.share or view.left is not None else ""
    room = SCREEN_WIDTH - len(view.title)
    lines = [
        "", f"{view.title}{progress:>{room}}", "",
        f"  {large:<{SCREEN_WIDTH - 10}}{left:>8}", f"  {bar}".rstrip(), "",
        f"  {view.hint}".rstrip(), f"  {visible(view.message)}".rstrip(), "",
        TEACH_KEY_HELP if view.decides else ACTIVE_KEY_HELP,
    ]  # fmt: skip
    return [line[:SCREEN_WIDTH].rstrip() for line in lines]


class TeachScreen(LiveDisplay):
    """Screen of the protocol: on a terminal one that is drawn again, elsewhere a line a change.

    Args:
        is_read: whether a person or a robot follows each change.
    """

    def __init__(self, *, is_read: bool = True) -> None:
        super().__init__()
        self._shown, self._is_read = "", is_read

    def show(self, view: "View", progress: str) -> None:
        """Show what a person sees now; elsewhere than on a terminal, what has changed."""
        if self._live is None:
            text = ": ".join(filter(None, (view.title, view.words, view.message * view.decides)))
            if text != self._shown and self._is_read:
                print_message(text)
            self._shown = text
            return
        lines = screen_lines(view, progress)
        text = "\n".join(lines)
        if text != self._shown:
            from rich.text import Text

            drawn = Text(text, no_wrap=True, overflow="ellipsis")
            drawn.highlight_words([lines[3].strip()], "bold")
            self._live.update(drawn, refresh=True)
        self._shown = text
