"""How an object moves against what holds it: relative poses, speeds, and their noise."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import convolve1d
from scipy.spatial.transform import Rotation

from holdfast.labelling.rules.poses import Track
from holdfast.metrics.masks import Mask, covered, n_samples_of
from holdfast.sensors.types import Array

BRIDGED = 0.1
"""Gaps in the poses that are bridged [s]."""
SMOOTHING = 0.15
"""Over which a straight line is laid through the poses to read their speed [s]."""


@dataclass(frozen=True, eq=False)
class Motion:
    """The object's pose in the frame of what holds it, on a grid, and how fast it changes.

    Attributes:
        position: (n, 3) [m].
        matrix: (n, 3, 3) its rotation; near enough, where poses are interpolated.
        speed: (n,) of the object's material at the contact [m/s]; NaN without poses.
        spin: (n,) [rad/s]; NaN without poses.
        speed_noise: standard deviation that the jitter of the poses gives a body at rest [m/s].
        spin_noise: the same [rad/s].
        known: (n,) where there are poses.
    """

    position: Array
    matrix: Array
    speed: Array
    spin: Array
    speed_noise: float
    spin_noise: float
    known: Mask

    def away_from(self, place: Array, turn: Array, point: Array | None) -> tuple[Array, Array]:
        """How far it is from a pose: its material at the contact (n,) [m], and turned (n,) [rad].

        Args:
            place: (3,) position to measure from [m].
            turn: (3, 3) rotation to measure from.
            point: (3,) of the contact [m]; None for the object's own origin.
        """
        inside = np.zeros(3) if point is None else turn.T @ (point - place)
        moved = self.position - place + (self.matrix - turn) @ inside
        chord = np.linalg.norm(self.matrix - turn, axis=(1, 2)) / np.sqrt(8)
        return np.linalg.norm(moved, axis=1), 2 * np.arcsin(np.minimum(chord, 1.0))


def relative(thing: Track, tip: Track | None) -> Track:
    """The object's pose in the frame of the fingertip, at the times of the object's poses.

    Poses of the fingertip are linear between theirs.
    """
    if tip is None:
        return thing
    here = _at(tip, thing.times)
    seen = thing.seen & here.seen
    positions, quaternions = np.full((len(seen), 3), np.nan), np.full((len(seen), 4), np.nan)
    back = _rotation(here.quaternions[seen]).inv()
    positions[seen] = back.apply(thing.positions[seen] - here.positions[seen])
    turned = back * _rotation(thing.quaternions[seen])
    quaternions[seen] = np.roll(turned.as_quat(), 1, axis=1)
    return Track(thing.times, positions, quaternions)


def motion_of(track: Track, grid: Array, point: Array | None = None, offset: float = 0.0) -> Motion:
    """The motion of an object against a frame, on a grid of time.

    The rotation is taken as a matrix of nine numbers: their rates of change give the spin, and
    with it the speed of the material at the contact, v = dp/dt + dR/dt u, whatever the angle.

    Args:
        track: of the object, in that frame; in sight twice at least.
        grid: (n,) [s].
        point: (n, 3) of the contact, in that frame [m]; None for the object's own origin.
        offset: by which the clock of the poses is behind that of the grid [s].
    """
    seen = track.seen
    times = track.times[seen] + offset
    matrices = _rotation(track.quaternions[seen]).as_matrix().reshape(-1, 9)
    numbers = np.concatenate([track.positions[seen], matrices], axis=1)
    period = float(grid[1] - grid[0])
    pose = np.stack([np.interp(grid, times, column) for column in numbers.T], axis=1)
    rate = slope(pose, period)
    place, turn = pose[:, :3], pose[:, 3:].reshape(-1, 3, 3)
    inside = np.zeros_like(place)
    if point is not None:
        inside = np.einsum("nji,nj->ni", turn, point - place)
    velocity = rate[:, :3] + np.einsum("nij,nj->ni", rate[:, 3:].reshape(-1, 3, 3), inside)
    known = covered(grid, times, BRIDGED)
    jitter = _slope_noise(numbers, float(np.median(np.diff(times))))
    lever = float(np.median(np.linalg.norm(inside, axis=1)))
    spin_noise = float(np.linalg.norm(jitter[3:]) / np.sqrt(2))
    return Motion(
        position=place,
        matrix=turn,
        speed=np.where(known, np.linalg.norm(velocity, axis=1), np.nan),
        spin=np.where(known, np.linalg.norm(rate[:, 3:], axis=1) / np.sqrt(2), np.nan),
        speed_noise=float(np.hypot(np.linalg.norm(jitter[:3]), lever * spin_noise)),
        spin_noise=spin_noise,
        known=known,
    )


def slope(values: Array, period: float) -> Array:
    """(n, k) rate of change: that of the straight line through SMOOTHING about each sample."""
    half = max(n_samples_of(SMOOTHING, period) // 2, 1)
    places = np.arange(-half, half + 1)
    weights = places / ((places**2).sum() * period)
    return np.asarray(convolve1d(values, weights[::-1], axis=0, mode="nearest"))


def _slope_noise(values: Array, step: float) -> Array:
    """(k,) standard deviation of the slope that jitter alone makes.

    The jitter is read off second differences, to which smooth motion adds little; their median
    is that of the calmer half, and so of rest.
    """
    if len(values) < 3:
        return np.zeros(values.shape[1])
    second = values[2:] - 2 * values[1:-1] + values[:-2]
    jitter = np.median(np.abs(second), axis=0) / (0.6745 * np.sqrt(6))
    half = max(n_samples_of(SMOOTHING, step) // 2, 1)
    return np.asarray(jitter / (step * np.sqrt((np.arange(-half, half + 1) ** 2).sum())))


def _at(track: Track, times: Array) -> Track:
    """The track at other times; NaN where its poses are further apart than BRIDGED."""
    seen = track.seen
    known = covered(times, track.times[seen], BRIDGED)
    positions, quaternions = np.full((len(times), 3), np.nan), np.full((len(times), 4), np.nan)
    if known.any():
        own = track.times[seen]
        values = np.concatenate([track.positions[seen], _continuous(track.quaternions[seen])], 1)
        there = np.stack([np.interp(times, own, column) for column in values.T], axis=1)
        positions[known] = there[known, :3]
        turns = there[known, 3:]
        quaternions[known] = turns / np.linalg.norm(turns, axis=1, keepdims=True)
    return Track(times, positions, quaternions)


def _continuous(quaternions: Array) -> Array:
    """The same rotations, each by the quaternion that is nearer to the one before."""
    flips = np.sign((quaternions[1:] * quaternions[:-1]).sum(axis=1))
    signs = np.concatenate([[1.0], np.cumprod(np.where(flips == 0, 1.0, flips))])
    return np.asarray(quaternions * signs[:, None])


def _rotation(quaternions: Array) -> Rotation:
    return Rotation.from_quat(np.roll(quaternions, -1, axis=-1))


FARTHEST = 0.5
"""Offsets that are tried, to both sides [s]."""
ALIKE = 0.3
"""Correlation from which on the two are believed to show the same motion."""


class Offset(NamedTuple):
    """What is added to the times of one to have them on the clock of the other.

    Attributes:
        seconds: the offset [s]; 0 where the two are not alike at any.
        alike: their correlation there, from -1 to 1.
    """

    seconds: float
    alike: float

    @property
    def believed(self) -> bool:
        """Whether the two are alike enough to believe it."""
        return self.alike >= ALIKE


def offset_of(seen: Array, felt: Array, known: Mask, period: float) -> Offset:
    """By how much what was seen is behind what was felt, on one grid.

    The logarithms of both are compared, by the correlation of ranks in all but name: one huge
    knock must not outvote all else.

    Args:
        seen: (n,) how much moved, at least 0.
        felt: (n,) how much was felt, at least 0.
        known: (n,) where something was seen.
        period: of the grid [s].
    """
    reach = min(round(FARTHEST / period), len(seen) // 2)
    a, b = _level(seen, known), _level(felt, np.ones_like(known))
    found = [(_alike(a, b, known, shift), -abs(shift), shift) for shift in range(-reach, reach + 1)]
    alike, _, shift = max(found)
    return Offset(shift * period if alike >= ALIKE else 0.0, alike)


def _level(values: Array, known: Mask) -> Array:
    """Ranks between 0 and 1 where values are known; 0 elsewhere."""
    level = np.zeros(len(values))
    inside = values[known]
    order = np.argsort(np.argsort(inside, kind="stable"), kind="stable")
    level[known] = order / max(len(inside) - 1, 1)
    return level


def _alike(a: Array, b: Array, known: Mask, shift: int) -> float:
    """The correlation of a, later by `shift` samples, with b."""
    n = len(a)
    first, last = max(0, -shift), min(n, n - shift)
    mask = known[first:last]
    x, y = a[first:last][mask], b[first + shift : last + shift][mask]
    if len(x) < 3 or x.std() == 0 or y.std() == 0:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])
