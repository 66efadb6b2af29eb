"""A film of a grasp, with the forces of the fingertips as arrows."""

from pathlib import Path

import numpy as np

from holdfast.twin.hand import RATE
from holdfast.twin.protocol import Command
from holdfast.twin.render import Picture, Studio, save_video
from holdfast.twin.simulation import Grasp, simulate
from holdfast.twin.world import World

EVERY = 12
"""Samples between two pictures: 12.5 a second."""


def film(grasp: Grasp, path: Path) -> None:
    """Simulates a grasp and writes its film, in real time.

    Args:
        grasp: which one.
        path: of the film; its suffix is its format.

    Raises:
        OutputError: no renderer is at hand, or the format needs a program that is not.
        ValueError: a suffix that is no film's, or an unknown object or profile.
    """
    frames: list[Picture] = []
    studio: list[Studio] = []
    n_seen = 0

    def watch(world: World, command: Command) -> None:
        nonlocal n_seen
        del command
        n_seen += 1
        if not studio:
            studio.append(Studio(world.hand.model))
        if n_seen % EVERY == 0:
            places = world.bodies[:-1, :3]
            arrows = np.column_stack([places, world.contact.contact_force])
            frames.append(studio[0].picture(world.hand.data, arrows))

    try:
        simulate(grasp, watch=watch)
    finally:
        for each in studio:
            each.close()
    save_video(frames, path, RATE / EVERY)
