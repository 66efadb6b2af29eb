"""Pictures and films of the twin, rendered without a screen."""

import shutil
import subprocess
import sys
from collections.abc import Iterable
from ctypes.util import find_library
from importlib import import_module
from itertools import chain
from os import environ
from pathlib import Path
from typing import IO, NamedTuple, Protocol, cast

import mujoco
import numpy as np
import numpy.typing as npt

from holdfast.errors import OutputError
from holdfast.sensors.types import Array

Picture = npt.NDArray[np.uint8]
"""(height, width, 3) red, green, blue."""

STILLS = (".gif", ".png", ".webp")
"""Films that need nothing but Pillow, which comes with matplotlib; `.png` is an animated one."""
FILMS = (*STILLS, ".mp4")
"""All films; `.mp4` needs the program ffmpeg."""
NEWTON = 0.012
"""Length of the arrow of a force of one newton [m]."""
ARROW = 0.002
"""Half width of an arrow [m]."""
GLOW = (0.80, 0.10, 0.16, 1.0)
"""Colour of the arrows."""


class Camera(NamedTuple):
    """Where the picture is taken from.

    Attributes:
        target: (3,) the point in its middle [m].
        distance: from there [m].
        azimuth: direction of view about the vertical [degrees]; 90 looks along y.
        elevation: of the direction of view [degrees]; negative looks down.
    """

    target: tuple[float, float, float] = (0.07, -0.014, 0.006)
    distance: float = 0.32
    azimuth: float = 162.0
    elevation: float = -36.0


class _Context(Protocol):
    """What MuJoCo's back ends have in common."""

    def make_current(self) -> None: ...

    def free(self) -> None: ...


class Studio:
    """Takes pictures of a model, many from one studio. A context manager: it holds a renderer.

    Args:
        model: of MuJoCo.
        width: of the pictures [pixels].
        height: of the pictures [pixels].
        camera: where they are taken from.

    Raises:
        OutputError: no renderer is at hand.
        ValueError: no pixels, or more than the model's buffer has (1280 x 960).
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        width: int = 640,
        height: int = 480,
        camera: Camera | None = None,
    ) -> None:
        _check_size(model, width, height)
        self._model = model
        self._context = _context(width, height)
        self._scene = mujoco.MjvScene(model, maxgeom=1000)
        self._options = mujoco.MjvOption()
        self._camera = _aimed(camera or Camera())
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._canvas = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._canvas)

    def __enter__(self) -> "Studio":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Gives the renderer back."""
        self._context.make_current()
        self._canvas.free()
        self._context.free()

    def picture(self, data: mujoco.MjData, forces: Array | None = None) -> Picture:
        """What it looks like now.

        Args:
            data: of MuJoCo, positions of the bodies computed.
            forces: (n, 6) points [m] and forces [N] in the world, drawn as arrows that end there.
        """
        self._context.make_current()
        mujoco.mjv_updateScene(
            self._model, data, self._options, None, self._camera,
            mujoco.mjtCatBit.mjCAT_ALL.value, self._scene,
        )  # fmt: skip
        for row in np.zeros((0, 6)) if forces is None else forces:
            _draw_arrow(self._scene, row[:3], row[3:])
        mujoco.mjr_render(self._rect, self._scene, self._canvas)
        picture = np.empty((self._rect.height, self._rect.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(picture, None, self._rect, self._canvas)
        return np.ascontiguousarray(picture[::-1])


def render(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    width: int = 640,
    height: int = 480,
    camera: Camera | None = None,
    forces: Array | None = None,
) -> Picture:
    """One picture. For more than one use a `Studio`.

    Args:
        model: of MuJoCo.
        data: of MuJoCo, positions of the bodies computed.
        width: [pixels].
        height: [pixels].
        camera: where it is taken from.
        forces: (n, 6) points [m] and forces [N] in the world, drawn as arrows that end there.

    Returns:
        (height, width, 3) red, green, blue.

    Raises:
        OutputError: no renderer is at hand.
    """
    with Studio(model, width, height, camera) as studio:
        return studio.picture(data, forces)


def save_picture(picture: Picture, path: str | Path) -> None:
    """Writes a picture; Pillow chooses the format by the suffix."""
    from PIL import Image

    Image.fromarray(picture).save(path)


def save_video(frames: Iterable[Picture], path: str | Path, fps: float) -> None:
    """Writes a film, in the format of its suffix: .gif, .png (animated), .webp or .mp4.

    Args:
        frames: pictures of one size.
        path: of the film.
        fps: pictures per second.

    Raises:
        ValueError: another suffix, or no pictures.
        OutputError: .mp4, and ffmpeg is not installed, or fails.
    """
    path = Path(path)
    check_film(path)
    pictures = iter(frames)
    first = next(pictures, None)
    if first is None:
        raise ValueError("a film of no pictures")
    frames = chain([first], pictures)
    if path.suffix.lower() == ".mp4":
        _save_mp4(frames, path, fps)
    else:
        _save_animation(frames, path, fps)


def check_film(path: str | Path) -> None:
    """Whether a film of that name can be written here; to be known before it is rendered.

    Raises:
        ValueError: a suffix that is no film's.
        OutputError: .mp4, and ffmpeg is not installed.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FILMS:
        raise ValueError(f"a film ends in {', '.join(FILMS)}; {Path(path).name!r} given")
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise OutputError(
            "an .mp4 needs the program ffmpeg, which is not installed; "
            f"{', '.join(STILLS)} need nothing"
        )


def _check_size(model: mujoco.MjModel, width: int, height: int) -> None:
    most = model.vis.global_.offwidth, model.vis.global_.offheight
    if not (0 < width <= most[0] and 0 < height <= most[1]):
        raise ValueError(
            f"a picture of 1 x 1 to {most[0]} x {most[1]} pixels expected, {width} x {height} given"
        )


def _aimed(camera: Camera) -> mujoco.MjvCamera:
    aimed = mujoco.MjvCamera()
    aimed.type = mujoco.mjtCamera.mjCAMERA_FREE.value
    aimed.lookat = np.array(camera.target)
    aimed.distance = camera.distance
    aimed.azimuth = camera.azimuth
    aimed.elevation = camera.elevation
    return aimed


def _draw_arrow(scene: mujoco.MjvScene, point: Array, force: Array) -> None:
    if scene.ngeom >= scene.maxgeom or not np.linalg.norm(force) > 0.02:
        return
    geom = scene.geoms[scene.ngeom]
    kind = mujoco.mjtGeom.mjGEOM_ARROW.value
    mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), np.array(GLOW, "f4"))
    tail = point - NEWTON * force
    mujoco.mjv_connector(geom, kind, ARROW, tail, tail + 2 * NEWTON * force)  # half of it is drawn
    scene.ngeom += 1


def _context(width: int, height: int) -> "_Context":
    name = environ.get("MUJOCO_GL", "").lower().strip() or _back_end()
    try:
        context: _Context = import_module(f"mujoco.{name}").GLContext(width, height)
        context.make_current()
    except Exception as cause:  # every back end fails in its own way
        reason = str(cause).strip().split("\n")[0] or type(cause).__name__
        raise OutputError(
            f"no pictures here: the renderer {name!r} does not start ({reason}); install libegl1 "
            "or libosmesa6, or choose one by MUJOCO_GL=egl, osmesa or glfw"
        ) from cause
    return context


def _back_end() -> str:
    """The name of MuJoCo's back end that most likely works without a screen."""
    if sys.platform == "darwin":
        return "cgl"
    if sys.platform == "win32":
        return "glfw"
    return "osmesa" if find_library("EGL") is None and find_library("OSMesa") else "egl"


def _save_animation(frames: Iterable[Picture], path: Path, fps: float) -> None:
    from PIL import Image

    images = (Image.fromarray(frame) for frame in frames)
    if path.suffix.lower() != ".webp":  # 256 colours keep a film small, and its memory too
        images = (image.quantize(256, dither=Image.Dither.NONE) for image in images)
    first, *others = images
    first.save(path, save_all=True, append_images=others, duration=1000 / fps, loop=0)


def _save_mp4(frames: Iterable[Picture], path: Path, fps: float) -> None:
    pictures = iter(frames)
    first = next(pictures)
    command = _ffmpeg(first.shape, path, fps)
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        talk = _feed(process, chain([first], pictures))
    if process.returncode:
        told = talk.decode(errors="replace").strip().split("\n")[-1]
        raise OutputError(f"cannot write {path.name}: ffmpeg says {told or 'nothing'}")


def _ffmpeg(shape: tuple[int, ...], path: Path, fps: float) -> list[str]:
    """The command that makes a film of raw pictures."""
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{shape[1]}x{shape[0]}"]
    even = ["-pix_fmt", "yuv420p", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2"]
    talk = ["ffmpeg", "-y", "-loglevel", "error"]
    return [*talk, *source, "-r", f"{fps:g}", "-i", "-", *even, str(path)]


def _feed(process: "subprocess.Popen[bytes]", frames: Iterable[Picture]) -> bytes:
    """What ffmpeg says to the pictures; it may stop before it has seen all of them."""
    pipe = cast("IO[bytes]", process.stdin)
    try:
        for frame in frames:
            pipe.write(frame.tobytes())
    except BrokenPipeError:
        pass
    return process.communicate()[1]
