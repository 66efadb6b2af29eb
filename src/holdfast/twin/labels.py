"""Labels out of the truth, by intervals, as a careful person would draw them.

Sample by sample, "an outside force acts" flickers inside a shake, for the finger that pushes
leaves the object three to eight times a second. A person labels the shake as a whole.
"""

from dataclasses import dataclass

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
from holdfast.metrics.masks import Mask, join_runs, runs, runs_with, widen_runs
from holdfast.recordings import Label, Truth, labels_from_samples
from holdfast.sensors.types import Array


@dataclass(frozen=True)
class LabelRule:
    """What counts as contact, as sliding, and how intervals are drawn.

    Attributes:
        contact: force on the object from which on a finger touches it [N].
        sliding: slip speed from which on a held contact slips [m/s].
        merge: disturbances with a shorter rest between them are one; nor is a shorter rest
            between closing and the first of them stable [s].
        margin: by which a disturbance is drawn longer at both ends [s].
        blip: contact, or its loss, that lasts less than this is ignored [s].
        glitch: time after a glitch of the hand's controller in which what happens is caused by
            it [s]: the hand rings at 6 to 8 Hz. None: glitches are not labelled.
    """

    contact: float = CONTACT_FORCE
    sliding: float = SLIP_SPEED
    merge: float = MERGE_GAP
    margin: float = UNSTABLE_MARGIN
    blip: float = MIN_CONTACT_DURATION
    glitch: float | None = GLITCH_DURATION


def labels_from_truth(
    truth: Truth, finger: str, rule: LabelRule | None = None
) -> tuple[Label, ...]:
    """The labels of one finger.

    Stable while the object is locked, the finger touches it, nobody else does and it does not
    slide: the hand alone governs it, as the paper has it. So the hand-over at both ends is not
    stable. Unstable while the hand closes or opens on it, during disturbances (cause slip, where
    it slides in them) and after a glitch of the hand's controller, with the slip that it causes
    (cause glitch); no contact otherwise.

    Args:
        truth: with `phase`, `outside_force` and, if known, `set_point_error` of the hand, and
            `contact_force` and `slip_speed` of the finger.
        finger: whose labels.
        rule: thresholds and margins.
    """
    rule = rule or LabelRule()
    times = truth.times
    arrays = truth.fingers[finger]
    phase = truth.hand["phase"]
    touching = _steady(
        np.linalg.norm(arrays["contact_force"], axis=1) > rule.contact, times, rule.blip
    )
    held = np.isin(phase, HELD_PHASES)
    sliding = held & (arrays["slip_speed"] > rule.sliding)
    glitched = held & glitches(truth, rule)
    caused = runs_with(sliding, glitched)
    glitched, sliding = glitched | caused, sliding & ~caused
    acted = held & (np.linalg.norm(truth.hand["outside_force"], axis=1) > rule.contact)
    troubled = np.isin(phase, (Phase.DISTURBED, Phase.SLIPPING)) | sliding | acted
    troubled = held & widen_runs(join_runs(troubled, times, rule.merge), times, rule.margin)
    troubled = held & _bridged(phase == Phase.CLOSING, troubled, times, rule.merge)
    lost = _since(held) & ~_since(phase == Phase.RELEASED) & (phase == Phase.FREE)
    slipped = runs_with(troubled, sliding)
    states = [
        _state(*row)
        for row in zip(
            touching.tolist(),
            held.tolist(),
            troubled.tolist(),
            slipped.tolist(),
            (phase == Phase.CLOSING).tolist(),
            lost.tolist(),
            glitched.tolist(),
            strict=True,
        )
    ]
    period = float(np.median(np.diff(times)))
    return labels_from_samples(times, states, period=period, evidence="truth", author="twin")


def glitches(truth: Truth, rule: LabelRule) -> Mask:
    """Return where a glitch of the hand's controller acts, or has acted shortly before.

    Args:
        truth: with `set_point_error` of the hand, if it is known.
        rule: says for how long a glitch acts.
    """
    error = truth.hand.get("set_point_error")
    if rule.glitch is None or error is None:
        return np.zeros(len(truth.times), dtype=bool)
    found = error > 0
    for _, end in runs(found):
        last = np.searchsorted(truth.times, truth.times[end - 1] + rule.glitch, side="right")
        found[end:last] = True
    return np.asarray(found)


def phases_as_felt(phase: npt.NDArray[np.str_], push: Array, touch: float) -> npt.NDArray[np.str_]:
    """Phases in which every disturbance lasts from its first touch to its last.

    The finger that pushes comes from afar and may leave the object well before it has done:
    nobody can feel its plan.

    Args:
        phase: (n,) as planned.
        push: (n,) force of the finger that pushes [N].
        touch: force from which on it touches [N].
    """
    planned = np.isin(phase, (Phase.DISTURBED, Phase.SLIPPING))
    felt = np.zeros_like(planned)
    for start, end in runs(planned):
        touches = start + np.flatnonzero(push[start:end] > touch)
        if len(touches):
            felt[touches[0] : touches[-1] + 1] = True
    return np.where(planned & ~felt, Phase.LOCKED.value, phase)


def _state(
    touching: bool,
    held: bool,
    troubled: bool,
    slipped: bool,
    closing: bool,
    lost: bool,
    glitched: bool,
) -> tuple[ContactState, Cause | None]:
    if troubled:
        return ContactState.UNSTABLE, Cause.SLIP if slipped else Cause.DISTURBANCE
    if not touching:
        return ContactState.NO_CONTACT, Cause.LOST if lost else None
    if glitched:
        return ContactState.UNSTABLE, Cause.GLITCH
    if held:
        return ContactState.STABLE, None
    if closing:
        return ContactState.UNSTABLE, Cause.CLOSING
    return ContactState.UNSTABLE, Cause.LOST if lost else Cause.RELEASED


def _bridged(before: Mask, mask: Mask, times: Array, gap: float) -> Mask:
    """The mask, from the end of `before` on where it begins less than `gap` later."""
    bridged = mask.copy()
    for _, end in runs(before):
        start = end + int(np.argmax(mask[end:])) if mask[end:].any() else end
        if start > end and times[start] - times[end] < gap:
            bridged[end:start] = True
    return bridged


def _steady(mask: Mask, times: Array, blip: float) -> Mask:
    """The mask without rests and then without runs that are shorter than `blip`."""
    return ~join_runs(~join_runs(mask, times, blip), times, blip)


def _since(mask: Mask) -> Mask:
    """True from the first True on."""
    return np.logical_or.accumulate(mask)
