"""Printed stickers (ArUco markers) in a video: where each one is, picture by picture.

A sticker is found by its pattern, and then followed: its first picture is laid over each later one
until both agree (inverse compositional alignment, Baker and Matthews 2004). All its edges count, so
the place is exact to a few hundredths of a pixel, where single corners are five times worse.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError

Picture = npt.NDArray[np.uint8]
Array = npt.NDArray[np.float64]

MAX_VIDEO = 4_000_000_000
"""Largest video that is read [bytes]: an hour of a phone."""
MAX_PIXELS = 3840 * 2160
"""Most pixels of a picture."""
N_MARKERS = 50
"""Markers in the book of patterns, DICT_4X4_50."""
PICTURES_PER_PART = 60
"""Pictures after which the places are passed on."""
SEARCH_PICTURES = 15
"""A marker that is not in sight is looked for in every picture of this number."""
N_POINTS = 36
"""Points along a side of the template of a marker."""
TEMPLATE_SIDE = 1.2
"""Side of the template, in sides of the marker: its white rim counts too."""
MAX_ROUNDS = 12
SETTLED = 2e-4
"""Most rounds of an alignment, and the step that ends it, in sides of the marker."""
MIN_LIKENESS = 0.8
"""Correlation with the template below which a marker is lost: covered, blurred or out of sight."""
CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
"""Corners of a marker in its own plane, in the order of OpenCV: x right, y down, sides of 1."""


def marker_places(path: Path, fps: float | None = None) -> Iterator[tuple[Array, Array]]:
    """Yield times and places of all markers, part by part.

    Args:
        path: of the video.
        fps: pictures per second; None takes the stamps of the file, which may be irregular.

    Yields:
        (n,) times [s] and (n, N_MARKERS, 2, 3) affine maps from the plane of a marker, with sides
        of 1, to the picture [pixels] from its middle; NaN where a marker is not seen.

    Raises:
        RecordingError: the file is no video that can be decoded here, or too large.
    """
    import cv2

    cv2.setNumThreads(1)
    film = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
    if not film.isOpened():
        raise RecordingError(
            f"{path} is no video that OpenCV can decode here: a file with a codec such as H.264, "
            "MPEG-4 or MJPEG expected (`ffmpeg -i IN out.mp4` converts others)"
        )
    width, height = (film.get(k) for k in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    if width * height > MAX_PIXELS:
        raise RecordingError(
            f"{path} has pictures of {width:.0f} x {height:.0f} pixels; at most 3840 x 2160 "
            "expected"
        )
    book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    finder = cv2.aruco.ArucoDetector(book, cv2.aruco.DetectorParameters())
    followed: dict[int, _Marker] = {}
    times: list[float] = []
    places: list[Array] = []
    n = 0
    while film.grab():
        stamp = film.get(cv2.CAP_PROP_POS_MSEC) / 1000 if fps is None else n / fps
        is_read, picture = film.retrieve()
        if not is_read:
            continue
        grey = np.ascontiguousarray(picture[:, :, 1])
        now = np.full((N_MARKERS, 2, 3), np.nan)
        lost = [k for k, marker in followed.items() if not marker.follow(grey)]
        if n % SEARCH_PICTURES == 0 or lost:
            if lost or not followed or n % (4 * SEARCH_PICTURES) == 0:
                _search(finder, grey, followed)
        for k, marker in followed.items():
            if marker.is_seen:
                now[k] = marker.place
        now[:, :, 2] -= [(width - 1) / 2, (height - 1) / 2]
        times.append(stamp)
        places.append(now)
        n += 1
        if n % PICTURES_PER_PART == 0:
            yield np.array(times), np.array(places)
            times, places = [], []
    if times:
        yield np.array(times), np.array(places)


def _search(finder: Any, grey: Picture, followed: "dict[int, _Marker]") -> None:  # noqa: ANN401 (OpenCV)
    """Find markers by their pattern that are not followed."""
    corners, numbers, _ = finder.detectMarkers(grey)
    for outline, k in zip(corners, [] if numbers is None else numbers.ravel(), strict=False):
        if k not in followed:
            followed[int(k)] = _Marker(grey, outline[0])
        elif not followed[int(k)].is_seen:
            followed[int(k)].start(outline[0])
            followed[int(k)].follow(grey)


class _Marker:
    """A marker that is followed from picture to picture.

    Attributes:
        place: (2, 3) affine map from its plane to the picture [pixels].
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
        x, y, right, down = x.ravel(), y.ravel(), right.ravel(), down.ravel()
        steepest = np.stack([right * x, right * y, right, down * x, down * y, down], axis=1)
        self._solve = np.linalg.pinv(steepest)

    def start(self, corners: Array) -> None:
        """Take the place from the corners (4, 2) [pixels]."""
        plane = np.column_stack([CORNERS, np.ones(4)])
        self.place = np.linalg.lstsq(plane, corners.astype(np.float64), rcond=None)[0].T

    def follow(self, grey: Picture) -> bool:
        """Find the marker near its last place; return whether it is there."""
        place = self.place
        for _ in range(MAX_ROUNDS):
            now = self._sample(grey, place)
            step = self._solve @ (now - self._template)
            change = np.eye(3)
            change[:2] += step.reshape(2, 3)
            place = place @ np.linalg.inv(change)
            if np.abs(step).max() < SETTLED:
                break
        likeness = float(now @ self._template) / len(now)
        size = abs(np.linalg.det(place[:, :2]))
        self.is_seen = likeness > MIN_LIKENESS and 64 < size < grey.size / 4
        if self.is_seen:
            self.place = place
        return self.is_seen

    def _sample(self, grey: Picture, place: Array | None = None) -> Array:
        """Return the grey values on the grid of the template, with mean 0 and variance 1."""
        import cv2

        place = self.place if place is None else place
        grid = np.array([[self._scale, 0, 0], [0, self._scale, 0], [0, 0, 1.0]])
        grid[:2, 2] = TEMPLATE_SIDE * (0.5 / N_POINTS - 0.5)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        seen = cv2.warpAffine(grey, place @ grid, (N_POINTS, N_POINTS), flags=flags)
        values = seen.astype(np.float64).ravel()
        return np.asarray((values - values.mean()) / max(values.std(), 1.0))
