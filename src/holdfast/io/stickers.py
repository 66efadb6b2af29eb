"""Printed stickers (ArUco markers) in a video: where each one is, picture by picture.

A sticker is found by its pattern, and then followed: its first picture is laid over each later one
until both agree (inverse compositional alignment, Baker and Matthews 2004). All its edges count, so
the position is exact to a few hundredths of a pixel, where single corners are five times worse.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.files import read_input

Picture = npt.NDArray[np.uint8]
Array = npt.NDArray[np.float64]

MAX_STAMPS = 50_000_000
"""Largest file of times of pictures [bytes]: four million pictures."""
_CONTAINER = re.compile(
    rb"....(ftyp|moov|mdat|wide|free|skip)|RIFF....AVI |\x1a\x45\xdf\xa3|\0\0\x01\xba|G.{187}G",
    re.DOTALL,
)
"""First bytes of MP4 and MOV; AVI; Matroska and WebM; MPEG program and transport streams."""
PICTURES_PER_PART = 60
"""Pictures after which the poses are passed on."""
SEARCH_PICTURES, RARE_SEARCH_PICTURES = 3, 60
"""A search through the whole picture takes as long as following 20 stickers: it is done once in
this number of pictures, with a sticker that is lost, and without."""
N_POINTS = 36
"""Points along a side of the template of a sticker."""
TEMPLATE_SIDE = 1.2
"""Side of the template, in sides of the sticker: its white rim counts too."""
MAX_ROUNDS = 12
SETTLED = 2e-4
"""Most rounds of an alignment, and the step that ends it, in sides of the sticker."""
MIN_LIKENESS = 0.8
"""Correlation with the template below which a sticker is lost: covered, blurred or out of sight."""
CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
"""Corners of a sticker in its own plane, in the order of OpenCV: x right, y down, sides of 1."""


def stamps_path(video: Path) -> Path:
    """Return the path of the times of the pictures of a video, which `record --camera` writes."""
    return video.with_suffix(".times")


def picture_stamps(video: Path) -> Array | None:
    """Return the times (n,) of the pictures of a video [s]; None if no file beside it has them.

    Raises:
        RecordingError: the file has something else, or times that do not increase.
    """
    path = stamps_path(video)
    stamps = np.zeros(2)
    try:
        text = read_input(path, MAX_STAMPS, follow=False)
        # A process that was killed may have written half of the last line.
        stamps = np.array([float(line) for line in text.split(b"\n")[:-1]])
    except FileNotFoundError:
        return None
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror}") from cause
    except ValueError:  # it is refused below
        pass
    if not np.isfinite(stamps).all() or (np.diff(stamps) <= 0).any():
        raise RecordingError(f"{path}: a time in each line [s], each later than the last, expected")
    return stamps


def check_video(path: Path) -> None:
    """Check that a file begins as a container of videos.

    FFmpeg opens texts too (`ffconcat`, playlists), which name other files and addresses.

    Raises:
        RecordingError: it begins with something else, or cannot be read.
    """
    try:
        with path.open("rb") as file:
            begin = file.read(192)
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror}") from cause
    if not _CONTAINER.match(begin):
        raise RecordingError(
            f"{path} is no video: a file of MP4, MOV, AVI, Matroska, WebM or MPEG expected"
        )


def sticker_poses(
    path: Path, fps: float | None = None
) -> Iterator[tuple[Array, Array, dict[int, Array]]]:
    """Yield times, brightness and poses of all stickers, part by part.

    Args:
        path: of the video.
        fps: pictures per second; None takes the stamps of the file, which may be irregular.

    Yields:
        (n,) times [s], (n,) brightness of the pictures, and by number (n, 2, 3) affine maps from
        the plane of a sticker, with sides of 1, to the picture [pixels] from its middle; NaN where
        it is not seen.

    Raises:
        RecordingError: the file is no video that can be decoded here.
    """
    import cv2

    # The stacks of more threads would count as memory of the child.
    cv2.setNumThreads(1)
    check_video(path)
    # An absolute path: FFmpeg takes `concat:a` for an address.
    film = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
    if not film.isOpened():
        raise RecordingError(
            f"{path} is no video that OpenCV can decode here: one in H.264, MPEG-4 or MJPEG "
            "expected (`ffmpeg -i IN out.mp4` converts others)"
        )
    size_of = [int(film.get(k)) for k in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
    middle = (np.array(size_of) - 1) / 2
    search = _Search()
    times: list[float] = []
    levels: list[float] = []
    poses: list[dict[int, Array]] = []
    n = 0
    while film.grab():
        stamp = film.get(cv2.CAP_PROP_POS_MSEC) / 1000 if fps is None else n / fps
        # Also a damaged picture takes its time.
        n += 1
        is_read, picture = film.retrieve()
        if not is_read or (times and stamp <= times[-1]):
            continue  # damaged, or out of order
        times.append(stamp)
        seen = search.next(np.ascontiguousarray(picture[:, :, 1]))  # green is the sharpest
        levels.append(float(picture[::8, ::8, 1].mean()))
        poses.append({k: pose - [[0, 0, middle[0]], [0, 0, middle[1]]] for k, pose in seen})
        if len(times) > PICTURES_PER_PART:  # the last one stays, as the time before the next
            yield _part(times[:-1], levels[:-1], poses[:-1])
            times, levels, poses = times[-1:], levels[-1:], poses[-1:]
    if times:
        yield _part(times, levels, poses)


def _part(
    times: list[float], levels: list[float], poses: list[dict[int, Array]]
) -> tuple[Array, Array, dict[int, Array]]:
    unseen = np.full((2, 3), np.nan)
    numbers = sorted({k for seen in poses for k in seen})
    tracks = {k: np.array([s.get(k, unseen) for s in poses]) for k in numbers}
    return np.array(times), np.array(levels), tracks


class _Search:
    """Search for stickers, picture by picture: those that are known are followed."""

    def __init__(self) -> None:
        import cv2

        book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        self._finder = cv2.aruco.ArucoDetector(book, cv2.aruco.DetectorParameters())
        self._followed: dict[int, _Sticker] = {}
        self._n = 0

    def next(self, grey: Picture) -> list[tuple[int, Array]]:
        """Return number and pose of the stickers in the next picture."""
        lost = [k for k, sticker in self._followed.items() if not sticker.follow(grey)]
        if self._n % (SEARCH_PICTURES if lost else RARE_SEARCH_PICTURES) == 0:
            corners, numbers, _ = self._finder.detectMarkers(grey)
            for outline, number in zip(corners, np.ravel([] if numbers is None else numbers)):  # noqa: B905 (OpenCV gives None for none)
                k = int(number)
                if k not in self._followed:
                    self._followed[k] = _Sticker(grey, outline[0])
                elif k in lost:
                    self._followed[k].start(outline[0])
                    self._followed[k].follow(grey)
        self._n += 1
        return [(k, sticker.pose) for k, sticker in self._followed.items() if sticker.is_seen]


class _Sticker:
    """A sticker that is followed from picture to picture.

    Attributes:
        pose: (2, 3) affine map from its plane to the picture [pixels].
        is_seen: whether it is in the last picture.
    """

    def __init__(self, grey: Picture, corners: Array) -> None:
        self.is_seen = True
        self.start(corners)
        side = (np.arange(N_POINTS) + 0.5) / N_POINTS - 0.5
        self._scale = TEMPLATE_SIDE / N_POINTS
        x, y = np.meshgrid(TEMPLATE_SIDE * side, TEMPLATE_SIDE * side)
        self._template = self._sample(grey)
        down, right = np.gradient(self._template.reshape(N_POINTS, N_POINTS), self._scale)
        steepest = [right * x, right * y, right, down * x, down * y, down]
        self._solve = np.linalg.pinv(np.stack([part.ravel() for part in steepest], axis=1))

    def start(self, corners: Array) -> None:
        """Take the pose from the corners (4, 2) [pixels]."""
        plane = np.column_stack([CORNERS, np.ones(4)])
        self.pose: Array = np.linalg.lstsq(plane, corners.astype(np.float64), rcond=None)[0].T

    def follow(self, grey: Picture) -> bool:
        """Find the sticker near its last pose; return whether it is there."""
        pose = self.pose
        for _ in range(MAX_ROUNDS):
            now = self._sample(grey, pose)
            step = self._solve @ (now - self._template)
            change = np.eye(3)
            change[:2] += step.reshape(2, 3)
            # The step moves the template to the picture; the pose moves the other way.
            pose = pose @ np.linalg.inv(change)
            if np.abs(step).max() < SETTLED:
                break
        likeness = float(now @ self._template) / len(now)
        size = abs(np.linalg.det(pose[:, :2]))
        # In 8 x 8 pixels, the 6 x 6 cells of a pattern are hardly seen.
        self.is_seen = likeness > MIN_LIKENESS and 64 < size < grey.size / 4
        if self.is_seen:
            self.pose = pose
        return self.is_seen

    def _sample(self, grey: Picture, pose: Array | None = None) -> Array:
        """Return the grey values on the grid of the template, with mean 0 and variance 1."""
        import cv2

        pose = self.pose if pose is None else pose
        grid = np.array([[self._scale, 0, 0], [0, self._scale, 0], [0, 0, 1.0]])
        grid[:2, 2] = TEMPLATE_SIDE * (0.5 / N_POINTS - 0.5)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        seen = cv2.warpAffine(grey, pose @ grid, (N_POINTS, N_POINTS), flags=flags)
        values = seen.astype(np.float64).ravel()
        # A plain area has no variance: its noise must not become a pattern.
        return np.asarray((values - values.mean()) / max(values.std(), 1.0))
