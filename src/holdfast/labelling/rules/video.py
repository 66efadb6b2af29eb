"""Slips measured from outside: a video of printed stickers on the object and the fingertips.

A skin yields and an object rolls between fingers, by a millimetre and more, before anything slides.
So the motion that is seen is explained by the force that is felt, and by how the bodies turn:

    q = C F + L r + d

q is the position of a fingertip on the object, in the plane of the object's sticker, F its force, r
the turns of both bodies. C and L are fitted to changes, by the least sum of distances, in which
sliding is an outlier. What remains, d, is flat while the finger sticks, and moves for good when it
has slid.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from holdfast.contact import STABLE, Cause, ContactState
from holdfast.detection import Tare
from holdfast.detection.plan import TareArgument
from holdfast.io.foreign import read_stickers
from holdfast.io.stickers import picture_stamps, stamps_path
from holdfast.labelling.rules import signal
from holdfast.labelling.rules.base import evidence_ratio, label_confidence
from holdfast.labelling.rules.forces import fitting_tare
from holdfast.labelling.rules.poses import OBJECT
from holdfast.labelling.rules.video_clock import USUAL_DELAY, VideoClock, flash_offset, video_clock
from holdfast.labelling.rules.video_motion import (
    TipMotion,
    VideoRule,
    force_of,
    mean_over,
    measured_motion,
    regular_grid,
    robust_fit,
    tip_motions,
)
from holdfast.metrics.masks import Mask, fill_short_gaps, hysteresis, n_samples_of, runs
from holdfast.recordings import Label, Recording, label_states
from holdfast.sensors.types import Array

VIDEO_RULE = "rule:tracking"
FIT_TIMES = (0.13, 0.25)
"""Time between the two ends of the changes that are fitted [s]: first all, then those without the
slips that were seen, or C would explain a part of them."""
SLIP_MARGIN = 0.05
"""Time around a slip that is left out of the second fit [s]."""
RETURN_TIME = 0.3
"""Motions with less time between them are one: a push goes there, rests, and comes back [s]."""
ONE_STICKER = "one sticker moves"
"""Motion without a force that may be a slow slip, or a sticker that came loose."""
LIGHT_CHANGE = 0.05
"""Share by which the brightness changes with the light."""
REST_TIME = 0.3
"""Time before and after a disturbance in which the places of the finger are compared [s]."""
DOUBT_MARGIN = 0.5
"""Time around a slip in which the finger may slide, too [s]: a sticker does not show the first
hundredths of a millimetre."""


class SeenSlip(NamedTuple):
    """A slip that a camera has seen.

    Attributes:
        onset: when the fit of stuck, then sliding, leaves the noise [s].
        onset_error: its standard deviation [s].
        end: [s].
        distance: slid, along the path [m].
        distance_error: its standard deviation [m].
        ratio: between the distance and the least one.
        other: what moves or changes in the picture, if no force does: a slip only if it may be
            that of `ONE_STICKER`.
    """

    onset: float
    onset_error: float
    end: float
    distance: float
    distance_error: float
    ratio: float
    other: str = ""


class Film(NamedTuple):
    """Measurements of a film beside the motion of fingertips on the object, on a regular grid.

    Attributes:
        levels: (n,) brightness.
        places: (n_stickers, n, 2) of the stickers in the picture [pixels].
    """

    levels: Array
    places: Array

    @classmethod
    def of(cls, grid: Array, times: Array, levels: Array, poses: Sequence[Array]) -> Self:
        """Return what a film shows; where a sticker is not seen, it is between its places."""
        places = []
        for pose in poses:
            seen = np.isfinite(pose[:, 0, 2])
            heights = [np.interp(grid, times[seen], pose[seen, k, 2]) for k in (0, 1)]
            places.append(np.stack(heights, axis=1))
        return cls(np.interp(grid, times, levels), np.array(places))

    def what_moves(self, rows: slice) -> str:
        """Return what moves in a motion in which the force of no finger changes.

        Args:
            rows: pictures of the motion, at least one.
        """
        first, last = max(rows.start - 1, 0), min(rows.stop, len(self.levels) - 1)
        if abs(self.levels[last] - self.levels[first]) > LIGHT_CHANGE * self.levels[first]:
            return "the light changes"
        ways = np.linalg.norm(self.places[:, last] - self.places[:, first], axis=1)
        return "the whole picture moves" if ways.min() > ways.max() / 2 else ONE_STICKER


def propose(
    recording: Recording,
    video: str | Path | None = None,
    tare: TareArgument | Tare | None = None,
    fps: float | None = None,
    offset: float | None = None,
    bodies: Mapping[str, int] | None = None,
    rule: VideoRule | None = None,
    motion: str | Path | None = None,
    column: str | None = None,
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
        motion: path of a CSV file of another instrument, instead of a video. Its motion is that
            of the object against a hand at rest, so of all fingers; see `measured_motion`.
        column: the one column of it that counts.

    Raises:
        RecordingError: stickers are missing or of another size, or the clocks cannot be aligned.
    """
    rule = rule or VideoRule()
    how = fitting_tare(recording, tare)
    flash = expected = film = None
    if motion is not None:
        source, kind = Path(motion), "motion"
        grid, moved = measured_motion(source, column)
        tips = dict.fromkeys(recording.modules, moved)
    elif video is not None:
        source, kind = Path(video), "video"
        times, levels, poses = _filmed(source, fps)
        if fps is None and stamps_path(source).exists():
            expected = -USUAL_DELAY  # the stamps are on the clock of the samples
        flash = flash_offset(recording, times, levels)
        bodies = stickers_of(recording, bodies)
        tips = tip_motions(times, poses, bodies, rule, source)
        grid = regular_grid(times)
        film = Film.of(grid, times, levels, [poses[k] for k in bodies.values() if k in poses])
    else:
        raise ValueError("neither a video nor a motion given")
    clock = (
        video_clock(recording, tips, grid, how, source, flash, expected)
        if offset is None
        else VideoClock(offset, 0.0)
    )
    base = signal.propose(recording, how)
    labels, at = {}, grid + clock.offset
    doubtful = np.zeros(len(at), dtype=bool)
    for finger, tip in tips.items():
        held = held_at(base[finger], at) & tip.seen
        force = force_of(recording, finger, how)(at)
        slips, stuck, rest = [], held, tip.position
        for time in FIT_TIMES:
            n = n_samples_of(time, grid[1] - grid[0])
            rest = unexplained(tip, force, stuck, n)
            slips = seen_slips(at, rest, held, rule)
            stuck = held.copy()
            for slip in slips:
                stuck &= (at <= slip.onset - SLIP_MARGIN) | (at >= slip.end + SLIP_MARGIN)
        settled = np.all(
            [label_states(finger_labels, at) == STABLE for finger_labels in base.values()], axis=0
        )
        slips = [
            slip._replace(other=film.what_moves(rows))
            if film and settled[rows := slice(*np.searchsorted(at, (slip.onset, slip.end)))].all()
            else slip
            for slip in slips
        ]
        note = f"{kind} {source.name}, later by {clock.offset:.3f} s (+/- {clock.error:.3f})"
        n = n_samples_of(REST_TIME, grid[1] - grid[0])
        slips, doubt = sort_motions(at, rest, _disturbed(base[finger], at), slips, rule, n)
        doubt |= ~tip.seen
        doubtful |= doubt
        labels[finger] = surely_held(with_slips(base[finger], slips, note), at, doubt)
    # A finger out of view holds its object while all others do: it has no slips, but holds.
    for finger in base.keys() - tips.keys():
        labels[finger] = surely_held(base[finger], at, doubtful)
    return labels


def _filmed(video: Path, fps: float | None) -> tuple[Array, Array, dict[int, Array]]:
    """Return times, brightness and stickers, by the stamps of `record --camera` if there are."""
    stamps = picture_stamps(video) if fps is None else None
    if stamps is None:
        return read_stickers(video, fps)
    # With one picture a second, the time of a picture is its number.
    numbers, levels, poses = read_stickers(video, 1.0)
    kept = numbers < len(stamps)  # a process that was killed may have lost the last stamps
    times = stamps[numbers[kept].astype(int)]
    return times, levels[kept], {k: pose[kept] for k, pose in poses.items()}


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
    predictors = np.column_stack([force, tip.turns])
    both = held[n:] & held[:-n]
    if both.sum() < 4 * predictors.shape[1]:
        # Too few changes for a fit: no motion remains, and so no slip.
        return tip.position - tip.position
    change = predictors[n:] - predictors[:-n]
    fit, _ = robust_fit(change[both], (tip.position[n:] - tip.position[:-n])[both])
    return np.asarray(tip.position - predictors @ fit)


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
    moved, noise = _steps(rest, held, n)
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
        # The stretch that is fitted as stuck must not reach into the slip before.
        start, free = max(first - round(rule.before / step), free), last - n
        if away < max(1e3 * rule.slid, 6 * noise):
            continue  # a part of a longer motion that came back by itself: nothing slid
        gone = np.linalg.norm(rest[first:last] - before, axis=1)
        far = np.flatnonzero(gone > min(max(1e3 * rule.slid, 6 * single), 0.8 * away))
        end = first + (int(far[0]) if len(far) else len(gone) - 1)
        start = max(min(start, end - 4), 0)  # a change point needs four values or more
        along = rest[end] - before
        line = (rest[start : end + 1] - before) @ along / max(float(np.linalg.norm(along)), 1e-9)
        # Noise of at least 0.005 mm: the position of a sticker is exact to 0.01 mm.
        onset, error = change_point(times[start : end + 1], line, max(single, 0.005))
        path = np.linalg.norm(np.diff(mean_over(rest[first:last], 3), axis=0), axis=1).sum()
        distance = max(float(path), float(away))
        # The means smear the end of a motion over their window.
        until = max(float(times[last - 1]) - rule.window / 2, onset + step)
        ratio = away / max(1e3 * rule.slid, 6 * noise)
        slips.append(SeenSlip(onset, error, until, 1e-3 * distance, 2e-3 * noise, float(ratio)))
    return slips


def moved_by(rest: Array, rows: slice, n: int) -> tuple[float, float]:
    """Return how far a finger is elsewhere after some time, and half of its way within it [mm].

    What the force does not explain of the way is larger within a push than after it.

    Args:
        rest: (n, 2) from `unexplained` [mm].
        rows: of the time; it may be empty.
        n: values before and after it that are compared.
    """
    before = rest[max(rows.start - n, 0) : rows.start]
    after, within = rest[rows.stop : rows.stop + n], mean_over(rest[rows], 3)
    if not (len(before) and len(after) and len(within)):
        return math.inf, math.inf
    place = np.median(before, axis=0)
    largest = np.linalg.norm(within - place, axis=1).max()
    return float(np.linalg.norm(np.median(after, axis=0) - place)), float(largest) / 2


def sort_motions(
    times: Array,
    rest: Array,
    disturbed: Sequence[slice],
    slips: list[SeenSlip],
    rule: VideoRule,
    n: int,
) -> tuple[list[SeenSlip], Mask]:
    """Return the slips whose disturbance leaves the finger elsewhere, and where it may slide.

    Args:
        times: (n_pictures,) on the clock of the labels [s].
        rest: (n_pictures, 2) from `unexplained` [mm].
        disturbed: pictures of each disturbance.
        slips: that were seen.
        rule: thresholds.
        n: values before and after a disturbance that are compared.
    """
    doubt = np.zeros(len(times), dtype=bool)
    for rows in disturbed:
        away, within = moved_by(rest, rows, n)
        if away < 1e3 * rule.slid / 2:  # what came back by its end has not slid
            slips = [x for x in slips if not times[rows.start] <= x.onset <= times[rows.stop - 1]]
        # A slip that was seen explains why it is elsewhere.
        seen = any(times[rows.start] <= x.onset <= times[rows.stop - 1] for x in slips)
        doubt[rows] = not seen and max(away, within) > 1e3 * rule.rest
    for slip in slips:
        doubt |= (times > slip.onset - DOUBT_MARGIN) & (times < slip.end + DOUBT_MARGIN)
    return slips, doubt


def _disturbed(labels: tuple[Label, ...], times: Array) -> list[slice]:
    """Return the pictures of each disturbance."""
    spans = [(label.start, label.end) for label in labels if label.cause is Cause.DISTURBANCE]
    rows = [slice(*np.searchsorted(times, span).tolist()) for span in spans]
    return [row for row in rows if row.start < row.stop]  # others are before or after the film


def surely_held(labels: tuple[Label, ...], times: Array, doubtful: Mask) -> tuple[Label, ...]:
    """Return labels that call no time held in which the finger may slide.

    A disturbance, and a stable contact, train and score the head `slip` as no slip. What is
    unstable without a cause, or has no label, is neither.

    Args:
        labels: of one finger.
        times: (n,) of the pictures, on the clock of the labels [s].
        doubtful: (n,) where it may slide; before and after the pictures it may too.
    """
    inside = [(float(times[first]), float(times[last - 1])) for first, last in runs(doubtful)]
    spans = [(-math.inf, float(times[0])), *inside, (float(times[-1]), math.inf)]
    made: list[Label] = []
    for label in labels:
        is_stable = label.state is ContactState.STABLE
        if not is_stable and label.cause is not Cause.DISTURBANCE:
            made.append(label)
            continue
        for part, span in _cut(label, spans):
            if span is None:
                made.append(part)
            elif not is_stable:
                made.append(replace(part, cause=None))
    return tuple(made)


def _cut(label: Label, spans: Sequence[tuple[float, float]]) -> Iterator[tuple[Label, int | None]]:
    """Yield the parts of a label between spans and in them, and the index of the span of each.

    Args:
        label: to cut.
        spans: start and end [s], in order of time; where two overlap, the first counts.
    """
    at = label.start
    for index, (start, end) in enumerate(spans):
        first, last = max(start, at), min(end, label.end)
        if first >= last:
            continue
        if first > at:
            yield replace(label, start=at, end=first), None
        yield replace(label, start=first, end=last), index
        at = last
    if label.end > at:
        yield replace(label, start=at), None


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
        for part, index in _cut(label, [(slip.onset, slip.end) for slip in slips]):
            if index is None:
                made.append(part)
                continue
            slip, start = slips[index], part.start
            doubt = f"no force changes, {slip.other}; " if slip.other else ""
            text = (
                f"slides {1e3 * slip.distance:.2f} mm (+/- {1e3 * slip.distance_error:.2f}), "
                f"onset +/- {1e3 * slip.onset_error:.0f} ms; {doubt}{note}"
            )
            if made and made[-1].evidence == text:  # it goes on over an edge of the labels
                start = made.pop().start
            # A slip of the least distance has an evidence ratio of 2, a confidence up to 0.75.
            ratio = float(evidence_ratio(slip.ratio, 0.5))
            sure = round(label_confidence(ratio, part.end - start), 3)
            cause = Cause.SLIP if slip.other in ("", ONE_STICKER) else None
            state = ContactState.UNSTABLE
            made.append(Label(start, part.end, state, cause, text, sure, VIDEO_RULE))
    return tuple(made)


def _steps(rest: Array, held: Mask, n: int) -> tuple[Array, float]:
    """Return the size of the step at each value, and the noise of a component of a step [mm]."""
    moved = _step_size(rest, n)
    # The median length of a normal pair is 1.18 standard deviations.
    return moved, float(np.median(moved[held])) / 1.18 if held.any() else 0.0


def _step_size(values: Array, n: int) -> Array:
    """Return how far the means of n values before and after each one are apart; 0 at the ends."""
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    sizes = np.zeros(len(values))
    if len(values) > 2 * n:
        means = (total[n:] - total[:-n]) / n
        sizes[n : len(values) - n + 1] = np.linalg.norm(means[n:] - means[:-n], axis=1)
    return sizes
