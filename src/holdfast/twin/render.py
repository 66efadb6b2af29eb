"""Pictures and films of the twin, rendered without a display."""

import shutil
import subprocess
from collections.abc import Iterable
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import IO, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from holdfast.errors import OutputError
from holdfast.sensors.types import Array
from holdfast.twin.hand import RATE
from holdfast.twin.mujoco_import import BACK_END, mujoco
from holdfast.twin.protocol import Command
from holdfast.twin.simulation import Grasp, simulate
from holdfast.twin.world import World

Picture = npt.NDArray[np.uint8]
"""(height, width, 3) red, green, blue."""

ANIMATION_SUFFIXES = (".gif", ".png", ".webp")
"""Suffixes of films that need only Pillow, which comes with matplotlib; `.png` is animated."""
FILM_SUFFIXES = (*ANIMATION_SUFFIXES, ".mp4")
"""Suffixes of all films; `.mp4` needs the program ffmpeg."""
ARROW_LENGTH_PER_NEWTON = 0.012
"""Length of the arrow for a force of one newton [m]."""
ARROW_HALF_WIDTH = 0.002
"""Half width of an arrow [m]."""
ARROW_COLOUR = (0.80, 0.10, 0.16, 1.0)
"""Colour of the arrows of contact forces."""
LOAD_COLOUR, LOAD_HALF_WIDTH = (0.36, 0.05, 0.56, 1.0), 0.004
"""Colour and half width of the arrow of a load [m]."""
MIN_ARROW_FORCE = 0.02
"""Force up to which no arrow is drawn [N]."""
MAX_SHAPES = 1000
"""Maximum number of shapes in a picture."""
SAMPLES_PER_PICTURE = 12
"""Samples between two pictures of a film, which gives 12.5 pictures per second."""


class Camera(NamedTuple):
    """View of a picture.

    Attributes:
        target: (3,) point in the middle of the picture [m].
        distance: distance of the camera from it [m].
        azimuth: direction of view about the vertical [degrees]; 90 is along y.
        elevation: elevation of the direction of view [degrees]; negative is downwards.
    """

    target: tuple[float, float, float] = (0.07, -0.014, 0.006)
    distance: float = 0.32
    azimuth: float = 162.0
    elevation: float = -36.0


class Renderer:
    """Renderer of pictures of one model. Use it as a context manager, or call `close`.

    Args:
        model: MuJoCo's model.
        width: width of the pictures [pixels].
        height: height of the pictures [pixels].
        camera: view of the pictures; by default `Camera()`.

    Raises:
        OutputError: no back end of MuJoCo works here.
        ValueError: the size is zero, or larger than the model's buffer (1280 x 960).
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int = 640,
        height: int = 480,
        camera: Camera | None = None,
    ) -> None:
        most = model.vis.global_.offwidth, model.vis.global_.offheight
        if not (0 < width <= most[0] and 0 < height <= most[1]):
            raise ValueError(
                f"a picture of 1 x 1 to {most[0]} x {most[1]} pixels expected, {width} x {height} "
                "given"
            )
        try:
            self._renderer = mujoco.Renderer(model, height, width, MAX_SHAPES)
        except Exception as cause:  # each back end raises its own exceptions
            reason = str(cause).strip().split("\n")[0] or type(cause).__name__
            raise OutputError(
                f"cannot render: MuJoCo's back end {BACK_END!r} does not start ({reason}); install "
                "libegl1 or libosmesa6, or choose one with MUJOCO_GL=egl, osmesa or glfw"
            ) from cause
        view = camera or Camera()
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FREE.value
        self._camera.lookat = np.array(view.target)
        self._camera.distance = view.distance
        self._camera.azimuth, self._camera.elevation = view.azimuth, view.elevation

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the resources of the back end."""
        self._renderer.close()

    def picture(
        self, data: mujoco.MjData, forces: Array | None = None, load: Array | None = None
    ) -> Picture:
        """Render a picture of the current state.

        Args:
            data: MuJoCo's state, with computed positions of the bodies.
            forces: (n, 6) points [m] and forces [N] in the world, drawn as arrows that end at
                the points.
            load: (6,) begin and length of an arrow of another colour, for a load [m].
        """
        self._renderer.update_scene(data, self._camera)
        for row in np.zeros((0, 6)) if forces is None else forces:
            length = ARROW_LENGTH_PER_NEWTON * row[3:]
            if np.linalg.norm(row[3:]) > MIN_ARROW_FORCE:
                _draw_arrow(self._renderer.scene, row[:3] - length, length)
        if load is not None:
            _draw_arrow(self._renderer.scene, load[:3], load[3:], LOAD_COLOUR, LOAD_HALF_WIDTH)
        picture: Picture = self._renderer.render()
        return picture


def save_video(frames: Iterable[Picture], path: str | Path, fps: float) -> None:
    """Write a film in the format of its suffix: .gif, .png (animated), .webp or .mp4.

    Args:
        frames: pictures of one size.
        path: path of the film.
        fps: pictures per second.

    Raises:
        ValueError: the suffix is none of these, or there are no pictures.
        OutputError: the film is an .mp4, and ffmpeg is not installed or fails.
    """
    path = Path(path)
    check_film(path)
    pictures = iter(frames)
    first = next(pictures, None)
    if first is None:
        raise ValueError("a film of at least one picture expected, none given")
    frames = chain([first], pictures)
    if path.suffix.lower() == ".mp4":
        _save_mp4(first.shape, frames, path, fps)
        return
    from PIL import Image

    images = (Image.fromarray(frame) for frame in frames)
    if path.suffix.lower() != ".webp":  # 256 colours need less space and memory
        images = (image.quantize(256, dither=Image.Dither.NONE) for image in images)
    start, *others = images
    start.save(path, save_all=True, append_images=others, duration=1000 / fps, loop=0)


def check_film(path: str | Path) -> None:
    """Check whether a film of that name can be written here, before it is rendered.

    Raises:
        ValueError: the suffix is not that of a film.
        OutputError: the film is an .mp4, and ffmpeg is not installed.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FILM_SUFFIXES:
        raise ValueError(
            f"a film with the suffix {', '.join(FILM_SUFFIXES)} expected, {Path(path).name!r} given"
        )
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise OutputError(
            "an .mp4 needs the program ffmpeg, which is not installed; "
            f"{', '.join(ANIMATION_SUFFIXES)} work without it"
        )


def film(grasp: Grasp, path: Path) -> None:
    """Simulate a grasp and write its film in real time, with fingertip forces as arrows.

    Args:
        grasp: the grasp.
        path: path of the film; its suffix is its format.

    Raises:
        OutputError: no back end of MuJoCo works here, or the format needs a program that is not
            installed.
        ValueError: the suffix is not that of a film, or an object or profile is unknown.
    """
    frames: list[Picture] = []
    renderers: list[Renderer] = []
    n_samples = 0

    def take_picture(world: World, command: Command) -> None:
        nonlocal n_samples
        del command
        n_samples += 1
        if not renderers:
            renderers.append(Renderer(world.hand.model))
        if n_samples % SAMPLES_PER_PICTURE == 0:
            positions = world.bodies[:-1, :3]
            arrows = np.column_stack([positions, world.contact.contact_force])
            frames.append(renderers[0].picture(world.hand.data, arrows))

    try:
        simulate(grasp, on_sample=take_picture)
    finally:
        for renderer in renderers:
            renderer.close()
    save_video(frames, path, RATE / SAMPLES_PER_PICTURE)


def _draw_arrow(
    scene: mujoco.MjvScene,
    begin: Array,
    length: Array,
    colour: tuple[float, ...] = ARROW_COLOUR,
    half_width: float = ARROW_HALF_WIDTH,
) -> None:
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    kind = mujoco.mjtGeom.mjGEOM_ARROW.value
    mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), np.array(colour, "f4"))
    # Half of the length is drawn.
    mujoco.mjv_connector(geom, kind, half_width, begin, begin + 2 * length)
    scene.ngeom += 1


def _save_mp4(shape: tuple[int, ...], frames: Iterable[Picture], path: Path, fps: float) -> None:
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{shape[1]}x{shape[0]}"]
    # Players expect half the resolution in colours, and so even sides.
    even = ["-pix_fmt", "yuv420p", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2"]
    program = ["ffmpeg", "-y", "-loglevel", "error"]
    command = [*program, *source, "-r", f"{fps:g}", "-i", "-", *even, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        pipe = cast("IO[bytes]", process.stdin)
        with suppress(BrokenPipeError):  # it may stop before the last picture, and says why
            for frame in frames:
                pipe.write(frame.tobytes())
        messages = process.communicate()[1]
    if process.returncode:
        last_line = messages.decode(errors="replace").strip().split("\n")[-1]
        raise OutputError(f"cannot write {path.name}: ffmpeg reports {last_line or 'nothing'}")
