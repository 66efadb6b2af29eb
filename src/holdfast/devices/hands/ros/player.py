"""Option of `holdfast play`: the twin takes the commands of a hand on its topics."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from holdfast.devices.sources import Source


@dataclass(frozen=True)
class DrivenTwinOptions:
    """Options of the twin that takes commands."""

    hand: Annotated[
        str,
        typer.Option(
            help="The twin takes commands as this hand does: ros2:plexus?effort=E&max_effort=M. "
            "It plays once, for the first client.",
        ),
    ] = ""


class DrivenTwinPlayer:
    """The twin with the topics of a hand."""

    OPTIONS = DrivenTwinOptions()

    @staticmethod
    def source(text: str, options: DrivenTwinOptions, *, speed: float) -> "Source":
        """Return the twin with the topics of a hand.

        Raises:
            ValueError: the source is not the twin, or the hand is another one.
        """
        if not text.startswith("twin:"):
            raise ValueError(f"--hand needs the source twin:..., {text} given")
        from holdfast.devices.hands.ros.driven_twin import DrivenTwin

        return DrivenTwin(text, options.hand, speed=speed)
