"""Labels from poses: does the object move against the fingertip that touches it?

The paper's own proposal for what comes after labels drawn by hand: markers on the fingertips
and on the object, and their relative movement.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from holdfast.contact import (
    MERGE_GAP,
    NO_CONTACT,
    SLIP_SPEED,
    STABLE,
    UNSTABLE,
    UNSTABLE_MARGIN,
    Cause,
    ContactState,
)
from holdfast.errors import RecordingError
from holdfast.features import Tare
from holdfast.features.tare import TareArgument
from holdfast.labelling.rules.base import Drawing, Pen, check_positive
from holdfast.labelling.rules.forces import FingerForce, HandForce, hand_force, lost_at, pressed_at
from holdfast.labelling.rules.motion import (
    SMOOTHING,
    Motion,
    Offset,
    motion_of,
    offset_of,
    relative,
)
from holdfast.labelling.rules.poses import Poses, Track, names_of, poses_of
from holdfast.metrics.masks import (
    Mask,
    drop_short_runs,
    fill_short_gaps,
    hysteresis,
    n_samples_of,
    runs,
    widen_runs,
)
from holdfast.recordings import Label, Recording
from holdfast.sensors.types import Array

AUTHOR = "rule:tracking"
NOISE_TIMES = 5.0
"""Standard deviations of the speed of a body at rest that no threshold may be below."""
GONE = 0.5
"""An object that is out of sight for so long after the force has ended is lost [s]; and where it
was out of sight before, it was being lost for so long at most."""
LOST_TIMES = 2.0
"""Times over a threshold that the end of the force without the object in sight counts as."""
REST = 0.3
"""For how long nothing moves before the pose counts as that of the grasp [s]."""


@dataclass(frozen=True)
class TrackingRule:
    """What counts as motion of the object against a fingertip.

    Attributes:
        measure: `speed`: it is moving; `displacement`: it has moved since it was grasped, and
            has not come back.
        speed: of the material at the contact from which on it slides [m/s].
        spin: from which on it turns [rad/s]; by default the same speed 1 cm beside the centre of
            the contact, the edge of a fingertip's patch.
        distance: for `displacement` [m]: half the pitch of a fingertip's taxels.
        angle: for `displacement` [rad].
        release: share of a threshold below which motion ends.
        least: motion of a shorter time is not told [s].
        merge: motions with a shorter rest between them are one [s].
        margin: by which motion is drawn longer at both ends [s].

    Raises:
        ValueError: an unknown measure, or a number that is not above 0.
    """

    measure: Literal["speed", "displacement"] = "speed"
    speed: float = SLIP_SPEED
    spin: float = SLIP_SPEED / 0.01
    distance: float = 0.003
    angle: float = 0.1
    release: float = 0.5
    least: float = 0.03
    merge: float = MERGE_GAP
    margin: float = UNSTABLE_MARGIN

    def __post_init__(self) -> None:
        if self.measure not in ("speed", "displacement"):
            raise ValueError(f"measure 'speed' or 'displacement' expected, {self.measure!r} given")
        check_positive(self)


def propose(
    recording: Recording,
    tare: TareArgument | Tare = 0.5,
    tracking: str | Path | Poses | None = None,
    offset: float | None = None,
    rule: TrackingRule | None = None,
) -> dict[str, tuple[Label, ...]]:
    """Labels by finger from the motion of the object against the fingertips.

    Contact is told by the force; a finger in contact is unstable while the object moves against
    it. Where the object is out of sight there is no label, but where the force drops with it:
    it is lost.

    Args:
        recording: with poses in its truth, unless `tracking` gives them; its labels are not
            looked at.
        tare: how the baseline is found; "first" or "none" for recordings that begin in contact.
        tracking: path of a CSV file of poses (`poses_from_csv`), or poses.
        offset: added to the times of the poses [s]; by default 0 for poses of the recording's
            own, and what makes motion seen and felt most alike for others.
        rule: what counts as motion.

    Raises:
        RecordingError: no poses, none of the recording's time or fingers, or no tare.
        ValueError: an unknown tare.
    """
    rule = rule or TrackingRule()
    poses = poses_of(recording, tracking)
    hand = hand_force(recording, tare)
    tracks = names_of(poses, list(hand.fingers))
    relatives = {name: relative(poses.thing, tip) for name, tip in tracks.items()}
    clock = Offset(offset, 1.0) if offset is not None else _clock(poses, relatives, hand)
    _check_overlap(recording, poses, clock.seconds)
    lost = lost_at(hand)
    labels = {}
    for name, track in relatives.items():
        point = None if tracks[name] is None else pressed_at(recording.modules[name], tare, hand)
        judge = _Judge(hand.fingers[name], hand.times, rule, lost)
        drawing = judge.drawing(motion_of(track, hand.times, point, clock.seconds), point)
        labels[name] = _pen(poses, clock, rule).labels(drawing, hand.fingers[name].span)
    return labels


def _clock(poses: Poses, relatives: Mapping[str, Track], hand: HandForce) -> Offset:
    """How far the clock of the poses is behind, by what all fingers saw and felt."""
    if poses.same_clock:
        return Offset(0.0, 1.0)
    motions = [motion_of(track, hand.times) for track in relatives.values()]
    seen = np.nanmax([np.where(each.known, each.speed, 0.0) for each in motions], axis=0)
    known = np.any([each.known for each in motions], axis=0)
    felt = np.sum([hand.fingers[name].change(UNSTABLE_MARGIN) for name in relatives], axis=0)
    return offset_of(seen, felt, known, hand.period)


def _check_overlap(recording: Recording, poses: Poses, offset: float) -> None:
    times = poses.thing.times[poses.thing.seen] + offset
    if len(times) < 2:
        raise RecordingError(f"{poses.source}: the object is never in sight twice")
    if times[-1] < recording.start or times[0] > recording.end:
        raise RecordingError(
            f"{poses.source} has poses from {times[0]:.10g} to {times[-1]:.10g} s; recording "
            f"{recording.name!r} runs from {recording.start:.10g} to {recording.end:.10g} s"
        )


class _Judge:
    """Draws the states of one finger."""

    def __init__(
        self, finger: FingerForce, times: Array, rule: TrackingRule, lost: int | None
    ) -> None:
        self._finger, self._times, self._rule = finger, times, rule
        self._contact = finger.contact.copy()
        self._lost = None if finger.threshold is not None else lost
        if self._lost is not None:
            self._contact[self._lost :] = False

    def drawing(self, motion: Motion, point: Array | None) -> Drawing:
        """States by motion within contact, none where neither is known."""
        drawing = Drawing.blank(self._times)
        ratio = self._ratio(motion, point)
        moving = self._moving(ratio, motion.known)
        held = self._contact & motion.known
        drawing.paint(held, STABLE, None, 1 / np.maximum(ratio, 1e-9))
        drawing.paint(held & moving, UNSTABLE, Cause.SLIP, ratio)
        self._paint_free(drawing)
        for start, end in runs(self._contact):
            self._paint_ends(drawing, start, end)
            self._paint_loss(drawing, motion.known, start, end)
        return drawing

    def _ratio(self, motion: Motion, point: Array | None) -> Array:
        """(n,) motion in times of what counts as one; 0 where it is not seen."""
        rule = self._rule
        if rule.measure == "speed":
            speed = max(rule.speed, NOISE_TIMES * motion.speed_noise)
            spin = max(rule.spin, NOISE_TIMES * motion.spin_noise)
            ratio = np.maximum(motion.speed / speed, motion.spin / spin)
        else:
            ratio = self._away(motion, point)
        return np.where(motion.known, ratio, 0.0)

    def _away(self, motion: Motion, point: Array | None) -> Array:
        """(n,) the way from the pose of the grasp, in times of what counts: the first rest."""
        calm = self._contact & motion.known
        calm &= motion.speed < max(self._rule.speed, NOISE_TIMES * motion.speed_noise)
        rests = runs(drop_short_runs(calm, n_samples_of(REST, self._finger.period)))
        if not len(rests):
            return np.zeros(len(self._times))
        first = slice(rests[0][0], rests[0][0] + n_samples_of(REST, self._finger.period))
        place, turn = motion.position[first].mean(axis=0), motion.matrix[first].mean(axis=0)
        far, turned = motion.away_from(
            place, turn, None if point is None else point[first].mean(axis=0)
        )
        return np.maximum(far / self._rule.distance, turned / self._rule.angle)

    def _moving(self, ratio: Array, known: Mask) -> Mask:
        rule, period = self._rule, self._finger.period
        moving = drop_short_runs(
            hysteresis(ratio, rule.release, 1.0), n_samples_of(rule.least, period)
        )
        if rule.measure == "displacement":
            return moving
        # The smoothing has drawn motion longer by half of itself at both ends already.
        moving = fill_short_gaps(moving, n_samples_of(rule.merge - SMOOTHING, period))
        margin = n_samples_of(rule.margin - SMOOTHING / 2, period)
        return widen_runs(moving, np.arange(len(moving)), margin)

    def _paint_ends(self, drawing: Drawing, start: int, end: int) -> None:
        """Motion at the beginning of a contact is closing, at its end release."""
        if self._finger.threshold is None:
            return
        unstable = drawing.codes[start:end] == UNSTABLE
        still = np.flatnonzero(drawing.codes[start:end] == STABLE)
        first, last = (still[0], still[-1] + 1) if len(still) else (end - start, end - start)
        inside = np.zeros(len(self._times), dtype=bool)
        inside[start : start + first] = unstable[:first]
        drawing.recause(inside, Cause.CLOSING)
        inside[:] = False
        inside[start + last : end] = unstable[last:]
        drawing.recause(inside, Cause.RELEASED)

    def _paint_loss(self, drawing: Drawing, known: Mask, start: int, end: int) -> None:
        """The object is lost where it is out of sight when the force ends, and stays so."""
        n = n_samples_of(GONE, self._finger.period)
        seen = np.flatnonzero(known[start:end])
        if not len(seen) or end == len(known) or known[max(end - 1, start) : end + n].any():
            return
        blind = np.zeros(len(known), dtype=bool)
        blind[max(start + seen[-1] + 1, end - n) : end] = True
        drawing.paint(blind & self._finger.known, UNSTABLE, Cause.LOST, LOST_TIMES)
        after = drawing.codes[end:] != NO_CONTACT
        blind[:] = False
        blind[end : end + int(np.argmax(after)) if after.any() else len(known)] = True
        drawing.recause(blind, Cause.LOST)

    def _paint_free(self, drawing: Drawing) -> None:
        finger = self._finger
        free = ~self._contact & finger.known
        if self._lost is not None:
            drawing.paint(free, NO_CONTACT, Cause.LOST, 2.0)
        elif finger.threshold is not None:
            amplitude = np.maximum(finger.amplitude, np.finfo(float).tiny)
            drawing.paint(free, NO_CONTACT, None, finger.threshold / amplitude)


def _pen(poses: Poses, clock: Offset, rule: TrackingRule) -> Pen:
    note = f"poses: {poses.source}"
    if clock.seconds:
        note += f", later by {clock.seconds:.3f} s"
    if not clock.believed:
        note += ", clocks not aligned: motion seen and felt are not alike"
    what = "moves" if rule.measure == "speed" else "away from where it was grasped"

    def evidence(state: ContactState, cause: Cause | None, ratio: float) -> str:
        if cause is Cause.LOST and state is ContactState.UNSTABLE:
            return "object out of sight, and the force ends"
        if state is ContactState.NO_CONTACT:
            lost = "object out of sight, " if cause else ""
            return f"{lost}force {ratio:.3g} times under contact"
        limit = "over" if state is ContactState.UNSTABLE else "under"
        return f"object {what} against the finger: {ratio:.3g} times {limit} the limit"

    return Pen(AUTHOR, evidence, 1.0 if clock.believed else 0.5, note)
