"""Labels from the force alone, by the convention of the paper: as a person reads a plot of it.

No contact: the force is below the threshold of the tare. Closing: the force grows until it has
settled. Stable: the force stays. Disturbance: the force changes. Released: the final fall.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from holdfast.contact import (
    MERGE_GAP,
    NO_CONTACT,
    STABLE,
    UNSTABLE,
    UNSTABLE_MARGIN,
    Cause,
    ContactState,
)
from holdfast.detection import Tare
from holdfast.detection.plan import TareArgument
from holdfast.labelling.rules.base import (
    LabelWriter,
    StateTimeline,
    check_positive,
    evidence_ratio,
)
from holdfast.labelling.rules.forces import (
    VISIBLE_SHARE,
    FingerForce,
    HandForce,
    final_drop,
    grip_force,
    hand_force,
)
from holdfast.metrics.masks import Mask, drop_short_runs, fill_short_gaps, n_samples_of, runs
from holdfast.recordings import Label, Recording
from holdfast.sensors.types import Array

SIGNAL_RULE = "rule:signal"
RELEASE_SHARE = 0.9
"""A release begins when the force was last above this share of the grip force."""
MAX_FALL_TIME = 0.1
"""A hand that is empty within this time lost the object: it cannot open so fast [s]."""
CHANGE_NOISE_FACTOR = 6.0
"""Least change in standard deviations of a component of the smoothed force. Noise exceeds it in
less than one window an hour: three components of about ten independent values each."""
REST_FACTOR = 3.0
"""Least change in multiples of the change in the calmest fifth, where the noise is unknown: there
is no tare without contact, or the readings do not change in it (a sensor with a dead band)."""
UNMEASURED_RATIO = 2.0
"""Evidence ratio of a state without a threshold."""


@dataclass(frozen=True)
class SignalRule:
    """Thresholds of a change of the force.

    Attributes:
        share: least change, as a share of the grip force of a finger.
        window: time within which the change happens [s]. An unstable interval begins half a
            window before its first change and ends half a window after its last.
        settle: time without a change after which the object is locked [s].
        merge: disturbances with a shorter gap between them are one [s].

    Raises:
        ValueError: a value is not above 0.
    """

    share: float = VISIBLE_SHARE
    window: float = 2 * UNSTABLE_MARGIN
    settle: float = MERGE_GAP
    merge: float = MERGE_GAP

    def __post_init__(self) -> None:
        check_positive(self)


def propose(
    recording: Recording, tare: TareArgument | Tare | None = None, rule: SignalRule | None = None
) -> dict[str, tuple[Label, ...]]:
    """Return labels by finger from the force alone.

    A change of two fingers is a disturbance of the object, and so of all fingers in contact. A
    change of one finger is its own.

    Args:
        recording: the recording. Its labels and its truth are ignored.
        tare: how the baseline is found; by default as `fitting_tare` chooses. With "first" or
            "none", for recordings that begin in contact, the object is held from the start until
            the force drops for good.
        rule: thresholds.

    Raises:
        RecordingError: no sample for the tare.
        ValueError: the tare is unknown, or the window is longer than the recording.
    """
    rule = rule or SignalRule()
    # A filter takes memory for its window, however short the recording is.
    if rule.window > (longest := max(recording.duration, SignalRule.window)):
        raise ValueError(
            f"window: up to {longest:g} s expected, the recording; {rule.window:g} given"
        )
    hand = hand_force(recording, tare)
    change = {name: _change_ratio(finger, rule) for name, finger in hand.fingers.items()}
    # A change of two fingers is one of the object, and so of every finger that touches it.
    shared = np.sum([ratio > 1 for ratio in change.values()], axis=0) >= 2
    # The window widens each change by half its length on both sides: shorter gaps are closed.
    gap = n_samples_of(rule.merge - rule.window, hand.period)
    changing, timelines = {}, {}
    for name, finger in hand.fingers.items():
        changes = ((change[name] > 1) | shared) & finger.contact
        changing[name] = fill_short_gaps(changes, gap) & finger.contact
        timelines[name] = StateTimeline.unknown(hand.times)
        ratio: Array | float = UNMEASURED_RATIO
        if finger.evidence_threshold is not None:
            ratio = evidence_ratio(finger.evidence_threshold, finger.amplitude)
        timelines[name].set_state(~finger.contact & finger.known, NO_CONTACT, None, ratio)
    # A grasp lasts from the first touch of any finger to the last, over short losses.
    touched = fill_short_gaps(hand.n_touching > 0, n_samples_of(rule.settle, hand.period))
    for start, end in runs(touched).tolist():
        grasp = _GraspLabeller(hand, change, changing, slice(start, end), rule)
        for name in hand.fingers:
            grasp.label(name, timelines[name])
    # Where it begins in contact no threshold shows when contact ends: only a final drop does.
    loaded = all(finger.threshold is None for finger in hand.fingers.values())
    if loaded and (drop := final_drop(hand)) is not None:
        after = np.arange(len(hand.times)) >= drop
        for name, finger in hand.fingers.items():
            lost = after & finger.known
            timelines[name].set_state(lost, NO_CONTACT, Cause.LOST, UNMEASURED_RATIO)
    writer = LabelWriter(SIGNAL_RULE, _evidence)
    return {
        name: writer.labels(timelines[name], finger.span) for name, finger in hand.fingers.items()
    }


def _change_ratio(finger: FingerForce, rule: SignalRule) -> Array:
    """Return (n,) the change of the force over its threshold; 0 without contact."""
    change = finger.change(rule.window)
    touching = finger.contact
    if not touching.any():
        return np.zeros_like(change)
    least = CHANGE_NOISE_FACTOR * finger.noise or REST_FACTOR * float(
        np.quantile(change[touching], 0.2)
    )
    # Without a threshold, F_a counts from a load, and a share of it means nothing.
    if finger.threshold is not None:
        least = max(rule.share * grip_force(finger, touching), least)
    return np.where(touching, evidence_ratio(change, least), 0.0)


class _GraspLabeller:
    """Labels of one grasp: closing, held, released."""

    def __init__(
        self,
        hand: HandForce,
        change: Mapping[str, Array],
        changing: Mapping[str, Mask],
        span: slice,
        rule: SignalRule,
    ) -> None:
        self._hand, self._change, self._changing = hand, change, changing
        self._rule = rule
        self._inside = np.zeros(len(hand.times), dtype=bool)
        self._inside[span] = True
        self._starts_loaded = all(finger.threshold is None for finger in hand.fingers.values())
        self._locked = span.start
        if not self._starts_loaded:
            # The hand is locked once no finger changes for long enough, and two of them touch, if
            # two ever do: one finger that waits for the other does not hold.
            fingers = hand.fingers.values()
            n_grasping = sum((finger.contact & self._inside).any() for finger in fingers)
            calm = self._inside & (hand.n_touching >= min(2, n_grasping))
            for mask in changing.values():
                calm &= ~mask
            rests = runs(drop_short_runs(calm, self._n(rule.settle)))
            self._locked = int(rests[0][0]) if len(rests) else span.stop

    def label(self, name: str, timeline: StateTimeline) -> None:
        """Set the states of a finger during the grasp."""
        finger, ratio = self._hand.fingers[name], self._change[name]
        touching = finger.contact & self._inside
        if not touching.any():
            return
        # A later state replaces an earlier one: the ends of a grasp go last.
        timeline.set_state(touching, STABLE, None, evidence_ratio(1.0, ratio))
        timeline.set_state(touching & self._changing[name], UNSTABLE, Cause.DISTURBANCE, ratio)
        before = np.arange(len(touching)) < self._locked
        ratio_of_contact: Array | float = UNMEASURED_RATIO
        if finger.evidence_threshold is not None:
            ratio_of_contact = evidence_ratio(finger.amplitude, finger.evidence_threshold)
        timeline.set_state(touching & before, UNSTABLE, Cause.CLOSING, ratio_of_contact)
        if not self._starts_loaded:
            self._label_end(name, touching, timeline)

    def _label_end(self, name: str, touching: Mask, timeline: StateTimeline) -> None:
        """Label the final fall of the force: released, or lost if the fall is too fast."""
        finger, samples = self._hand.fingers[name], np.arange(len(touching))
        last = int(np.flatnonzero(touching)[-1])
        held = touching & (samples >= self._locked)
        strong = np.flatnonzero(
            held & (finger.amplitude >= RELEASE_SHARE * grip_force(finger, held))
        )
        # The recording may end, or lose the module, before the fall does: nothing is known then.
        if not len(strong) or last + 1 >= len(touching) or not finger.known[last + 1]:
            return
        onset = int(strong[-1])
        cause = Cause.LOST if last - onset < self._n(MAX_FALL_TIME) else Cause.RELEASED
        # The end begins with the changes that lead to the fall, unless they are an event of their
        # own: a longer disturbance after which the hand opened.
        calm = np.flatnonzero(~(self._changing[name] & held)[: onset + 1])
        start = int(calm[-1]) + 1 if len(calm) else 0
        start = start if onset - start < self._n(self._rule.merge) else onset + 1
        timeline.set_state(touching & (samples >= start), UNSTABLE, cause, self._change[name])

    def _n(self, duration: float) -> int:
        return n_samples_of(duration, self._hand.period)


def _evidence(state: ContactState, cause: Cause | None, ratio: float) -> str:
    times = f"{ratio:.3g} times"
    if state is ContactState.NO_CONTACT:
        return "force dropped for good" if cause else f"force {times} under contact"
    if state is ContactState.STABLE:
        return f"settled, {times} under its limit"
    if cause is Cause.CLOSING:
        return f"not settled, force {times} contact"
    what = "ends" if cause in (Cause.RELEASED, Cause.LOST) else "changes"
    return f"force {what}, {times} the settled limit"
