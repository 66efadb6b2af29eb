"""The paper's own convention from the force alone: what a person reads off its plot.

No contact below the threshold of the tare stretch; closing while the force grows until it has
settled; stable while it stays; disturbances where it changes; released where it falls to its end.
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
from holdfast.features import Tare
from holdfast.features.tare import TareArgument
from holdfast.labelling.rules.base import Drawing, Pen, check_positive
from holdfast.labelling.rules.forces import (
    SEEN,
    FingerForce,
    HandForce,
    grip,
    hand_force,
    lost_at,
)
from holdfast.metrics.masks import Mask, drop_short_runs, fill_short_gaps, n_samples_of, runs
from holdfast.recordings import Label, Recording
from holdfast.sensors.types import Array

AUTHOR = "rule:signal"
LET_GO = 0.9
"""A finger lets go from when its force was last above this share of its grip."""
DROPPED = 0.1
"""A hand that is empty within this time did not open: it lost the object [s]."""
NOISE_TIMES = 6.0
"""Standard deviations of a component of the smoothed force that its change in a window exceeds
neither by chance nor in an hour: three components of about ten independent values each."""
REST_TIMES = 3.0
"""Where no tare tells the noise and the grip: how often the change in the calmest fifth."""


@dataclass(frozen=True)
class SignalRule:
    """What counts as a change of the force.

    Attributes:
        share: of a finger's grip by which its force changes, from which on a person sees it on
            a plot of the recording.
        window: within which it changes [s]; so trouble begins half of it before its first
            change and ends half of it after its last.
        settle: for how long nothing changes before the object counts as locked [s].
        merge: two disturbances with a shorter rest between them are one [s].

    Raises:
        ValueError: one is not above 0.
    """

    share: float = SEEN
    window: float = 2 * UNSTABLE_MARGIN
    settle: float = MERGE_GAP
    merge: float = MERGE_GAP

    def __post_init__(self) -> None:
        check_positive(self)


def propose(
    recording: Recording, tare: TareArgument | Tare = 0.5, rule: SignalRule | None = None
) -> dict[str, tuple[Label, ...]]:
    """Labels by finger from the force alone.

    A change that two fingers show is the object's: all that touch it get the disturbance. A
    change that one shows is its own.

    Args:
        recording: its labels and its truth are not looked at.
        tare: how the baseline is found; with "first" or "none", for recordings that begin in
            contact, the whole recording is held until the force drops for good.
        rule: what counts as a change.

    Raises:
        RecordingError: no sample to take the tare from.
        ValueError: an unknown tare.
    """
    rule = rule or SignalRule()
    hand = hand_force(recording, tare)
    change = {name: _change(finger, rule) for name, finger in hand.fingers.items()}
    troubled = _troubled(hand, change, rule)
    drawings = {name: _free(hand, finger) for name, finger in hand.fingers.items()}
    for start, end in _grasps(hand, rule):
        grasp = _Grasp(hand, change, troubled, slice(start, end), rule)
        for name in hand.fingers:
            grasp.paint(name, drawings[name])
    _paint_loss(hand, drawings)
    pen = Pen(AUTHOR, _evidence)
    return {name: pen.labels(drawings[name], each.span) for name, each in hand.fingers.items()}


def _change(finger: FingerForce, rule: SignalRule) -> Array:
    """(n,) the change of the force, in times of what counts as one."""
    change = finger.change(rule.window)
    touching = finger.contact
    if not touching.any():
        return np.zeros_like(change)
    if finger.threshold is None:
        least = REST_TIMES * float(np.quantile(change[touching], 0.2))
    else:
        least = max(rule.share * grip(finger, touching), NOISE_TIMES * finger.noise)
    return np.where(touching, change / max(least, np.finfo(float).tiny), 0.0)


def _troubled(hand: HandForce, change: Mapping[str, Array], rule: SignalRule) -> dict[str, Mask]:
    shown = np.sum([ratio > 1 for ratio in change.values()], axis=0) >= 2
    gap = n_samples_of(rule.merge - rule.window, hand.period)  # the window fills the rest of it
    return {
        name: fill_short_gaps(((change[name] > 1) | shown) & each.contact, gap) & each.contact
        for name, each in hand.fingers.items()
    }


def _grasps(hand: HandForce, rule: SignalRule) -> list[tuple[int, int]]:
    """From the first finger's touch to the last one's end."""
    touched = fill_short_gaps(hand.n_touching > 0, n_samples_of(rule.settle, hand.period))
    return [(int(start), int(end)) for start, end in runs(touched)]


def _free(hand: HandForce, finger: FingerForce) -> Drawing:
    drawing = Drawing.blank(hand.times)
    ratio: Array | float = 2.0
    if finger.threshold is not None:
        ratio = finger.threshold / np.maximum(finger.amplitude, np.finfo(float).tiny)
    drawing.paint(~finger.contact & finger.known, NO_CONTACT, None, ratio)
    return drawing


class _Grasp:
    """One grasp of the hand: closing, held, let go."""

    def __init__(
        self,
        hand: HandForce,
        change: Mapping[str, Array],
        troubled: Mapping[str, Mask],
        span: slice,
        rule: SignalRule,
    ) -> None:
        self._hand, self._change, self._troubled = hand, change, troubled
        self._rule = rule
        self._inside = np.zeros(len(hand.times), dtype=bool)
        self._inside[span] = True
        self._begun_held = all(each.threshold is None for each in hand.fingers.values())
        self._end = span.stop
        self._locked = span.start if self._begun_held else self._lock()

    def _lock(self) -> int:
        """Where all fingers that touch have been at rest for long enough for the first time."""
        hand = self._hand
        ever = sum((each.contact & self._inside).any() for each in hand.fingers.values())
        calm = self._inside & (hand.n_touching >= min(2, ever))
        for mask in self._troubled.values():
            calm &= ~mask
        rests = runs(drop_short_runs(calm, self._n(self._rule.settle)))
        return int(rests[0][0]) if len(rests) else self._end

    def paint(self, name: str, drawing: Drawing) -> None:
        """Draws the finger's part in the grasp."""
        finger, ratio = self._hand.fingers[name], self._change[name]
        touching = finger.contact & self._inside
        if not touching.any():
            return
        drawing.paint(touching, STABLE, None, 1 / np.maximum(ratio, np.finfo(float).tiny))
        drawing.paint(touching & self._troubled[name], UNSTABLE, Cause.DISTURBANCE, ratio)
        before = np.arange(len(touching)) < self._locked
        drawing.paint(touching & before, UNSTABLE, Cause.CLOSING, self._over(finger))
        if not self._begun_held:
            self._paint_end(name, touching, drawing)

    def _over(self, finger: FingerForce) -> Array | float:
        return 2.0 if finger.threshold is None else finger.amplitude / finger.threshold

    def _paint_end(self, name: str, touching: Mask, drawing: Drawing) -> None:
        """The last fall of the force, from the last of the grip; lost where there is no fall."""
        finger, every = self._hand.fingers[name], np.arange(len(touching))
        last = int(np.flatnonzero(touching)[-1])
        held = touching & (every >= self._locked)
        strong = np.flatnonzero(held & (finger.amplitude >= LET_GO * grip(finger, held)))
        if not len(strong) or last + 1 >= len(touching) or not finger.known[last + 1]:
            return
        onset = int(strong[-1])
        cause = Cause.LOST if last - onset < self._n(DROPPED) else Cause.RELEASED
        begun = self._begun(self._troubled[name] & held, onset)
        drawing.paint(touching & (every >= begun), UNSTABLE, cause, self._change[name])

    def _begun(self, troubled: Mask, onset: int) -> int:
        """Where the trouble that ends in a fall begins, unless it is a disturbance of its own."""
        calm = np.flatnonzero(~troubled[: onset + 1])
        start = int(calm[-1]) + 1 if len(calm) else 0
        return start if onset - start < self._n(self._rule.merge) else onset + 1

    def _n(self, duration: float) -> int:
        return n_samples_of(duration, self._hand.period)


def _paint_loss(hand: HandForce, drawings: Mapping[str, Drawing]) -> None:
    """In a recording that begins in contact: no contact once the force has dropped for good."""
    if any(each.threshold is not None for each in hand.fingers.values()):
        return
    place = lost_at(hand)
    if place is None:
        return
    after = np.arange(len(hand.times)) >= place
    for name, each in hand.fingers.items():
        drawings[name].paint(after & each.known, NO_CONTACT, Cause.LOST, 2.0)


def _evidence(state: ContactState, cause: Cause | None, ratio: float) -> str:
    times = f"{ratio:.3g} times"
    if state is ContactState.NO_CONTACT:
        return "force dropped for good" if cause else f"force {times} under the contact threshold"
    if state is ContactState.STABLE:
        return f"force settled: its change {times} under the limit"
    if cause is Cause.CLOSING:
        return f"force not settled yet, {times} the contact threshold"
    what = "falls to its end" if cause in (Cause.RELEASED, Cause.LOST) else "changes"
    return f"force {what}: {times} the limit of a settled one"
