"""Slips measured from outside: a video of printed stickers on the object and the fingertips.

A skin yields and an object rolls between fingers, by a millimetre and more, before anything slides.
So the motion that is seen is explained by the force that is felt, and by how the bodies turn:

    q = C F + L r + d

q is the place of a fingertip on the object, in the plane of the object's sticker, F its force, r
the turns of both bodies. C and L are fitted to changes, by the least sum of distances, in which
sliding is an outlier. What remains, d, is flat while the finger sticks, and moves for good when it
has slid.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.features import Tare
from holdfast.features.force import tared_force
from holdfast.features.tare import TareArgument
from holdfast.io.foreign import read_stickers
from holdfast.labelling.rules import signal
from holdfast.labelling.rules.base import check_positive, evidence_ratio, label_confidence
from holdfast.labelling.rules.forces import fitting_tare
from holdfast.labelling.rules.poses import OBJECT
from holdfast.metrics.masks import (
    Mask,
    covered,
    fill_short_gaps,
    hysteresis,
    n_samples_of,
    runs,
)
from holdfast.recordings import Label, Recording, label_states
from holdfast.sensors.types import Array

VIDEO_RULE = "rule:tracking"
MIN_SEEN = 0.5
"""Share of the pictures in which a sticker must be seen."""
MAX_UNSEEN_TIME = 0.1
"""Longest time without a picture of a sticker that is bridged [s]."""
ALIKE_SIZES = 1.6
"""Ratio by which the stickers may look larger or smaller than their sizes: one is nearer."""
MAX_CLOCK_ERROR = 0.010
"""Largest standard error of the offset of the clocks with which onsets are labelled [s]."""
EXPOSURE_TIME = 1 / 60
"""Longest time over which the force is averaged for a picture [s]."""
FINE_REACH, FINE_STEP = 0.06, 0.0025
"""Offsets around the coarse one that are tried, and their step [s]."""
CLEAR_PEAK = 2.0
"""Ratio between the best coarse offset and any other, from which it is taken. Measured on the
twin: 2.5 to 13 for the own video, 1.0 to 1.5 for another one."""
COARSE_TIME = 0.05
"""Time between the two ends of the changes by which the clocks are compared first [s]."""
FAST_SHARE = 0.05
"""Share of the pictures, those with the largest accelerations, by which the clocks are compared:
slow motion lags behind the force, because skins creep and objects roll."""
MIN_FITTED = 100
"""Least number of pictures of a loaded finger."""
N_CLOCK_PARTS = 8
"""Parts of the recording that are left out in turn for the error of the offset (jackknife)."""
FIT_TIMES = (0.13, 0.25)
"""Time between the two ends of the changes that are fitted [s]: first all, then those without the
slips that were seen, or C would explain a part of them."""
SLIP_MARGIN = 0.05
"""Time around a slip that is left out of the second fit [s]."""
TURN_TIME = 0.15
"""Time over which the tilts are averaged: they are 50 times less exact than places [s]."""
SCALE_TIME = 0.5
"""Time over which the size of a sticker in the picture is averaged: it is the distance [s]."""
TURN_SCALE = 30.0
"""Millimetres that a unit of turn counts in the fit: the lever of a fingertip."""
RETURN_TIME = 0.3
"""Motions with less time between them are one: a push goes there, rests, and comes back [s]."""
FITTED_SHARE = 0.2
"""A finger whose force is below this share of its usual one is not fitted."""


@dataclass(frozen=True)
class VideoRule:
    """Thresholds of what remains of the motion, and the sizes of the stickers.

    Attributes:
        object_size: side of the black square on the object [m].
        tip_size: the same on fingertips [m].
        window: time on either side of an instant over which places are averaged [s].
        step: least difference of the two where something may slide [m]; at least six times noise.
        slid: least distance between the places before and after a slip [m].
        before: time before a slip that is fitted as stuck [s].
    """

    object_size: float = 0.024
    tip_size: float = 0.015
    window: float = 0.05
    step: float = 0.00012
    slid: float = 0.0002
    before: float = 0.2

    def __post_init__(self) -> None:
        check_positive(self)


class SeenSlip(NamedTuple):
    """A slip that a camera has seen.

    Attributes:
        onset: when the fit of stuck, then sliding, leaves the noise [s].
        onset_error: its standard deviation [s].
        end: [s].
        distance: slid, along the path [m].
        distance_error: its standard deviation [m].
        ratio: between the distance and the least one.
    """

    onset: float
    onset_error: float
    end: float
    distance: float
    distance_error: float
    ratio: float


class VideoClock(NamedTuple):
    """Time that is added to the stamps of a video, and its standard error [s]."""

    offset: float
    error: float


class TipMotion(NamedTuple):
    """Motion of a fingertip on the object, on a regular grid of pictures.

    Attributes:
        place: (n, 2) in the plane of the object's sticker, along its sides [mm].
        turns: (n, 7) turn in the picture and tilts of both bodies [TURN_SCALE mm].
        seen: (n,) where both stickers are seen.
    """

    place: Array
    turns: Array
    seen: Mask


def propose(
    recording: Recording,
    video: str | Path,
    tare: TareArgument | Tare | None = None,
    fps: float | None = None,
    offset: float | None = None,
    bodies: Mapping[str, int] | None = None,
    rule: VideoRule | None = None,
) -> dict[str, tuple[Label, ...]]:
    """Return labels of the fingers in view: the slips that are seen, and the rest by the force.

    Args:
        recording: with the forces of the fingers. Its labels and its truth are ignored.
        video: path of a video with the sticker of the object and of at least one fingertip.
        tare: as in `signal.propose`.
        fps: pictures per second; by default the stamps of the file.
        offset: added to the times of the video [s]; by default what motion and force agree on.
        bodies: number of the sticker of `object` and of fingers; by default 0 for the object, and
            1, 2, ... in the order of the recording.
        rule: thresholds and sizes.

    Raises:
        RecordingError: stickers are missing or of another size, or the clocks cannot be aligned.
    """
    rule, video = rule or VideoRule(), Path(video)
    how = fitting_tare(recording, tare)
    times, places = read_stickers(video, fps)
    tips = tip_motions(times, places, stickers_of(recording, bodies), rule, video)
    grid = regular_grid(times)
    clock = (
        video_clock(recording, tips, grid, how, video)
        if offset is None
        else VideoClock(offset, 0.0)
    )
    base = signal.propose(recording, how)
    labels, at = {}, grid + clock.offset
    for finger, tip in tips.items():
        held = held_at(base[finger], at) & tip.seen
        force = force_of(recording, finger, how)(at)
        slips, stuck = [], held
        for time in FIT_TIMES:
            n = n_samples_of(time, grid[1] - grid[0])
            rest = unexplained(tip, force, stuck, n)
            slips = seen_slips(at, rest, held, rule)
            stuck = held.copy()
            for slip in slips:
                stuck &= (at <= slip.onset - SLIP_MARGIN) | (at >= slip.end + SLIP_MARGIN)
        note = f"video {video.name}, later by {clock.offset:.3f} s (+/- {clock.error:.3f})"
        labels[finger] = with_slips(base[finger], slips, note)
    return labels


def stickers_of(recording: Recording, bodies: Mapping[str, int] | None = None) -> dict[str, int]:
    """Return the number of the sticker of the object and of each finger.

    Raises:
        ValueError: the object is missing, or a body is no finger of the recording.
    """
    usual = {OBJECT: 0, **{finger: k + 1 for k, finger in enumerate(recording.modules)}}
    if bodies is None:
        return usual
    if OBJECT not in bodies or not bodies.keys() <= usual.keys() or len(bodies) < 2:
        raise ValueError(
            f"stickers of {', '.join(bodies)} given; {OBJECT} and at least one of "
            f"{', '.join(recording.modules)} expected"
        )
    return dict(bodies)


def regular_grid(times: Array) -> Array:
    """Return times one usual step apart, over those of the pictures [s]."""
    step = float(np.median(np.diff(times)))
    return np.asarray(times[0] + step * np.arange(int((times[-1] - times[0]) / step) + 1))


def tip_motions(
    times: Array,
    places: Mapping[int, Array],
    stickers: Mapping[str, int],
    rule: VideoRule,
    video: Path,
) -> dict[str, TipMotion]:
    """Return the motion of the fingers whose stickers are seen.

    Args:
        times: (n,) of the pictures [s].
        places: (n, 2, 3) of each sticker, see `holdfast.io.stickers`.
        stickers: number of that of each body.
        rule: with the sizes.
        video: for messages.

    Raises:
        RecordingError: as `propose`.
    """
    shares = {
        body: float(np.isfinite(places[k][:, 0, 0]).mean()) if k in places else 0.0
        for body, k in stickers.items()
    }
    good = [body for body, share in shares.items() if share >= MIN_SEEN]
    if len(times) < 3 or OBJECT not in good or len(good) < 2:
        found = ", ".join(
            f"{body} ({stickers[body]}) in {share:.0%}" for body, share in shares.items() if share
        )
        raise RecordingError(
            f"{video}: stickers seen in its {len(times)} pictures: {found or 'none'}; that of the "
            f"object ({stickers[OBJECT]}) and of a finger expected in at least {MIN_SEEN:.0%} "
            "(`holdfast label markers` prints them)"
        )
    grid = regular_grid(times)
    tracks = {body: _track_at(grid, times, places[stickers[body]]) for body in good}
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
        # The side of a sticker in the picture tells how long a pixel is at its distance.
        away = 1e3 * (
            rule.tip_size * track[:, :, 2] / scales[body][:, None]
            - rule.object_size * base[:, :, 2] / scales[OBJECT][:, None]
        )
        tip_turn, tip_tilt = _turns(track)
        # In the axes of the object, which turn with it.
        upright = np.column_stack(
            [across * away[:, 0] + along * away[:, 1], across * away[:, 1] - along * away[:, 0]]
        )
        place = upright @ flatten.T
        n = n_samples_of(TURN_TIME, grid[1] - grid[0])
        turns = np.column_stack([tip_turn - turn, _mean(np.column_stack([tilt, tip_tilt]), n)])
        motions[body] = TipMotion(place, TURN_SCALE * turns, seen & tip_seen)
    return motions


def video_clock(
    recording: Recording, tips: Mapping[str, TipMotion], grid: Array, tare: Tare, video: Path
) -> VideoClock:
    """Return the offset of the clock of a video, by what the camera sees and the fingers feel.

    Raises:
        RecordingError: nothing moves alike, or the error is too large.
    """
    step = float(grid[1] - grid[0])
    coarse, clear = _coarse_offset(recording, tips, grid, tare)
    if clear < CLEAR_PEAK:
        raise RecordingError(
            f"{video}: its motion is not that of recording {recording.name!r} at any offset (the "
            f"best is {clear:.1f} times as likely as another, {CLEAR_PEAK:g} times expected): "
            "another video, or nothing moves; push the object to and fro at the start"
        )
    offsets = coarse + np.arange(-FINE_REACH, FINE_REACH + FINE_STEP / 2, FINE_STEP)
    costs = np.zeros((len(offsets), N_CLOCK_PARTS))
    for finger, tip in tips.items():
        force_at = force_of(recording, finger, tare)
        loaded = np.linalg.norm(force_at(grid + coarse), axis=1)
        held = ((loaded > FITTED_SHARE) & tip.seen)[1:-1]
        jerks = np.diff(tip.place, 2, axis=0)
        size = _mean(np.linalg.norm(jerks, axis=1), 5)
        if held.sum() < MIN_FITTED:
            continue
        fast = np.flatnonzero(held & (size > np.quantile(size[held], 1 - FAST_SHARE)))
        part = np.arange(len(fast)) * N_CLOCK_PARTS // len(fast)
        for k, offset in enumerate(offsets):
            felt = np.diff(force_at(grid + offset), 2, axis=0)
            _, rest = _robust_fit(felt[fast], jerks[fast])
            costs[k] += np.bincount(part, rest, N_CLOCK_PARTS)
    whole = costs.sum(axis=1)
    if not whole.any():
        raise RecordingError(f"{video}: no finger with a sticker is loaded while it is filmed")
    parts = np.array([_lowest(offsets, whole - costs[:, k]) for k in range(N_CLOCK_PARTS)])
    # The variance of a jackknife is n - 1 times that of the results without one part.
    error = float(np.sqrt((N_CLOCK_PARTS - 1) * parts.var() + step**2 / 144))
    if error > MAX_CLOCK_ERROR:
        raise RecordingError(
            f"{video}: its clock is known to {1e3 * error:.0f} ms only, and to "
            f"{1e3 * MAX_CLOCK_ERROR:.0f} ms or better it must be (pictures are lost, or nothing "
            "moves fast): tap the object three times, or give the offset"
        )
    return VideoClock(_lowest(offsets, whole), error)


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


def held_at(labels: tuple[Label, ...], times: Array) -> Mask:
    """Return where a finger holds its object: neither closing nor opening, by labels of force."""
    ends = {Cause.CLOSING, Cause.RELEASED, Cause.LOST}
    kept = [label for label in labels if label.cause not in ends]
    codes = label_states(kept, times)
    held = (codes == ContactState.STABLE.code) | (codes == ContactState.UNSTABLE.code)
    return np.asarray(held)


def unexplained(tip: TipMotion, force: Array, held: Mask, n: int) -> Array:
    """Return what the force and the turns do not explain of a motion, (n_pictures, 2) [mm].

    Args:
        tip: the motion.
        force: (n_pictures, 3).
        held: (n_pictures,) where it is fitted.
        n: pictures between the two ends of a change.
    """
    known = np.column_stack([force, tip.turns])
    both = held[n:] & held[:-n]
    if both.sum() < 4 * known.shape[1]:
        # Too few for a fit: no motion remains, and so no slip.
        return tip.place - tip.place
    change = known[n:] - known[:-n]
    fit, _ = _robust_fit(change[both], (tip.place[n:] - tip.place[:-n])[both])
    return np.asarray(tip.place - known @ fit)


def seen_slips(times: Array, rest: Array, held: Mask, rule: VideoRule) -> list[SeenSlip]:
    """Return the slips in what remains of a motion.

    The onset is the change point of a level and a line after it, averaged over its likelihood.

    Args:
        times: (n,) of the regular grid [s].
        rest: (n, 2) from `unexplained` [mm].
        held: (n,) where the finger holds the object.
        rule: thresholds.
    """
    step = float(times[1] - times[0])
    n = max(round(rule.window / step), 2)
    moved, noise = _step_size(rest, n), 0.0
    if held.any():
        noise = float(np.median(moved[held])) / 1.18  # of a component of two
    # A step is the difference of two means of n values: the noise of one value is larger.
    single = noise * np.sqrt(n / 2)
    least = max(1e3 * rule.step, 6 * noise)
    slips: list[SeenSlip] = []
    free = 0
    moving = hysteresis(np.where(held, moved / least, 0.0), 0.7, 1.0)
    for first, last in runs(_for_good(rest, moving, n, max(1e3 * rule.slid, 6 * noise), step)):
        n_rest = 3 * n
        before = np.median(rest[max(first - n_rest, 0) : first + 1], axis=0)
        after = np.median(rest[last - 1 : last - 1 + n_rest], axis=0)
        away = np.linalg.norm(after - before)
        # What is fitted as stuck must not reach into the slip before.
        start, free = max(first - round(rule.before / step), free), last - n
        if away < max(1e3 * rule.slid, 6 * noise):
            continue  # it came back: nothing slid
        gone = np.linalg.norm(rest[first:last] - before, axis=1)
        far = np.flatnonzero(gone > min(max(1e3 * rule.slid, 6 * single), 0.8 * away))
        end = first + (int(far[0]) if len(far) else len(gone) - 1)
        start = max(min(start, end - 4), 0)
        along = rest[end] - before
        line = (rest[start : end + 1] - before) @ along / max(float(np.linalg.norm(along)), 1e-9)
        onset, error = change_point(times[start : end + 1], line, max(single, 0.005))
        path = np.linalg.norm(np.diff(_mean(rest[first:last], 3), axis=0), axis=1).sum()
        distance = max(float(path), float(away))
        # The means smear the end of a motion over their window.
        until = max(float(times[last - 1]) - rule.window / 2, onset + step)
        ratio = away / max(1e3 * rule.slid, 6 * noise)
        slips.append(SeenSlip(onset, error, until, 1e-3 * distance, 2e-3 * noise, float(ratio)))
    return slips


def _for_good(rest: Array, moving: Mask, n: int, slid: float, step: float) -> Mask:
    """Return the motions after which the finger is elsewhere; those that come back are none."""
    kept = moving.copy()
    for first, last in runs(fill_short_gaps(moving, n_samples_of(RETURN_TIME, step))):
        before = np.median(rest[max(first - 3 * n, 0) : first + 1], axis=0)
        after = np.median(rest[last - 1 : last - 1 + 3 * n], axis=0)
        if np.linalg.norm(after - before) < slid:
            kept[first:last] = False
    return kept


def change_point(times: Array, values: Array, noise: float) -> tuple[float, float]:
    """Return when a level turns into a line, and the standard deviation of that time [s].

    Args:
        times: (n,) at least four [s].
        values: (n,).
        noise: standard deviation of a value about the level and the line.

    Example:
        >>> times = np.arange(20) / 60
        >>> onset, error = change_point(times, np.maximum(times - 0.2, 0.0), 0.001)
        >>> round(onset, 2), error < 0.01
        (0.2, True)
    """
    step = times[1] - times[0]
    tried = np.linspace(times[0] + 0.2 * step, times[-1] - 0.3 * step, 6 * len(times))
    ramps = np.maximum(times - tried[:, None], 0.0)
    # Ramps and values are centred: then the level needs no fit of its own.
    ramps -= ramps.mean(axis=1, keepdims=True)
    centred = values - values.mean()
    slope = ramps @ centred / np.maximum((ramps**2).sum(axis=1), 1e-18)
    squares = ((centred - slope[:, None] * ramps) ** 2).sum(axis=1)
    variance = max(noise**2, squares.min() / max(len(times) - 3, 1))
    likelihood = np.exp((squares.min() - squares) / (2 * variance))
    likelihood /= likelihood.sum()
    mean = float(likelihood @ tried)
    return mean, float(np.sqrt(likelihood @ (tried - mean) ** 2))


def with_slips(
    labels: tuple[Label, ...], slips: list[SeenSlip], note: str = ""
) -> tuple[Label, ...]:
    """Return labels in which slips replace what they overlap of a held contact."""
    made: list[Label] = []
    for label in labels:
        if label.state is ContactState.NO_CONTACT or label.cause not in (None, Cause.DISTURBANCE):
            made.append(label)
            continue
        at = label.start
        for slip in slips:
            start, end = max(slip.onset, at), min(slip.end, label.end)
            if start >= end:
                continue
            if start > at:
                made.append(replace(label, end=start, start=at))
            text = (
                f"slides {1e3 * slip.distance:.2f} mm (+/- {1e3 * slip.distance_error:.2f}), "
                f"onset +/- {1e3 * slip.onset_error:.0f} ms; {note}"
            )
            if made and made[-1].evidence == text:  # it goes on over an edge of the labels
                start = made.pop().start
            ratio = float(evidence_ratio(slip.ratio, 0.5))
            sure = round(label_confidence(ratio, end - start), 3)
            made.append(
                Label(start, end, ContactState.UNSTABLE, Cause.SLIP, text, sure, VIDEO_RULE)
            )
            at = end
        if label.end > at:
            made.append(replace(label, start=at))
    return tuple(made)


def _coarse_offset(
    recording: Recording, tips: Mapping[str, TipMotion], grid: Array, tare: Tare
) -> tuple[float, float]:
    """Return the offset at which changes of force explain most of the motion, and how clearly.

    The share that a linear map explains is computed for all offsets at once, from correlations.
    Large changes are cut, so that closing hands and single jerks do not decide.

    Returns:
        The offset [s], and the share there over the largest one elsewhere.
    """
    from scipy.signal import correlate

    step = float(grid[1] - grid[0])
    own = np.arange(recording.start, recording.end, step)
    n = max(round(COARSE_TIME / step), 1)
    shares: Array = np.zeros(len(grid) + len(own) - 2 * n - 1)
    for finger, tip in tips.items():
        force = force_of(recording, finger, tare)(own)
        moved, felt = (_cut(values[n:] - values[:-n]) for values in (tip.place, force))
        products = np.array([[correlate(f, m) for f in felt.T] for m in moved.T])
        inverse = np.linalg.pinv(felt.T @ felt)
        shares += np.einsum("ijl,jk,ikl->l", products, inverse, products) / (moved**2).sum()
    best = int(np.argmax(shares))
    # Motion is smooth, so the offsets beside the best one are nearly as good: they do not count.
    near = round(FINE_REACH / step) + 10
    others = np.delete(shares, slice(max(best - near, 0), best + near + 1))
    # The correlation begins with the largest shift; there is none at the last index of `moved`.
    shift = best - (len(grid) - n - 1)
    clear = shares[best] / max(others.max(initial=0.0), 1e-12)
    return float(own[0] - grid[0] + shift * step), float(clear)


def _cut(changes: Array) -> Array:
    """Return changes around their mean, those above their 70 % quantile cut to it."""
    sizes = np.linalg.norm(changes, axis=1)
    most = np.quantile(sizes, 0.7)
    cut = changes * np.minimum(1.0, most / np.maximum(sizes, 1e-12))[:, None]
    return np.asarray(cut - cut.mean(axis=0))


def _lowest(offsets: Array, costs: Array) -> float:
    """Return the offset of the lowest cost, between the steps by a parabola [s]."""
    k = int(np.clip(np.argmin(costs), 1, len(costs) - 2))
    left, middle, right = costs[k - 1 : k + 2]
    bend = left - 2 * middle + right
    shift = 0.5 * (left - right) / bend if bend > 0 else 0.0
    return float(offsets[k] + FINE_STEP * np.clip(shift, -1, 1))


def _robust_fit(known: Array, change: Array) -> tuple[Array, Array]:
    """Return the (k, 2) map of least distances, and the (n,) distances that it leaves [mm]."""
    # Squares weighted by 1 / distance make a fit of least distances, which outliers hardly move.
    weights = np.ones(len(known))
    for _ in range(15):
        weighted = known * weights[:, None]
        # Where nothing turns, the columns of the turns are 0 and the equations singular.
        ridge = 1e-5 * len(known) * np.median(weights) * np.eye(known.shape[1])
        fit = np.linalg.solve(weighted.T @ known + ridge, weighted.T @ change)
        distances = np.linalg.norm(change - known @ fit, axis=1)
        weights = 1 / np.maximum(distances, 0.02)  # below the noise of a place, all count alike
    return np.asarray(fit), np.asarray(distances)


def _step_size(values: Array, n: int) -> Array:
    """Return how far the means of n values before and after each one are apart; 0 at the ends."""
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    sizes = np.zeros(len(values))
    if len(values) > 2 * n:
        means = (total[n:] - total[:-n]) / n
        sizes[n : len(values) - n + 1] = np.linalg.norm(means[n:] - means[:-n], axis=1)
    return sizes


def _track_at(grid: Array, times: Array, places: Array) -> tuple[Array, Mask]:
    """Return the places of a sticker (n, 2, 3) on the grid, and where it is seen."""
    flat = places.reshape(len(places), 6)
    seen = np.isfinite(flat).all(axis=1)
    columns = [np.interp(grid, times[seen], column) for column in flat[seen].T]
    return np.stack(columns, axis=1).reshape(-1, 2, 3), covered(grid, times[seen], MAX_UNSEEN_TIME)


def _scale(track: Array, grid: Array) -> Array:
    """Return the longest side of a sticker in the picture (n,), averaged [pixels]."""
    from scipy.ndimage import median_filter

    longest = np.linalg.svd(track[:, :, :2], compute_uv=False)[:, 0]
    n = n_samples_of(SCALE_TIME, grid[1] - grid[0])
    return _mean(np.asarray(median_filter(longest, n, mode="nearest")), n)


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


def _mean(values: Array, n: int) -> Array:
    from scipy.ndimage import uniform_filter1d

    return np.asarray(uniform_filter1d(values, n | 1, axis=0, mode="nearest"))  # odd: centred
