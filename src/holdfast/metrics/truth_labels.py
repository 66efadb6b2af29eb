"""Labels from the truth, as intervals like those that a careful person draws.

A finger that shakes the object leaves it three to eight times a second, so "an outside force
acts" changes often within one shake. A person labels the shake as a whole, and so does this.
"""

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from holdfast.contact import (
    CONTACT_FORCE,
    GLITCH_DURATION,
    HELD_PHASES,
    MERGE_GAP,
    MIN_CONTACT_DURATION,
    SLIP_SPEED,
    UNSTABLE_MARGIN,
    Cause,
    ContactState,
    Phase,
)
from holdfast.metrics.masks import Mask, join_runs, runs, runs_with, widen_runs, without_short_runs
from holdfast.recordings import Label, Recording, Truth, labels_from_samples
from holdfast.sensors.types import Array

Onsets = Literal["truth", "labels", "rule", "mixed"]
"""Where onsets come from: the truth, labels, labels by a rule (if any are), or truth and labels."""

ORIGINS: dict[Onsets, str] = {
    "truth": "by the truth", "labels": "by labels", "rule": "by labels of a rule",
    "mixed": "by truth or labels",
}  # fmt: skip
"""Where onsets come from, in words."""

BY_RULE = "rule:"
"""Beginning of the author of a label that a rule made."""
MARGIN_RULES = ("rule:signal", "rule:tracking")
"""Rules that begin an unstable interval `UNSTABLE_MARGIN` before the change that they found."""

HAND_TRUTH = {"phase", "outside_force"}
"""Arrays of the truth of the hand without which there are no labels."""
FINGER_TRUTH = {"contact_force", "slip_speed"}
"""Arrays of the truth of a finger without which it has no labels."""


@dataclass(frozen=True)
class LabelRule:
    """Thresholds of contact and slip, and the rule by which intervals are formed.

    Attributes:
        contact: minimum force of a finger that touches the object [N].
        sliding: minimum slip speed of a held contact that slips [m/s].
        merge: disturbances with a shorter gap between them are one, and a shorter gap between
            closing and the first disturbance is not stable [s].
        margin: time by which a disturbance is extended at both ends [s].
        min_contact: a shorter contact, or loss of contact, is ignored [s].
        glitch: time after a glitch of the hand's controller in which instability is attributed
            to it [s]; the hand rings at 6 to 8 Hz. None: glitches are not labelled.
    """

    contact: float = CONTACT_FORCE
    sliding: float = SLIP_SPEED
    merge: float = MERGE_GAP
    margin: float = UNSTABLE_MARGIN
    min_contact: float = MIN_CONTACT_DURATION
    glitch: float | None = GLITCH_DURATION


def labels_from_truth(
    truth: Truth, finger: str, rule: LabelRule | None = None
) -> tuple[Label, ...]:
    """Return the labels of one finger.

    Stable: the object is locked, the finger touches it without sliding, and no outside force
    acts, so the hand alone governs the object, as in the paper. The hand-over at both ends is
    therefore not stable.

    Unstable: while the hand closes or opens on the object; during disturbances; while the finger
    slides; and after a glitch of the hand's controller, together with the slip that it causes
    (cause glitch). The cause is by sample: slip while the finger slides, disturbance in the rest
    of an interval in which an outside force acts. The margins and gaps of an interval without
    one have no cause.

    No contact: otherwise.

    Args:
        truth: truth with `phase`, `outside_force` and, if known, `set_point_error` of the hand,
            and `contact_force` and `slip_speed` of the finger.
        finger: name of the finger.
        rule: thresholds and margins; by default `LabelRule()`.
    """
    rule = rule or LabelRule()
    times = truth.times
    arrays = truth.fingers[finger]
    phase = truth.hand["phase"]
    touching = without_short_runs(
        np.linalg.norm(arrays["contact_force"], axis=1) > rule.contact, times, rule.min_contact
    )
    held = np.isin(phase, HELD_PHASES)
    sliding = held & (arrays["slip_speed"] > rule.sliding)
    glitched = held & glitches(truth, rule)
    # A slip that the hand's own glitch causes is no slip of the object by itself.
    slip_of_glitch = runs_with(sliding, glitched)
    glitched, sliding = glitched | slip_of_glitch, sliding & ~slip_of_glitch
    pushed = held & (np.linalg.norm(truth.hand["outside_force"], axis=1) > rule.contact)
    # Between two touches of one shake no force acts: the phase says that the shake goes on.
    pushed |= np.isin(phase, (Phase.DISTURBED, Phase.SLIPPING))
    unstable = sliding | pushed
    unstable = held & widen_runs(join_runs(unstable, times, rule.merge), times, rule.margin)
    closing, free = phase == Phase.CLOSING, phase == Phase.FREE
    # A person who draws labels would not put a short hold between closing and the first push.
    for _, end in runs(closing):
        start = end + int(np.argmax(unstable[end:])) if unstable[end:].any() else end
        if start > end and times[start] - times[end] < rule.merge:
            unstable[end:start] = held[end:start]
    # Free again after a hold, and not because the hand let go: the object was lost.
    was_held = np.logical_or.accumulate(held)
    lost = was_held & ~np.logical_or.accumulate(phase == Phase.RELEASED) & free
    # The first rule that applies decides. Instability outranks loss of contact: a finger that is
    # thrown off the object for a moment is disturbed. Contact outranks the phases that follow: a
    # finger that does not touch has no state of its own. The last rule takes all other samples.
    unstable_by = ContactState.UNSTABLE
    rules = (
        (unstable & sliding, (unstable_by, Cause.SLIP)),
        (runs_with(unstable, pushed), (unstable_by, Cause.DISTURBANCE)),
        (unstable, (unstable_by, None)),
        (~touching & lost, (ContactState.NO_CONTACT, Cause.LOST)),
        (~touching, (ContactState.NO_CONTACT, None)),
        (glitched, (unstable_by, Cause.GLITCH)),
        (held, (ContactState.STABLE, None)),
        (closing, (unstable_by, Cause.CLOSING)),
        (lost, (unstable_by, Cause.LOST)),
        (np.full_like(held, True), (unstable_by, Cause.RELEASED)),
    )
    first = np.argmax([mask for mask, _ in rules], axis=0)
    states = [rules[k][1] for k in first.tolist()]
    period = float(np.median(np.diff(times)))
    return labels_from_samples(times, states, period=period, evidence="truth", author="twin")


def labels_by_truth(recording: Recording, rule: LabelRule) -> dict[str, tuple[Label, ...]]:
    """Return the labels of each finger whose truth is known; none without a truth.

    Args:
        recording: with the truth.
        rule: thresholds and margins.
    """
    truth, names = recording.truth, fingers_with_truth(recording)
    return {} if truth is None else {name: labels_from_truth(truth, name, rule) for name in names}


def labels_by_rule(labels: Sequence[Label]) -> bool:
    """Return whether a rule made one of the labels."""
    return any(label.author.startswith(BY_RULE) for label in labels)


def without_margin(labels: Sequence[Label]) -> tuple[Label, ...]:
    """Return labels in which the margin of a rule before an onset of instability is stable.

    What follows it within the margin is exact: there the onset is. Ends keep their margin.

    Example:
        >>> stable = Label(0.0, 1.0, "STABLE", author="rule:signal")
        >>> push = Label(1.0, 1.5, "UNSTABLE", "disturbance", author="rule:signal")
        >>> [(label.start, label.end) for label in without_margin([stable, push])]
        [(0.0, 1.1), (1.1, 1.5)]
    """
    exact: list[Label] = []
    for before, label in zip((None, *labels), labels, strict=False):
        margined = label.state is ContactState.UNSTABLE and label.author in MARGIN_RULES
        held = before is not None and before.state is ContactState.STABLE
        if before is None or not (margined and held and before.end >= label.start):
            exact.append(label)
            continue
        onset = min(label.start + UNSTABLE_MARGIN, label.end)
        exact[-1] = replace(before, end=onset)
        if onset < label.end:
            exact.append(replace(label, start=onset))
    return tuple(exact)


def common_onsets(onsets: AbstractSet[Onsets]) -> Onsets:
    """Return where the onsets of several recordings come from."""
    if "rule" in onsets:
        return "rule"
    return next(iter(onsets), "labels") if len(onsets) < 2 else "mixed"


def fingers_with_truth(recording: Recording) -> list[str]:
    """Return the fingers whose labels can be made from the truth."""
    truth = recording.truth
    if truth is None or not truth.hand.keys() >= HAND_TRUTH:
        return []
    return [n for n in recording.modules if truth.fingers.get(n, {}).keys() >= FINGER_TRUTH]


def glitches(truth: Truth, rule: LabelRule) -> Mask:
    """Return where a glitch of the hand's controller acts, or has acted shortly before.

    Args:
        truth: truth with `set_point_error` of the hand; without it there are no glitches.
        rule: rule with the duration of a glitch.
    """
    error = truth.hand.get("set_point_error")
    if rule.glitch is None or error is None:
        return np.zeros(len(truth.times), dtype=bool)
    glitched = np.asarray(error > 0)
    for _, end in runs(glitched):
        last = np.searchsorted(truth.times, truth.times[end - 1] + rule.glitch, side="right")
        glitched[end:last] = True
    return glitched


def phases_from_touch(
    phase: npt.NDArray[np.str_], push: Array, touch: float
) -> npt.NDArray[np.str_]:
    """Return phases in which every disturbance lasts from its first touch to its last.

    A pushing finger starts off the object and may leave it well before its planned end. No
    sensor of the hand can detect that plan.

    Args:
        phase: (n,) planned phases.
        push: (n,) force of the operator on the object [N].
        touch: minimum force that counts as a touch [N].
    """
    planned = np.isin(phase, (Phase.DISTURBED, Phase.SLIPPING))
    touched = np.zeros_like(planned)
    for start, end in runs(planned):
        touches = start + np.flatnonzero(push[start:end] > touch)
        if len(touches):
            touched[touches[0] : touches[-1] + 1] = True
    return np.where(planned & ~touched, Phase.LOCKED.value, phase)
