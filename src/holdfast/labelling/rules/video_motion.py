"""Motion of fingertips on the object in a video of stickers, and the force that goes with it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.detection import Tare
from holdfast.detection.features import tared_force
from holdfast.errors import RecordingError
from holdfast.io.importers.table import read_table
from holdfast.labelling.rules.base import check_positive
from holdfast.labelling.rules.poses import OBJECT, POSE_COLUMNS
from holdfast.labelling.rules.tracking import SPIN_LEVER
from holdfast.metrics.masks import Mask, covered, n_samples_of
from holdfast.recordings import Recording
from holdfast.sensors.types import Array

MIN_SEEN = 0.5
"""Share of the pictures in which a sticker must be seen."""
MAX_UNSEEN_TIME = 0.1
"""Longest time without a picture of a sticker, or another measurement, that is bridged [s]."""
MIN_MEASURED = 100
"""Least number of measurements of another instrument."""
ALIKE_SIZES = 1.6
"""Ratio by which the stickers may look larger or smaller than their sizes: one is nearer."""
EXPOSURE_TIME = 1 / 60
"""Longest time over which the force is averaged for a picture [s]."""
SCALE_TIME = 0.5
"""Time over which the size of a sticker in the picture is averaged: it is the distance [s]."""
TURN_SCALE = 30.0
"""Millimetres that a unit of turn counts in the fit: the lever of a fingertip."""


@dataclass(frozen=True)
class VideoRule:
    """Thresholds of what remains of the motion, and the sizes of the stickers.

    Attributes:
        object_size: side of the black square on the object [m].
        tip_size: the same on fingertips [m].
        window: time on either side of an instant over which positions are averaged [s].
        step: least difference of the two where something may slide [m]; at least six times noise.
        slid: least distance between the positions before and after a slip [m].
        before: time before a slip that is fitted as stuck [s].
        rest: greatest distance between the positions before and after a disturbance in which
            surely nothing slides [m]; within it the finger may be twice as far away.
    """

    object_size: float = 0.024
    tip_size: float = 0.015
    window: float = 0.05
    step: float = 0.00012
    slid: float = 0.0002
    before: float = 0.2
    rest: float = 0.00012

    def __post_init__(self) -> None:
        check_positive(self)


class TipMotion(NamedTuple):
    """Motion of a fingertip on the object, on a regular grid of pictures.

    Attributes:
        position: (n, 2) in the plane of the object's sticker, along its sides [mm]; of another
            measurement (n, 1) or (n, 3).
        turns: (n, 7) turn in the picture and tilts of both bodies [TURN_SCALE mm]; of another
            measurement (n, 3) or (n, 0).
        seen: (n,) where both stickers are seen.
    """

    position: Array
    turns: Array
    seen: Mask


def regular_grid(times: Array) -> Array:
    """Return times one usual step apart, over the duration of the pictures [s]."""
    step = float(np.median(np.diff(times)))
    return np.asarray(times[0] + step * np.arange(int((times[-1] - times[0]) / step) + 1))


def tip_motions(
    times: Array,
    poses: Mapping[int, Array],
    stickers: Mapping[str, int],
    rule: VideoRule,
    video: Path,
) -> dict[str, TipMotion]:
    """Return the motion of the fingers whose stickers are seen.

    Args:
        times: (n,) of the pictures [s].
        poses: (n, 2, 3) of each sticker, see `holdfast.io.stickers`.
        stickers: number of that of each body.
        rule: with the sizes.
        video: for messages.

    Raises:
        RecordingError: as `propose`.
    """
    shares = {
        body: float(np.isfinite(poses[k][:, 0, 0]).mean()) if k in poses else 0.0
        for body, k in stickers.items()
    }
    good = [body for body, share in shares.items() if share >= MIN_SEEN]
    if len(times) < 3 or OBJECT not in good or len(good) < 2:
        names = ", ".join(
            f"{body} ({stickers[body]}) in {share:.0%}" for body, share in shares.items() if share
        )
        raise RecordingError(
            f"{video}: stickers seen in its {len(times)} pictures: {names or 'none'}; that of the "
            f"object ({stickers[OBJECT]}) and of a finger expected in at least {MIN_SEEN:.0%} "
            "(`holdfast label markers` prints them)"
        )
    grid = regular_grid(times)
    tracks = {body: _track_at(grid, times, poses[stickers[body]]) for body in good}
    scales = {body: _scale(track, grid) for body, (track, _) in tracks.items()}
    base, seen = tracks[OBJECT]
    turn, tilt = _turns(base)
    across, along = np.cos(turn), np.sin(turn)
    usual = np.median(base[:, :, :2], axis=0)
    flatten = np.median(scales[OBJECT]) * np.linalg.inv(usual)  # the camera looks aslant
    motions = {}
    for body in good:
        if body == OBJECT:
            continue
        track, tip_seen = tracks[body]
        looks = np.median(scales[body] / scales[OBJECT]) * rule.object_size / rule.tip_size
        if not 1 / ALIKE_SIZES < looks < ALIKE_SIZES:
            raise RecordingError(
                f"{video}: sticker {stickers[body]} ({body}) looks {looks:.2g} times as large as "
                f"{1e3 * rule.tip_size:g} mm beside the {1e3 * rule.object_size:g} mm of the "
                "object; give the sides of the black squares as tip_size and object_size [m]"
            )
        # The side of a sticker in the picture gives the length of a pixel at its distance.
        away = 1e3 * (
            rule.tip_size * track[:, :, 2] / scales[body][:, None]
            - rule.object_size * base[:, :, 2] / scales[OBJECT][:, None]
        )
        tip_turn, tip_tilt = _turns(track)
        # In the axes of the object, which turn with it.
        upright = np.column_stack(
            [across * away[:, 0] + along * away[:, 1], across * away[:, 1] - along * away[:, 0]]
        )
        position = upright @ flatten.T
        # Tilts are 50 times less exact than positions, but not averaged: averages are late, and a
        # push that rolls the object would remain as motion.
        turns = np.column_stack([tip_turn - turn, tilt, tip_tilt])
        motions[body] = TipMotion(position, TURN_SCALE * turns, seen & tip_seen)
    return motions


def measured_motion(path: Path, column: str | None = None) -> tuple[Array, TipMotion]:
    """Return times (n,) [s] and motion of the object that another instrument has measured.

    Args:
        path: of a CSV file with a column `time` [s], and positions x, y, z [m], or quaternions qw,
            qx, qy, qz of a motion sensor, or both.
        column: the one column that counts instead, as of an encoder or a linear stage [m].

    Raises:
        RecordingError: the file cannot be read, or has neither.
    """
    from scipy.spatial.transform import Rotation

    table, _ = read_table(path)
    kinds: list[tuple[str, ...]] = [
        names for names in (POSE_COLUMNS[1:4], POSE_COLUMNS[4:]) if {*names} <= {*table.names}
    ]
    if column is not None:
        kinds = [(column,)]
    if not kinds:
        raise RecordingError(
            f"{path} has the columns {', '.join(table.names)}; time and x,y,z or qw,qx,qy,qz "
            "expected, or another one by --column"
        )
    values = table.columns(("time", *chain(*kinds)))
    values = values[np.isfinite(values).all(axis=1)]
    times, first = np.unique(values[:, 0], return_index=True)
    if len(times) < MIN_MEASURED:
        raise RecordingError(f"{path} has {len(times)} times; at least {MIN_MEASURED} expected")
    values = values[first, 1:]
    if len(kinds[-1]) == 4:  # q and -q are one rotation, but between them is none
        flips = np.cumsum((values[1:, -4:] * values[:-1, -4:]).sum(axis=1) < 0) % 2
        values[1:, -4:] *= 1 - 2 * flips[:, None]
    grid = regular_grid(times)
    on_grid = np.stack([np.interp(grid, times, part) for part in values.T], axis=1)
    position, turns = 1e3 * on_grid[:, : len(kinds[0])], on_grid[:, :0]
    if len(kinds[-1]) == 4:  # quaternions, with their scalar first
        if not (np.abs(np.linalg.norm(values[:, -4:], axis=1) - 1) < 0.1).all():
            raise RecordingError(f"{path}: unit quaternions qw,qx,qy,qz expected in each row")
        turned = Rotation.from_quat(np.roll(on_grid[:, -4:], -1, axis=1))
        turns = TURN_SCALE * (turned * turned[0].inv()).as_rotvec()
    if len(kinds[0]) == 4:  # no positions: what turns slides at the edge of the contact
        position, turns = 1e3 * SPIN_LEVER / TURN_SCALE * turns, turns[:, :0]
    return grid, TipMotion(position, turns, covered(grid, times, MAX_UNSEEN_TIME))


def force_of(recording: Recording, finger: str, tare: Tare) -> Callable[[Array], Array]:
    """Return a function of times [s] that gives the force of a finger, (n, 3), of usual size 1.

    It is averaged over the exposure of each picture. Offsets of the clock are tried by the dozen,
    so the integral of the force is made once.
    """
    module = recording.modules[finger]
    force = np.nan_to_num(tared_force(module, tare, offline=True).force)
    lasting = np.diff(module.times)[:, None] * (force[1:] + force[:-1]) / 2
    # The mean over any exposure is a difference of the integral.
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(lasting, axis=0)])
    usual = np.quantile(np.linalg.norm(force, axis=1), 0.95) or 1.0

    def at(times: Array) -> Array:
        half = min(float(np.median(np.diff(times))), EXPOSURE_TIME) / 2
        ends = [
            np.stack([np.interp(times + side, module.times, column) for column in total.T], axis=1)
            for side in (-half, half)
        ]
        return np.asarray((ends[1] - ends[0]) / (2 * half * usual))

    return at


def robust_fit(predictors: Array, change: Array) -> tuple[Array, Array]:
    """Return the (k, 2) map of least distances, and the (n,) distances that it leaves [mm]."""
    # Squares weighted by 1 / distance make a fit of least distances, which outliers hardly move.
    weights = np.ones(len(predictors))
    for _ in range(15):
        weighted = predictors * weights[:, None]
        # Where nothing turns, the columns of the turns are 0 and the equations singular.
        ridge = 1e-5 * len(predictors) * np.median(weights) * np.eye(predictors.shape[1])
        fit = np.linalg.solve(weighted.T @ predictors + ridge, weighted.T @ change)
        distances = np.linalg.norm(change - predictors @ fit, axis=1)
        weights = 1 / np.maximum(distances, 0.02)  # below the noise of a position, all count alike
    return np.asarray(fit), np.asarray(distances)


def _track_at(grid: Array, times: Array, poses: Array) -> tuple[Array, Mask]:
    """Return the poses of a sticker (n, 2, 3) on the grid, and where it is seen."""
    flat = poses.reshape(len(poses), 6)
    seen = np.isfinite(flat).all(axis=1)
    columns = [np.interp(grid, times[seen], column) for column in flat[seen].T]
    return np.stack(columns, axis=1).reshape(-1, 2, 3), covered(grid, times[seen], MAX_UNSEEN_TIME)


def _scale(track: Array, grid: Array) -> Array:
    """Return the longest side of a sticker in the picture (n,), averaged [pixels]."""
    from scipy.ndimage import median_filter

    longest = np.linalg.svd(track[:, :, :2], compute_uv=False)[:, 0]
    n = n_samples_of(SCALE_TIME, grid[1] - grid[0])
    return mean_over(np.asarray(median_filter(longest, n, mode="nearest")), n)


def _turns(track: Array) -> tuple[Array, Array]:
    """Return the turn in the picture (n,) [rad], and the stretch (n, 3) that tilts cause."""
    usual = np.median(track[:, :, :2], axis=0)
    change = track[:, :, :2] @ np.linalg.inv(usual)
    # Turned back by this angle, the change is symmetric: a stretch.
    turn = np.arctan2(change[:, 1, 0] - change[:, 0, 1], change[:, 0, 0] + change[:, 1, 1])
    cos, sin = np.cos(turn), np.sin(turn)
    stretch = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], -2) @ change
    shear = (stretch[:, 0, 1] + stretch[:, 1, 0]) / 2
    return turn, np.column_stack([stretch[:, 0, 0] - 1, stretch[:, 1, 1] - 1, shear])


def mean_over(values: Array, n: int) -> Array:
    """Return the means of values (m, ...) over the n pictures around each."""
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(values, n | 1, axis=0, mode="nearest"))  # odd: centred
