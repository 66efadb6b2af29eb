"""Motion of an object relative to a fingertip: poses, speeds, their noise, and clock offsets."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from holdfast.labelling.rules.poses import PoseTrack
from holdfast.metrics.masks import Mask, covered, n_samples_of
from holdfast.sensors.types import Array

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

MAX_POSE_GAP = 0.1
"""Longest gap between poses that is interpolated [s]."""
SPEED_WINDOW = 0.15
"""Length of the straight line that is fitted to the poses for their speed [s]."""
MAX_CLOCK_OFFSET = 0.5
"""Largest clock offset that is tried, in both directions [s]."""
MIN_CORRELATION = 0.3
"""Correlation from which two signals are taken to show the same motion."""


@dataclass(frozen=True, eq=False)
class RelativeMotion:
    """Pose of an object in another body's frame on a time grid, and its speed.

    Attributes:
        position: (n, 3) [m].
        matrix: (n, 3, 3) rotation; approximate between poses.
        speed: (n,) of the object's material at the contact [m/s]; NaN without poses.
        spin: (n,) angular speed [rad/s]; NaN without poses.
        speed_noise: standard deviation of the speed of a body at rest, from pose noise [m/s].
        spin_noise: standard deviation of its spin [rad/s].
        known: (n,) where there are poses.
    """

    position: Array
    matrix: Array
    speed: Array
    spin: Array
    speed_noise: float
    spin_noise: float
    known: Mask

    def away_from(self, position: Array, matrix: Array, point: Array | None) -> tuple[Array, Array]:
        """Return the distance (n,) [m] and the angle (n,) [rad] from a reference pose.

        The distance is that of the object's material at the contact.

        Args:
            position: (3,) of the reference pose [m].
            matrix: (3, 3) rotation of the reference pose.
            point: (3,) of the contact [m]; None for the origin of the object.
        """
        lever = np.zeros(3) if point is None else matrix.T @ (point - position)
        moved = self.position - position + (self.matrix - matrix) @ lever
        # |R - R_0| = sqrt(8) sin(angle / 2), in the Frobenius norm.
        chord = np.linalg.norm(self.matrix - matrix, axis=(1, 2)) / np.sqrt(8)
        return np.linalg.norm(moved, axis=1), 2 * np.arcsin(np.minimum(chord, 1.0))


class ClockOffset(NamedTuple):
    """Time that is added to one clock to get the time of another.

    Attributes:
        seconds: the offset [s]; 0 if the correlation is too low at every offset.
        correlation: of the two signals at that offset, from -1 to 1.
    """

    seconds: float
    correlation: float

    @property
    def reliable(self) -> bool:
        """Whether the correlation is high enough."""
        return self.correlation >= MIN_CORRELATION


def relative_track(body: PoseTrack, reference: PoseTrack | None) -> PoseTrack:
    """Return the poses of a body in the frame of a reference body, at the times of the body.

    Poses of the reference are interpolated linearly.

    Args:
        body: poses of the body.
        reference: poses of the reference; None if the body is already in its frame.
    """
    if reference is None:
        return body
    frame = _interpolated(reference, body.times)
    seen = body.seen & frame.seen
    positions, quaternions = np.full((len(seen), 3), np.nan), np.full((len(seen), 4), np.nan)
    inverse = _rotation(frame.quaternions[seen]).inv()
    positions[seen] = inverse.apply(body.positions[seen] - frame.positions[seen])
    turned = inverse * _rotation(body.quaternions[seen])
    quaternions[seen] = np.roll(turned.as_quat(), 1, axis=1)
    return PoseTrack(body.times, positions, quaternions)


def motion_of(
    track: PoseTrack, grid: Array, point: Array | None = None, offset: float = 0.0
) -> RelativeMotion:
    """Return the motion of a body on a time grid.

    The rates of change of the nine elements of the rotation matrix R give the spin, and with the
    position p the velocity of the material at the contact, at any angle:

        v = dp/dt + dR/dt u, u the contact in the frame of the body

    Args:
        track: poses of the body; at least two are in sight.
        grid: (n,) [s].
        point: (n, 3) of the contact, in the frame of the poses [m]; None for the body's origin.
        offset: added to the times of the poses [s].
    """
    seen = track.seen
    times = track.times[seen] + offset
    matrices = _rotation(track.quaternions[seen]).as_matrix().reshape(-1, 9)
    numbers = np.concatenate([track.positions[seen], matrices], axis=1)
    period = float(grid[1] - grid[0])
    pose = np.stack([np.interp(grid, times, column) for column in numbers.T], axis=1)
    rate = slope(pose, period)
    position, matrix = pose[:, :3], pose[:, 3:].reshape(-1, 3, 3)
    lever = np.zeros_like(position)
    if point is not None:
        lever = np.einsum("nji,nj->ni", matrix, point - position)
    velocity = rate[:, :3] + np.einsum("nij,nj->ni", rate[:, 3:].reshape(-1, 3, 3), lever)
    is_seen = covered(grid, times, MAX_POSE_GAP)
    noise = _slope_noise(numbers, float(np.median(np.diff(times))))
    lever_length = float(np.median(np.linalg.norm(lever, axis=1)))
    # |dR/dt| = sqrt(2) spin, in the Frobenius norm: of the noise here, of the motion below.
    spin_noise = float(np.linalg.norm(noise[3:]) / np.sqrt(2))
    return RelativeMotion(
        position=position,
        matrix=matrix,
        speed=np.where(is_seen, np.linalg.norm(velocity, axis=1), np.nan),
        spin=np.where(is_seen, np.linalg.norm(rate[:, 3:], axis=1) / np.sqrt(2), np.nan),
        speed_noise=float(np.hypot(np.linalg.norm(noise[:3]), lever_length * spin_noise)),
        spin_noise=spin_noise,
        known=is_seen,
    )


def slope(values: Array, period: float) -> Array:
    """Return (n, k) rates of change: slopes of lines fitted over SPEED_WINDOW around a sample."""
    from scipy.ndimage import convolve1d

    half = max(n_samples_of(SPEED_WINDOW, period) // 2, 1)
    steps = np.arange(-half, half + 1)
    # Least squares: slope = sum k x_k / (sum k^2 T). A convolution turns its weights round.
    weights = steps / ((steps**2).sum() * period)
    return np.asarray(convolve1d(values, weights[::-1], axis=0, mode="nearest"))


def clock_offset(seen: Array, felt: Array, is_seen: Mask, period: float) -> ClockOffset:
    """Return the offset of the clock of poses against the clock of tactile samples.

    Ranks of the two signals are correlated at every offset, so that one large peak does not
    dominate the result.

    Args:
        seen: (n,) speed by the poses, at least 0, on the grid.
        felt: (n,) change of the force, at least 0, on the grid.
        is_seen: (n,) where there are poses.
        period: of the grid [s].
    """
    reach = min(round(MAX_CLOCK_OFFSET / period), len(seen) // 2)
    a, b = _ranks(seen, is_seen), _ranks(felt, np.ones_like(is_seen))
    correlations = []
    for shift in range(-reach, reach + 1):  # b against a, which is delayed by `shift`
        first, last = max(0, -shift), min(len(a), len(a) - shift)
        mask = is_seen[first:last]
        x, y = a[first:last][mask], b[first + shift : last + shift][mask]
        is_constant = len(x) < 3 or x.std() == 0 or y.std() == 0
        correlation = 0.0 if is_constant else float(np.corrcoef(x, y)[0, 1])
        correlations.append((correlation, -abs(shift), shift))  # of equals, the smaller shift
    correlation, _, shift = max(correlations)
    return ClockOffset(shift * period if correlation >= MIN_CORRELATION else 0.0, correlation)


def _slope_noise(values: Array, step: float) -> Array:
    """Return (k,) standard deviations of the slope from pose noise alone.

    Smooth motion adds little to second differences, and the median ignores the livelier half.
    """
    if len(values) < 3:
        return np.zeros(values.shape[1])
    second = values[2:] - 2 * values[1:-1] + values[:-2]
    # 0.6745: the median of |z| of a normal z. A second difference has the variance 1 + 4 + 1.
    noise = np.median(np.abs(second), axis=0) / (0.6745 * np.sqrt(6))
    half = max(n_samples_of(SPEED_WINDOW, step) // 2, 1)
    return np.asarray(noise / (step * np.sqrt((np.arange(-half, half + 1) ** 2).sum())))


def _interpolated(track: PoseTrack, times: Array) -> PoseTrack:
    """Return the track at other times; NaN in gaps longer than MAX_POSE_GAP."""
    seen = track.seen
    is_covered = covered(times, track.times[seen], MAX_POSE_GAP)
    positions, quaternions = np.full((len(times), 3), np.nan), np.full((len(times), 4), np.nan)
    if is_covered.any():
        seen_times = track.times[seen]
        turns = track.quaternions[seen]
        # q and -q are one rotation: between neighbours of opposite signs the mean would be any.
        flips = np.sign((turns[1:] * turns[:-1]).sum(axis=1))
        signs = np.concatenate([[1.0], np.cumprod(np.where(flips == 0, 1.0, flips))])
        values = np.concatenate([track.positions[seen], turns * signs[:, None]], axis=1)
        between = np.stack([np.interp(times, seen_times, column) for column in values.T], axis=1)
        positions[is_covered] = between[is_covered, :3]
        turns = between[is_covered, 3:]
        quaternions[is_covered] = turns / np.linalg.norm(turns, axis=1, keepdims=True)
    return PoseTrack(times, positions, quaternions)


def _rotation(quaternions: Array) -> "Rotation":
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(quaternions, -1, axis=-1))  # SciPy has the scalar last


def _ranks(values: Array, is_seen: Mask) -> Array:
    """Return ranks between 0 and 1 where values are known; 0 elsewhere."""
    ranks = np.zeros(len(values))
    inside = values[is_seen]
    order = np.argsort(np.argsort(inside, kind="stable"), kind="stable")
    ranks[is_seen] = order / max(len(inside) - 1, 1)
    return ranks
