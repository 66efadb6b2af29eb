"""Options of the verb hold, and the loop that they describe."""

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import RARE
from holdfast.cli.terminal.console import print_message
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.devices.sources import Source
    from holdfast.live.stream_detector import StreamDetector
    from holdfast_grip import Limits
    from holdfast_grip.hands import HandDevice
    from holdfast_grip.loop.grip_loop import GripLoop, Log
    from holdfast_grip.loop.watchdog import Watchdog


class FaultAction(StrEnum):
    """Action of the hand in a fault."""

    HOLD = "hold"
    OPEN = "open"


TWIN = "twin:"


@dataclass(frozen=True)
class GripSettings:
    """Group of options: control of the grip force of a hand.

    Attributes:
        hand: URI of the hand.
        max_scale: highest force scale; None for the default of `Limits`.
    """

    hand: Annotated[
        str,
        typer.Option(
            help="URI of the hand: twin:, ros2:NAME?..., log:PATH or call:MODULE:FUNCTION."
        ),
    ]
    law: Annotated[str, typer.Option(help="Law of grip force.")] = "holdfast"
    armed: Annotated[
        bool, typer.Option("--armed", help="Send commands; without it, this is a dry run.")
    ] = False
    confirm: Annotated[str, typer.Option(help="URI of the hand again, with --armed.")] = ""
    max_scale: Annotated[
        float | None,
        typer.Option(help="Largest multiple of the first force.", show_default="3.0"),
    ] = None
    max_force: Annotated[
        float | None,
        typer.Option(
            help="Largest normal force of a finger [unit of the readings, or N with --newtons].",
            show_default="no limit",
        ),
    ] = None
    on_fault: Annotated[
        FaultAction,
        typer.Option(help="What the hand does in a fault, or when it is stopped."),
    ] = FaultAction.HOLD
    newtons: Annotated[
        float | None, typer.Option(help="Calibration: newtons for each unit of the readings."), RARE
    ] = None

    def check(self) -> None:
        """Check the values before anything is opened.

        Raises:
            ValueError: the limits contradict each other, or there is no such law.
        """
        from holdfast_grip.laws import law_named

        self.limits()
        law_named(self.law)

    def limits(self) -> "Limits":
        """Return the limits of the controller.

        Raises:
            ValueError: they contradict each other.
        """
        from holdfast_grip import Limits

        scale = {} if self.max_scale is None else {"max_scale": self.max_scale}
        return Limits(max_force=self.max_force, on_fault=self.on_fault.value, **scale)


def find_source_and_hand(source: str, hand: str, *, speed: float) -> "tuple[Source, HandDevice]":
    """Return source and hand, which are not open yet: the same object if both are the twin.

    Raises:
        ValueError: the hand is the twin and the source is not, or a URI is not valid.
        MissingExtra: the hand is the twin, or needs a package that is not installed.
    """
    from holdfast.devices.sources import open_source
    from holdfast_grip.hands import open_hand

    if hand == TWIN:
        if not source.startswith(TWIN):
            raise ValueError(f"--hand twin: needs the source twin:..., {source} given")
        require_extras("twin")
        from holdfast_grip.hands.live_twin import LiveTwin

        twin = LiveTwin(source, speed=speed)
        return twin, twin
    return open_source(source, speed=speed), open_hand(hand)


def check_armed(settings: GripSettings) -> None:
    """Check that a hand that moves was named twice; ask for it on a terminal.

    Raises:
        ValueError: it was not.
    """
    hand, confirm = settings.hand, settings.confirm
    if not settings.armed or hand in (TWIN, confirm):
        return
    if not confirm and sys.stdin.isatty():
        confirm = typer.prompt(f"This moves a hand. Type its URI ({hand})", err=True)
    if confirm != hand:
        raise ValueError(f"--armed moves the hand: confirm it with --confirm {hand}")


def connect_hand(stack: ExitStack, settings: GripSettings, hand: "HandDevice") -> "Watchdog | None":
    """Connect to the hand and start its watchdog, unless it is the twin or a dry run.

    It is done before the source is opened, so that no samples wait for it: the watchdog takes
    the longest time.

    Raises:
        HandError: the hand does not answer, or has another controller.
    """
    from holdfast_grip.hands import Claim
    from holdfast_grip.loop.watchdog import Watchdog

    if not settings.armed or settings.hand == TWIN:
        return None
    stack.enter_context(Claim(hand.resource))
    stack.enter_context(hand)
    watchdog = Watchdog(hand.name, settings.on_fault.value)
    # If the source cannot be opened, the watchdog ends without a command.
    stack.callback(watchdog.kill)
    watchdog.start()
    return watchdog


@contextmanager
def open_loop(
    settings: GripSettings,
    hand: "HandDevice",
    stream: "StreamDetector",
    watchdog: "Watchdog | None",
    log: "Log",
) -> "Iterator[GripLoop]":
    """Yield the loop of a hand. At its end, the watchdog ends before anything else closes.

    Raises:
        ValueError: the law needs newtons, the hand cannot do what the limits allow, or the model
            has no estimates of a finger.
    """
    from holdfast_grip import GripController
    from holdfast_grip.loop.grip_loop import GripLoop

    limits = settings.limits()
    hand.check(limits, stream.fingers)
    if advice := stream.model.slip_advice:
        print_message(f"{advice}; take a taught model, or builtin:twin with the twin")
    # Check that the fingers of the hand which the source has also have estimates.
    missing = [
        finger
        for finger in hand.fingers or ()
        if finger in stream.source.sensors and finger not in stream.fingers
    ]
    if missing:
        raise ValueError(
            f"{hand.name} also holds with {', '.join(missing)}, of which the model gives no "
            f"estimates; it gives those of {', '.join(stream.fingers)}: use builtin:any, or "
            "train a model of all fingers"
        )
    controller = GripController(
        limits, settings.law, sensors=stream.fingers, newtons_per_unit=settings.newtons,
        reports_slips=stream.model.reports_slips,
    )  # fmt: skip
    loop = GripLoop(controller, hand, armed=settings.armed, watchdog=watchdog, log=log)
    with ExitStack() as stack:
        if watchdog is not None:
            stack.push(watchdog)  # it runs already
        yield stack.enter_context(loop)
    if hand.n_refused:
        print_message(f"{hand.n_refused} joint states of {hand.name} were refused")
