"""Labels from poses: whether the object moves relative to the fingertip that touches it.

The paper proposes this as a successor of labels by hand: markers on the fingertips and on the
object, and their relative motion.
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
from holdfast.detection import Tare
from holdfast.detection.plan import TareArgument
from holdfast.errors import RecordingError
from holdfast.labelling.rules.base import (
    EvidenceText,
    LabelWriter,
    StateTimeline,
    check_positive,
    evidence_ratio,
)
from holdfast.labelling.rules.forces import (
    FingerForce,
    HandForce,
    centre_of_pressure,
    final_drop,
    fitting_tare,
    hand_force,
)
from holdfast.labelling.rules.motion import (
    SPEED_WINDOW,
    ClockOffset,
    RelativeMotion,
    clock_offset,
    motion_of,
    relative_track,
)
from holdfast.labelling.rules.poses import Poses, PoseTrack, poses_of, tip_tracks_of
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

TRACKING_RULE = "rule:tracking"
SPEED_NOISE_FACTOR = 5.0
"""Least threshold of a speed, in standard deviations of the speed of a body at rest."""
OUT_OF_SIGHT_TIME = 0.5
"""An object that is out of sight for this time after the force has ended is lost. If it was out of
sight before that, the loss began at most this time before the end of the force [s]."""
LOSS_RATIO = 2.0
"""Evidence ratio of a loss that is inferred from the end of the force."""
GRASP_REST_TIME = 0.3
"""Time without motion that defines the pose of the grasp [s]."""
SPIN_LEVER = 0.01
"""Distance from the centre of the contact at which spin counts as sliding: the edge of the contact
patch of a fingertip [m]."""


@dataclass(frozen=True)
class TrackingRule:
    """Thresholds of the motion of an object relative to a fingertip.

    Attributes:
        measure: `speed`: the object is moving; `displacement`: it has moved since it was grasped,
            and has not come back.
        speed: least speed of the object's material at the contact [m/s].
        spin: least angular speed [rad/s]; by default the same speed 1 cm beside the contact centre.
        distance: least distance for `displacement` [m]: half the taxel pitch of a fingertip.
        angle: least angle for `displacement` [rad].
        release: share of a threshold below which motion ends.
        least: shorter motion is ignored [s].
        merge: motions with a shorter gap between them are one [s].
        margin: time by which motion is extended at both ends [s].

    Raises:
        ValueError: the measure is unknown, or a number is not above 0.
    """

    measure: Literal["speed", "displacement"] = "speed"
    speed: float = SLIP_SPEED
    spin: float = SLIP_SPEED / SPIN_LEVER
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
    tare: TareArgument | Tare | None = None,
    tracking: str | Path | Poses | None = None,
    offset: float | None = None,
    rule: TrackingRule | None = None,
) -> dict[str, tuple[Label, ...]]:
    """Return labels by finger from the motion of the object relative to the fingertips.

    The force decides on contact. A finger in contact is unstable while the object moves relative
    to it, and for the margins and short gaps of the rule. Within that, the intervals in which the
    object does move are slips; the others touch them, as disturbances (without a cause by
    `displacement`, where the object is away and still). While the object is out of sight there
    is no label, unless the force ends as well: then the object is lost.

    Args:
        recording: with poses in its truth, unless `tracking` is given. Its labels are ignored.
        tare: how the baseline is found; "first" or "none" for recordings that begin in contact.
            By default as `fitting_tare` chooses.
        tracking: path of a CSV file of poses (`poses_from_csv`), or poses.
        offset: added to the times of the poses [s]. By default 0 for poses of the recording, else
            the offset with the highest correlation of motion and force.
        rule: thresholds.

    Raises:
        RecordingError: there are no poses, none of the recording's time or fingers, or no tare.
        ValueError: the tare is unknown.
    """
    rule = rule or TrackingRule()
    poses = poses_of(recording, tracking)
    how = fitting_tare(recording, tare)
    hand = hand_force(recording, how)
    tips = tip_tracks_of(poses, list(hand.fingers))
    tracks = {name: relative_track(poses.object_track, tip) for name, tip in tips.items()}
    clock = ClockOffset(offset, 1.0) if offset is not None else _clock_offset(poses, tracks, hand)
    times = poses.object_track.times[poses.object_track.seen] + clock.seconds
    if len(times) < 2:
        raise RecordingError(
            f"{poses.source}: at least 2 poses of the object in sight expected, {len(times)} found"
        )
    if times[-1] < recording.start or times[0] > recording.end:
        raise RecordingError(
            f"{poses.source} has poses from {times[0]:.10g} to {times[-1]:.10g} s; recording "
            f"{recording.name!r} runs from {recording.start:.10g} to {recording.end:.10g} s"
        )
    drop = final_drop(hand)
    note = f"poses: {poses.source}"
    if clock.seconds:
        note += f", later by {clock.seconds:.3f} s"
    if not clock.reliable:
        note += ", clocks not aligned: motion seen and felt are not alike"
    trust = 1.0 if clock.reliable else 0.5  # then every time may be wrong
    writer = LabelWriter(TRACKING_RULE, _evidence_text(rule), trust, note)
    labels = {}
    for name, track in tracks.items():
        finger, module = hand.fingers[name], recording.modules[name]
        point = None if tips[name] is None else centre_of_pressure(module, how, hand)
        motion = motion_of(track, hand.times, point, clock.seconds)
        timeline = _FingerLabeller(finger, hand.times, rule, drop).timeline(motion, point)
        labels[name] = writer.labels(timeline, finger.span)
    return labels


def _clock_offset(poses: Poses, tracks: Mapping[str, PoseTrack], hand: HandForce) -> ClockOffset:
    """Return the offset of the clock of the poses, from motion and force of all fingers."""
    if poses.same_clock:
        return ClockOffset(0.0, 1.0)
    motions = [motion_of(track, hand.times) for track in tracks.values()]
    seen = np.nanmax([np.where(motion.known, motion.speed, 0.0) for motion in motions], axis=0)
    is_seen = np.any([motion.known for motion in motions], axis=0)
    felt = np.sum([hand.fingers[name].change(UNSTABLE_MARGIN) for name in tracks], axis=0)
    return clock_offset(seen, felt, is_seen, hand.period)


class _FingerLabeller:
    """States of one finger from its force and the motion of the object."""

    def __init__(
        self, finger: FingerForce, times: Array, rule: TrackingRule, drop: int | None
    ) -> None:
        self._finger, self._times, self._rule = finger, times, rule
        self._contact = finger.contact.copy()
        # With a threshold, the force itself shows when contact ends.
        self._drop = None if finger.threshold is not None else drop
        if self._drop is not None:
            self._contact[self._drop :] = False

    def timeline(self, motion: RelativeMotion, point: Array | None) -> StateTimeline:
        """Return states by motion in contact, and no contact; unknown elsewhere."""
        timeline = StateTimeline.unknown(self._times)
        ratio = speed_ratio = self._speed_ratio(motion)
        if self._rule.measure == "displacement":
            ratio = np.where(motion.known, self._displacement_ratio(motion, point), 0.0)
        moving = self._moving(ratio)
        # A later state replaces an earlier one: first what holds still, then what moves,
        # then what slides within it; no contact, and the ends of contacts, last.
        held = self._contact & motion.known
        timeline.set_state(held, STABLE, None, evidence_ratio(1.0, ratio))
        around = Cause.DISTURBANCE if self._rule.measure == "speed" else None
        timeline.set_state(held & moving, UNSTABLE, around, ratio)
        sliding = held & moving & self._sliding(speed_ratio)
        timeline.set_state(sliding, UNSTABLE, Cause.SLIP, speed_ratio)
        free = ~self._contact & self._finger.known
        if self._drop is not None:
            timeline.set_state(free, NO_CONTACT, Cause.LOST, LOSS_RATIO)
        elif (threshold := self._finger.evidence_threshold) is not None:
            clear = evidence_ratio(threshold, self._finger.amplitude)
            timeline.set_state(free, NO_CONTACT, None, clear)
        for start, end in runs(self._contact):
            self._label_ends(timeline, start, end)
            self._label_loss(timeline, motion.known, start, end)
        return timeline

    def _speed_ratio(self, motion: RelativeMotion) -> Array:
        """Return (n,) the speed or spin over its threshold; 0 while the object is out of sight."""
        rule = self._rule
        speed = max(rule.speed, SPEED_NOISE_FACTOR * motion.speed_noise)
        spin = max(rule.spin, SPEED_NOISE_FACTOR * motion.spin_noise)
        ratio = np.maximum(motion.speed / speed, motion.spin / spin)
        return np.where(motion.known, ratio, 0.0)

    def _sliding(self, ratio: Array) -> Mask:
        """Return (n,) where the object moves against the finger, without margins.

        The fit of the speed smears the edge of a motion over half of its window. The edge is
        where the fitted speed is half of the largest within that time.
        """
        from scipy.ndimage import maximum_filter1d

        period = self._finger.period
        largest = maximum_filter1d(ratio, 2 * n_samples_of(SPEED_WINDOW / 2, period) + 1)
        sliding = (ratio >= 1) & (ratio >= 0.5 * largest)
        return drop_short_runs(sliding, n_samples_of(self._rule.least, period))

    def _displacement_ratio(self, motion: RelativeMotion, point: Array | None) -> Array:
        """Return (n,) the displacement from the pose of the grasp over its threshold."""
        calm = self._contact & motion.known
        calm &= motion.speed < max(self._rule.speed, SPEED_NOISE_FACTOR * motion.speed_noise)
        n = n_samples_of(GRASP_REST_TIME, self._finger.period)
        rests = runs(drop_short_runs(calm, n))
        if not len(rests):
            return np.zeros(len(self._times))
        grasp = slice(rests[0][0], rests[0][0] + n)
        distance, angle = motion.away_from(
            motion.position[grasp].mean(axis=0),
            motion.matrix[grasp].mean(axis=0),
            None if point is None else point[grasp].mean(axis=0),
        )
        return np.maximum(distance / self._rule.distance, angle / self._rule.angle)

    def _moving(self, ratio: Array) -> Mask:
        rule, period = self._rule, self._finger.period
        motion = hysteresis(ratio, rule.release, 1.0)
        motion = drop_short_runs(motion, n_samples_of(rule.least, period))
        if rule.measure == "displacement":
            return motion
        # The fit of the speed has extended motion by half of its window at both ends already.
        motion = fill_short_gaps(motion, n_samples_of(rule.merge - SPEED_WINDOW, period))
        margin = n_samples_of(rule.margin - SPEED_WINDOW / 2, period)
        return widen_runs(motion, np.arange(len(motion)), margin)

    def _label_ends(self, timeline: StateTimeline, start: int, end: int) -> None:
        """Set the cause of motion at the start of a contact to closing, at its end to released."""
        if self._finger.threshold is None:
            return  # it begins in contact: the recording does not show how it closed
        unstable = timeline.codes[start:end] == UNSTABLE
        still = np.flatnonzero(timeline.codes[start:end] == STABLE)
        # A contact that is never still closes to its end.
        first, last = (still[0], still[-1] + 1) if len(still) else (end - start, end - start)
        inside = np.zeros(len(self._times), dtype=bool)
        inside[start : start + first] = unstable[:first]
        timeline.set_cause(inside, Cause.CLOSING)
        inside[:] = False
        inside[start + last : end] = unstable[last:]
        timeline.set_cause(inside, Cause.RELEASED)

    def _label_loss(self, timeline: StateTimeline, is_seen: Mask, start: int, end: int) -> None:
        """Label a loss if the object is out of sight when the force ends, and stays so."""
        n = n_samples_of(OUT_OF_SIGHT_TIME, self._finger.period)
        seen = np.flatnonzero(is_seen[start:end])
        # Never in sight, or seen again soon after the end of the force: no loss is known.
        if not len(seen) or end == len(is_seen) or is_seen[max(end - 1, start) : end + n].any():
            return
        unseen = np.zeros(len(is_seen), dtype=bool)
        unseen[max(start + seen[-1] + 1, end - n) : end] = True
        timeline.set_state(unseen & self._finger.known, UNSTABLE, Cause.LOST, LOSS_RATIO)
        # The time without contact that follows at once has the same cause.
        after = timeline.codes[end:] != NO_CONTACT
        unseen[:] = False
        unseen[end : end + int(np.argmax(after)) if after.any() else len(is_seen)] = True
        timeline.set_cause(unseen, Cause.LOST)


def _evidence_text(rule: TrackingRule) -> EvidenceText:
    what = "moves" if rule.measure == "speed" else "away from where it was grasped"

    def evidence(state: ContactState, cause: Cause | None, ratio: float) -> str:
        if cause is Cause.LOST and state is ContactState.UNSTABLE:
            return "object out of sight, and the force ends"
        if state is ContactState.NO_CONTACT:
            lost = "object out of sight, " if cause else ""
            return f"{lost}force {ratio:.3g} times under contact"
        if cause is Cause.SLIP:
            return f"object moves against the finger: {ratio:.3g} times over the limit of a slip"
        if cause is Cause.DISTURBANCE:
            return "object moves against the finger shortly before or after"
        limit = "over" if state is ContactState.UNSTABLE else "under"
        return f"object {what} against the finger: {ratio:.3g} times {limit} the limit"

    return evidence
