"""Options of `holdfast simulate` for hands that are drawn at random."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import RARE
from holdfast.cli.simulate.options import GraspOptions
from holdfast.cli.terminal.console import print_message
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.parallel import Engine
    from holdfast_lab.randomized.simulation import RandomHold


@dataclass(frozen=True)
class HandOptions:
    """Group of options: which hands are drawn."""

    randomize: Annotated[
        bool,
        typer.Option(
            "--randomize", help="Draw another hand, sensor, object and arm motion each time."
        ),
    ] = False
    grasps: Annotated[
        int, typer.Option(help="Number of grasps of each --randomize hand, of other objects.")
    ] = 1
    measured: Annotated[
        str,
        typer.Option(
            help="Mechanisms of real skins and arms for --randomize hands, separated by commas: "
            "scan, filter, noise, vibration, colour, steps, updates, stamps, carry, person; or all."
        ),
        RARE,
    ] = ""


class RandomizedHands:
    """Hands with other fingers, sensors, objects and arm motions each time."""

    OPTIONS = HandOptions()

    @staticmethod
    def simulate(
        out: Path, grasps: GraspOptions, options: HandOptions, *, engine: "Engine", force: bool
    ) -> list[str]:
        """Simulate randomized hands whose recordings do not exist; return the names of new ones.

        Of `grasps` only the repeats and the seed count.

        Raises:
            ValueError: a number is out of range.
            OutputError: an existing recording has another seed or profile.
        """
        from holdfast.simulated_grasps import check_numbers, is_recorded, path_of, simulate_all
        from holdfast_lab.randomized.simulation import RandomHold

        if not options.randomize:
            raise ValueError(
                "--measured is for the hands of --randomize"
                if options.measured
                else f"--grasps is for the hands of --randomize, {options.grasps} given; --repeats "
                "repeats grasps"
            )
        n_grasps, seed = options.grasps, grasps.seed
        check_numbers(grasps.repeats, seed)
        if n_grasps < 1:
            raise ValueError(f"--grasps of at least 1 expected, {n_grasps} given")
        mechanisms = mechanisms_of(options.measured)
        out.mkdir(parents=True, exist_ok=True)
        numbers = [None] if n_grasps == 1 else range(1, n_grasps + 1)
        holds = [
            RandomHold(hand, seed, grasp=number, measured=mechanisms)
            for hand in range(grasps.repeats)
            for number in numbers
        ]
        expected: dict[str, object] = {
            "profile": "randomized", "seed": seed, "measured": list(mechanisms) or None
        }  # fmt: skip
        missing = [
            hold for hold in holds if force or not is_recorded(path_of(hold.name, out), expected)
        ]
        return simulate_all(
            simulate_hand, missing, len(holds), out,
            engine=engine, force=force, notify=print_message, steps=progress,
        )  # fmt: skip


def mechanisms_of(text: str) -> tuple[str, ...]:
    """Return the mechanisms of `--measured`, in a fixed order.

    Raises:
        ValueError: a name is unknown.
    """
    from holdfast_lab.randomized.drawing import MEASURED

    names = {name.strip() for name in text.split(",") if name.strip()}
    if unknown := sorted(names - {*MEASURED, "all"}):
        raise ValueError(
            f"--measured: unknown mechanism {unknown[0]!r}; there are {', '.join(MEASURED)}, all"
        )
    return tuple(name for name in MEASURED if name in names or "all" in names)


def simulate_hand(hold: "RandomHold", out: Path, force: bool) -> list[str]:
    """Simulate a randomized hand; return the name of the recording."""
    from holdfast.io import save_recording
    from holdfast.simulated_grasps import path_of
    from holdfast_lab.randomized.simulation import simulate_random

    save_recording(simulate_random(hold), path_of(hold.name, out), force=force)
    return [hold.name]
