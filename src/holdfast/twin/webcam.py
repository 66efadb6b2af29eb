"""Video of a grasp as a webcam would film it: printed stickers on object and fingertips.

The stickers are drawn from the poses in the truth of a recording: through a lens with distortion,
over the time of an exposure, row after row, then blurred, with noise, and compressed. Bodies are
drawn as plain shapes. Light does not change and nothing reflects.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.errors import OutputError, RecordingError
from holdfast.recordings import Recording
from holdfast.sensors.types import Array
from holdfast.twin.hand import FINGERS
from holdfast.twin.objects import object_named
from holdfast.twin.simulation import generator_of
from holdfast.twin.slip_events import GRASP_LINE, SIDEWAYS, UPRIGHT

TIP_SIZE, OBJECT_SIZE = 0.015, 0.024
"""Sides of the black squares of stickers for fingertips, which are 28 mm wide, and objects [m]."""
RIM = 1 / 6
"""White rim of a sticker, as a share of its side: one cell of the pattern."""
FLAG = (0.014, 0.0, 0.031)
"""Middle of the sticker of a fingertip, in its frame [m]: on a flag of card that begins at the end
of the fingertip, in the plane of the contact. A sticker on the back is 40 mm behind the contact,
and moves against the object when the two only roll."""
ABOVE_INDEX = 0.030
"""Height of the sticker on the object above that of the index finger [m]."""
VISIBLE = FINGERS[1:]
"""Fingers that the camera sees; the thumb is behind the object."""
TEXTURE_CELL = 16
"""Side of a cell of the pattern of a sticker [pixels of its texture]."""
N_SUBPIXELS, N_INSTANTS = 3, 3
"""Lines of subpixels in a pixel, and instants in an exposure, over which a picture is averaged."""


class Webcam(NamedTuple):
    """A webcam before the hand.

    Attributes:
        fps: pictures per second [Hz].
        width, height: of the pictures [pixels].
        focal_length: 65 degrees from left to right [pixels].
        middle: of the lens, away from the middle of the picture [pixels].
        distortion: of radius squared and its square; lenses of webcams have a few percent.
        distance: from the object [m].
        turn: of the view away from the normal of the contact, to the side and down [rad].
        exposure: [s].
        row_time: from the first row of a picture to the last [s]: the shutter rolls.
        blur: standard deviation of the blur of the lens [pixels].
        noise: standard deviation of the noise, of 255 steps.
    """

    fps: float = 60.0
    width: int = 1280
    height: int = 720
    focal_length: float = 1000.0
    middle: tuple[float, float] = (9.0, -7.0)
    distortion: tuple[float, float] = (-0.08, 0.02)
    distance: float = 0.4
    turn: tuple[float, float] = (0.3, 0.25)
    exposure: float = 0.008
    row_time: float = 0.012
    blur: float = 0.7
    noise: float = 2.5

    def project(self, points: Array, origin: Array) -> Array:
        """Return where points are in the picture.

        Args:
            points: (..., 3) in the world [m].
            origin: (3,) of the object, at which the camera is aimed [m].

        Returns:
            (..., 2) column and row [pixels].
        """
        side, down = self.turn
        view = -(np.cos(side) * GRASP_LINE + np.sin(side) * SIDEWAYS)
        view = np.cos(down) * view - np.sin(down) * UPRIGHT
        right = np.cross(view, UPRIGHT)
        right /= np.linalg.norm(right)
        seen = (points - origin + self.distance * view) @ np.array(
            [right, np.cross(view, right), view]
        ).T
        flat = seen[..., :2] / seen[..., 2:]
        square = (flat**2).sum(axis=-1, keepdims=True)
        bent = flat * (1 + self.distortion[0] * square + self.distortion[1] * square**2)
        middle = np.array([self.width, self.height]) / 2 + self.middle
        return np.asarray(middle + self.focal_length * bent)


def clock_shift(recording: Recording) -> float:
    """Return how much later the clock of the samples is than that of the video [s].

    A person starts the camera before or after the recording. It is a number of the recording.
    """
    return float(generator_of(0, f"camera {recording.name}").uniform(-0.4, 0.4))


def film_stickers(recording: Recording, path: Path, camera: Webcam = Webcam()) -> Array:  # noqa: B008 (immutable)
    """Write the .mp4 of a recording of the twin; it begins `clock_shift` before the samples.

    Args:
        recording: with the poses of object and fingertips in its truth.
        path: path of the film.
        camera: the webcam.

    Returns:
        (n_pictures,) times at which the pictures are taken, on the clock of the samples [s].

    Raises:
        RecordingError: the recording has no poses.
        OutputError: the film cannot be written.
    """
    import cv2

    outlines, stickers, times = _in_picture(recording, camera)
    generator = generator_of(0, f"picture {recording.name}")
    size = (camera.height, camera.width)
    wall = cv2.GaussianBlur(generator.normal(0, 1, size).astype("f4"), (0, 0), 9)
    wall = 125 + 12 * wall / wall.std()
    # Noise is drawn once, with room to cut it elsewhere for each picture.
    noise = generator.normal(0, camera.noise, (camera.height + 64, camera.width + 64)).astype("f4")
    film = cv2.VideoWriter(
        str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), camera.fps, size[::-1]
    )
    if not film.isOpened():
        raise OutputError(f"cannot write {path.name}: OpenCV has no codec for .mp4 here")
    shift = clock_shift(recording)
    drawn = np.concatenate([corners.reshape(-1, 2) for corners in stickers.values()])
    low, high = drawn.min(axis=0).clip(20) - 20, drawn.max(axis=0).clip(20) + 20
    busy = slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))  # the wall is smooth
    n_pictures = int((times[-1] - times[0]) * camera.fps)
    taken = times[0] + shift + np.arange(n_pictures) / camera.fps
    for time in taken:
        picture = wall.copy()
        for grey, half_width, line in outlines:
            ends = [(round(x), round(y)) for x, y in _at(time, times, line)]
            cv2.line(picture, ends[0], ends[1], grey, max(int(2 * half_width), 1), cv2.LINE_AA)
        for number, corners in stickers.items():
            _draw(picture, _texture(number), corners, times, time, camera)
        inside = picture[busy]
        inside[:] = cv2.GaussianBlur(inside, (0, 0), camera.blur)
        row, column = generator.integers(0, 64, 2)
        picture += noise[row : row + camera.height, column : column + camera.width]
        film.write(cv2.cvtColor(picture.clip(0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR))
    film.release()
    return np.asarray(taken)


def _in_picture(
    recording: Recording, camera: Webcam
) -> tuple[list[tuple[float, float, Array]], dict[int, Array], Array]:
    """Return bodies (grey, half width, (n, 2, 2) ends) and stickers (n, 4, 2) in the picture."""
    truth = recording.truth
    if truth is None or "object_pose" not in truth.hand:
        raise RecordingError(
            f"recording {recording.name!r} has no poses; one that holdfast simulate made expected"
        )
    held = np.flatnonzero(truth.hand["phase"] == "locked")
    first = int(held[0]) if len(held) else len(truth.times) // 2
    pose = truth.hand["object_pose"]
    item = object_named(str(recording.metadata["object"]))
    origin, turned = pose[first, :3], _matrices(pose[first : first + 1])[0]

    def seen(of: Array, points: Array) -> Array:
        moved = of[:, None, :3] + np.einsum("nij,kj->nki", _matrices(of), points)
        return camera.project(moved, origin)

    axis = np.array([[0.0, 0.0, -item.half_height], [0.0, 0.0, item.half_height]])
    per_metre = camera.focal_length / camera.distance
    bodies = [(90.0, item.radius * per_metre, seen(pose, axis))]
    stickers, heights = {}, []
    for finger in VISIBLE:
        tip = truth.fingers[finger]["tip_pose"]
        bodies.append(
            (170.0, 0.0136 * per_metre, seen(tip, np.array([[-0.0, 0, -0.03], [0.0, 0, 0.018]])))
        )
        flat = np.array(FLAG) + _square(TIP_SIZE, [0.0, -1.0, 0.0], [0.0, 0.0, 1.0])
        stickers[FINGERS.index(finger) + 1] = seen(tip, flat)
        heights.append(tip[first, 2])
    across = np.cross(UPRIGHT, GRASP_LINE)
    middle = item.radius * GRASP_LINE
    middle[2] = max(heights) + ABOVE_INDEX - origin[2]
    flat = (middle + _square(OBJECT_SIZE, across, UPRIGHT)) @ turned  # in the frame of the object
    return bodies, {0: seen(pose, flat)} | stickers, truth.times


def _square(side: float, right: npt.ArrayLike, up: npt.ArrayLike) -> Array:
    """Return the corners of the black square (4, 3): upper left, then clockwise [m]."""
    along = side / 2 * np.array([right, up])
    return np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) @ along


def _matrices(pose: Array) -> Array:
    from scipy.spatial.transform import Rotation

    # SciPy has the scalar of a quaternion last, a pose has it first.
    return np.asarray(Rotation.from_quat(np.roll(pose[:, 3:], -1, axis=1)).as_matrix())


def _at(time: float, times: Array, track: Array) -> Array:
    """Return (k, 2) of (n, k, 2) at a time; at the ends that of the first or last sample."""
    index = np.interp(time, times, np.arange(len(times)))
    before = min(int(index), len(times) - 2)
    return np.asarray(track[before] + (index - before) * (track[before + 1] - track[before]))


def _texture(number: int) -> npt.NDArray[np.float32]:
    """Return a sticker as grey values, with its white rim."""
    import cv2

    book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    black = cv2.aruco.generateImageMarker(book, number, 6 * TEXTURE_CELL)
    rim = round(6 * TEXTURE_CELL * RIM)
    ink = np.pad(black, rim, constant_values=255).astype(np.float32)
    return np.asarray(35 + 185 * ink / 255, dtype=np.float32)


def _draw(
    picture: npt.NDArray[np.float32],
    texture: npt.NDArray[np.float32],
    corners: Array,
    times: Array,
    time: float,
    camera: Webcam,
) -> None:
    """Draw a sticker into a picture, whose first row is exposed from `time` on."""
    import cv2

    at = _at(time, times, corners)
    # The rows of one sticker are exposed at nearly the same time: that of its middle.
    time += camera.row_time * at[:, 1].mean() / camera.height
    low = np.floor(at.min(axis=0) - 0.4 * np.ptp(at, axis=0)).astype(int)
    high = np.ceil(at.max(axis=0) + 0.4 * np.ptp(at, axis=0)).astype(int)
    if (low < 0).any() or (high >= [camera.width, camera.height]).any():
        return  # a sticker at the edge of the picture is not seen
    part = picture[low[1] : high[1], low[0] : high[0]]
    below = cv2.resize(part, None, fx=N_SUBPIXELS, fy=N_SUBPIXELS, interpolation=cv2.INTER_NEAREST)
    rim = texture.shape[0] * RIM / (1 + 2 * RIM)
    far = texture.shape[0] - rim
    # OpenCV counts pixels from the middle of the first.
    source = np.array([[rim, rim], [far, rim], [far, far], [rim, far]], "f4") - 0.5
    total = np.zeros_like(part)
    for k in range(N_INSTANTS):
        at = _at(time + camera.exposure * (k + 0.5) / N_INSTANTS, times, corners)
        target = (N_SUBPIXELS * (at - low + 0.5) - 0.5).astype("f4")
        turn = cv2.getPerspectiveTransform(source, target)
        fine = cv2.warpPerspective(
            texture, turn, below.shape[::-1], below.copy(), cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_TRANSPARENT,
        )  # fmt: skip
        total += cv2.resize(fine, part.shape[::-1], interpolation=cv2.INTER_AREA)
    part[:] = total / N_INSTANTS
