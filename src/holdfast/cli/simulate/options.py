"""Options of `holdfast simulate` that say which grasps of an Allegro hand are simulated."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import RARE, SeedOption

if TYPE_CHECKING:
    from holdfast.parallel import Engine
    from holdfast.twin.simulation import Grasp


@dataclass(frozen=True)
class GraspOptions:
    """Group of options: which grasps are simulated."""

    objects: Annotated[
        str, typer.Option(help="Names of objects, separated by commas; by default all objects.")
    ] = ""
    table: Annotated[
        Path | None,
        typer.Option(help="Your own objects: a .toml file like that of the twin."),
        RARE,
    ] = None
    cases: Annotated[str, typer.Option(help="1: hold; 2: hold and disturb; or 1,2.")] = "1,2"
    repeats: Annotated[
        int,
        typer.Option(help="Number of grasps of each object and case, or of --randomize hands."),
    ] = 5
    profile: Annotated[
        str,
        typer.Option(
            help="Profile of grip and disturbances: gentle, reference, vigorous, slips, "
            "long-hold, coupled, finger-gentle, ..."
        ),
    ] = "reference"
    seed: SeedOption = 0
    server: Annotated[
        bool,
        typer.Option(
            "--server", help="Add irregular times and repeated packets, as a XELA server has."
        ),
        RARE,
    ] = False
    sensor: Annotated[
        str,
        typer.Option(
            help="Sensor of the fingertips: uskin-curved (counts, noisy) or orca-finger, "
            "orca-thumb, orca-pinky (steps of 0.1 N, exact zeros without contact)."
        ),
        RARE,
    ] = "uskin-curved"
    faults: Annotated[
        str,
        typer.Option(
            help="Troubles of magnetic skins, as field=300,turn-time=3,zero-share=0.02,drift=20000,"
            "invented-months=4 (counts, s, shares, counts an hour, months)."
        ),
        RARE,
    ] = ""

    def plan(self, engine: "Engine") -> "list[Grasp]":
        """Return the grasps of an Allegro hand.

        Raises:
            ValueError: an unknown object, case, profile, fault or sensor, or a number out of range.
        """
        from holdfast.simulated_grasps import plan_grasps

        table = None if self.table is None else engine.path(self.table)
        return plan_grasps(
            self.objects, self.cases, self.repeats, self.profile, self.seed,
            server=self.server, table=table, faults=self.faults, sensor=self.sensor,
        )  # fmt: skip
