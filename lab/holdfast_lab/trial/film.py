"""Film of one trial with two laws, one above the other, with load, force and state in words."""

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from holdfast.contact import SLIP_SPEED
from holdfast.sensors.types import Array
from holdfast.twin.hand import GRAVITY, RATE
from holdfast.twin.loads import Load, LoadKind, load_state
from holdfast.twin.render import (
    SAMPLES_PER_PICTURE,
    Picture,
    Renderer,
    save_video,
)
from holdfast_lab.trial.course import Instant, follow
from holdfast_lab.trial.trials import Trial

FILM_WIDTH, HEIGHT = 360, 250
"""Size of the picture of one law [pixels]: the width of a phone, so that no text shrinks on it."""
FILM_FONT_SIZE, LINE_HEIGHT, N_LINES = 22, 27, 4
"""Size of the text, its line, and number of lines [pixels]."""
BELOW = N_LINES * LINE_HEIGHT + 8
"""Height of the text below a picture [pixels]."""
FILM_GAP = 10
"""Space between the two pictures [pixels]."""
BACKGROUND, FILM_INK, ALARM, LOAD_INK = "#ffffff", "#1c1f23", "#b03a00", "#5c0d8f"
STATE_WORDS = {
    "IDLE": "waits for a grip",
    "HOLD": "force stays",
    "REACT": "presses more",
    "RELAX": "presses less",
    "FAULT": "fault, force stays",
}
"""States of the loop in words."""
SIDES = (("away", "near"), ("left", "right"), ("down", "up"))
"""Directions of the axes of the world in the picture, negative and positive."""
TOWARDS_VIEWER = np.array([1.0, 0.0, 0.5])
"""Direction in which the arrow of a load is in front of its object."""
CLEARANCE = 0.015
"""Distance between them [m]."""
LOAD_LENGTH_PER_NEWTON, MAX_LOAD_LENGTH = 0.04, 0.08
"""Length of the arrow of a load of one newton, and of the longest one [m]."""
MIN_LOAD = 0.1
"""Least force whose arrow is drawn [N]."""


class Shot(NamedTuple):
    """One picture of the twin, and the text below it.

    Attributes:
        picture: of the twin.
        instant: the sample that it shows.
    """

    picture: Picture
    instant: Instant


def film(trial: Trial, laws: tuple[str, str], model: str) -> bytes:
    """Return the film of a trial with two laws, in real time, as an animated WebP file.

    The shorter one stops at its last picture.

    Args:
        trial: the trial.
        laws: names of the laws above and below.
        model: name of the model of the detector.

    Raises:
        OutputError: no back end of MuJoCo works here.
    """
    sides = [[_framed(law, shot, trial.load) for shot in _shots(trial, law, model)] for law in laws]
    gap = np.full((FILM_GAP, FILM_WIDTH, 3), 255, dtype=np.uint8)
    above, below = sides
    pictures = (
        np.concatenate([above[min(k, len(above) - 1)], gap, below[min(k, len(below) - 1)]])
        for k in range(max(map(len, sides)))
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "film.webp")
        save_video(pictures, path, RATE / SAMPLES_PER_PICTURE)
        return path.read_bytes()


def _shots(trial: Trial, law: str, model: str) -> list[Shot]:
    shots: list[Shot] = []
    renderer: Renderer | None = None
    try:
        for number, instant in enumerate(follow(trial, law, model)):
            if number % SAMPLES_PER_PICTURE == 0 and instant.world is not None:
                world = instant.world
                # Made late, because only a world has the model that it draws.
                renderer = renderer or Renderer(world.hand.model, FILM_WIDTH, HEIGHT)
                arrows = np.column_stack([world.bodies[:-1, :3], world.contact.contact_force])
                load = _load_arrow(trial, instant, world.bodies[-1, :3])
                picture = renderer.picture(world.hand.data, arrows, load)
                shots.append(Shot(picture, instant))
    finally:
        if renderer is not None:
            renderer.close()
    return shots


def _load_arrow(trial: Trial, instant: Instant, place: Array) -> Array | None:
    """Return begin and length of the arrow of the load (6,), in front of the object [m].

    The hand that is shaken or moved pushes as its acceleration times the mass, the other way.
    """
    if instant.is_lost:
        return None
    item = trial.grasp.item
    state = load_state([trial.load], trial.load.start + instant.time)
    force = state.force - item.mass * state.acceleration
    size = float(np.linalg.norm(force))
    if size < MIN_LOAD:
        return None
    length = min(LOAD_LENGTH_PER_NEWTON * size, MAX_LOAD_LENGTH) / size * force
    return np.concatenate([place + (item.radius + CLEARANCE) * TOWARDS_VIEWER, length])


def _framed(law: str, shot: Shot, load: Load) -> Picture:
    """Return a picture with the text below it."""
    image = Image.new("RGB", (FILM_WIDTH, HEIGHT + BELOW), BACKGROUND)
    image.paste(Image.fromarray(shot.picture))
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(FILM_FONT_SIZE)
    for line, (text, colour) in enumerate(captions(law, shot.instant, load)):
        draw.text((6, HEIGHT + 4 + LINE_HEIGHT * line), text, fill=colour, font=font)
    return np.asarray(image)


def captions(law: str, instant: Instant, load: Load) -> list[tuple[str, str]]:
    """Return the lines of text below a picture, with their colours.

    Example:
        >>> instant = Instant(0.2, 3.04, 2.0, 0.012, "REACT", False, None)
        >>> weight = Load(LoadKind.WEIGHT, 3.0, 0.0, 0.06)
        >>> [text for text, _ in captions("holdfast", instant, weight)]
        ['holdfast: presses more', 'force 3.0 N, least 2.0 N', '+60 g', 'at 0.2 s, slips 12 mm/s']
    """
    state = "object lost" if instant.is_lost else STATE_WORDS[instant.state]
    when = f"at {max(instant.time, 0.0):.1f} s"
    last = (when, FILM_INK)
    if instant.slip_speed > SLIP_SPEED and not instant.is_lost:
        last = (f"{when}, slips {1e3 * instant.slip_speed:.0f} mm/s", ALARM)
    return [
        (f"{law}: {state}", ALARM if instant.is_lost else FILM_INK),
        (f"force {instant.force:.1f} N, least {instant.least:.1f} N", FILM_INK),
        (load_text(load, instant.time), LOAD_INK),
        last,
    ]


def load_text(load: Load, time: float) -> str:
    """Return the load that acts at a time after its start [s], in words.

    Example:
        >>> pull = Load(LoadKind.PULL, 3.0, 1.0, 1.2, (0.0, 1.0, 0.0))
        >>> [load_text(pull, time) for time in (-0.4, 0.5, 1.2)]
        ['load in 0.4 s', 'pull 1.2 N right', 'pull is over']
    """
    if time < 0.0:
        return f"load in {-time:.1f} s"
    stays = load.kind in (LoadKind.WEIGHT, LoadKind.FRICTION)
    if not stays and time >= load.duration:
        return f"{load.kind.value} is over"
    state = load_state([load], load.start + time)
    if load.kind is LoadKind.WEIGHT:
        return f"+{1e3 * float(np.linalg.norm(state.force)) / GRAVITY:.0f} g"
    if load.kind is LoadKind.FRICTION:
        return f"friction x {state.friction:.2f}"
    if load.kind is LoadKind.PULL:
        axis = int(np.argmax(np.abs(state.force)))
        side = SIDES[axis][int(state.force[axis] > 0)]
        return f"pull {float(np.linalg.norm(state.force)):.1f} N {side}"
    size = float(np.linalg.norm(state.acceleration))
    return f"{load.kind.value} {size:.1f} m/s2"  # the font has no raised 2
