"""Film of one trial with two laws, side by side, with force and state below each."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from holdfast.contact import SLIP_SPEED
from holdfast.twin.hand import RATE
from holdfast.twin.render import SAMPLES_PER_PICTURE, Picture, Renderer, save_video
from holdfast_lab.trial.course import Instant, follow
from holdfast_lab.trial.trials import Trial

FILM_WIDTH, HEIGHT = 360, 270
"""Size of the picture of one law [pixels]."""
BELOW = 66
"""Height of the text below it [pixels]."""
FILM_GAP = 8
"""Space between the two pictures [pixels]."""
FILM_FONT_SIZE = 16
BACKGROUND, FILM_INK, ALARM = "#ffffff", "#1c1f23", "#b03a00"


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

    The shorter side stops at its last picture.

    Args:
        trial: the trial.
        laws: names of the laws of the left and of the right side.
        model: name of the model of the detector.

    Raises:
        OutputError: no back end of MuJoCo works here.
    """
    sides = [[_framed(law, shot) for shot in _shots(trial, law, model)] for law in laws]
    pictures = (
        _beside([side[min(k, len(side) - 1)] for side in sides])
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
                renderer = renderer or Renderer(world.hand.model, FILM_WIDTH, HEIGHT)
                arrows = np.column_stack([world.bodies[:-1, :3], world.contact.contact_force])
                shots.append(Shot(renderer.picture(world.hand.data, arrows), instant))
    finally:
        if renderer is not None:
            renderer.close()
    return shots


def _beside(pictures: Sequence[Picture]) -> Picture:
    gap = np.full((len(pictures[0]), FILM_GAP, 3), 255, dtype=np.uint8)
    return np.concatenate([pictures[0], gap, *pictures[1:]], axis=1)


def _framed(law: str, shot: Shot) -> Picture:
    """Return a picture with the text below it."""
    image = Image.new("RGB", (FILM_WIDTH, HEIGHT + BELOW), BACKGROUND)
    image.paste(Image.fromarray(shot.picture))
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(FILM_FONT_SIZE)
    for line, (text, colour) in enumerate(captions(law, shot.instant)):
        draw.text((6, HEIGHT + 4 + 20 * line), text, fill=colour, font=font)
    return np.asarray(image)


def captions(law: str, instant: Instant) -> list[tuple[str, str]]:
    """Return the lines of text below a picture, with their colours.

    Example:
        >>> instant = Instant(0.2, 3.04, 2.0, 0.012, "REACT", False, None)
        >>> [text for text, _ in captions("holdfast", instant)]
        ['holdfast: REACT', 'force 3.0 N, least 2.0 N', '0.2 s after the load, slips 12 mm/s']
    """
    state = "object lost" if instant.is_lost else instant.state
    when = f"{abs(instant.time):.1f} s {'before' if instant.time < 0 else 'after'} the load"
    last = (when, FILM_INK)
    if instant.slip_speed > SLIP_SPEED and not instant.is_lost:
        last = (f"{when}, slips {1e3 * instant.slip_speed:.0f} mm/s", ALARM)
    return [
        (f"{law}: {state}", ALARM if instant.is_lost else FILM_INK),
        (f"force {instant.force:.1f} N, least {instant.least:.1f} N", FILM_INK),
        last,
    ]
