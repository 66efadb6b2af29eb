"""Rows beside the laws: constant forces, and oracles that know what no sensor knows.

They bound what a law can reach. `fixed-1.5` and `fixed-2` raise the first grip once. `true-slips`
is the law of holdfast with the true slip of each finger in place of the estimates. `true-load-1.5`
and `true-load-2` press by this multiple of the least force that holds, with the true load, friction
and contacts. `v5-reflex` is the reflex that the driver of the Allegro Hand V5 has.
`holdfast-widest` and `pr2-widest` are laws with `WIDEST_LIMITS` in place of the limits as shipped.
"""

from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from holdfast.contact import (
    CONTACT_FORCE,
    SLIP_SPEED,
    Cause,
    ContactState,
    HandEstimate,
    hand_state,
)
from holdfast.twin.hand import FINGERS
from holdfast.twin.simulation import Simulation
from holdfast.twin.steps import TIP_LOAD, TIP_SLIP
from holdfast_grip.command import GripReason
from holdfast_grip.laws import LAWS, Law, Touch, law_named
from holdfast_grip.laws.base import ForceTarget, stay
from holdfast_grip.limits import Limits
from holdfast_lab.trial.needed_force import needed_force
from holdfast_lab.trial.trials import Trial

TRUE_SLIPS = "true-slips"
"""The row whose estimates are replaced by the truth."""
SLIPPING_PROBABILITY, HOLDING_PROBABILITY = 0.02, 0.98
"""Probability of stability of a finger that slides, and of one that does not, in that row."""

WIDEST_LIMITS = Limits(min_scale=0.5, max_scale=5.0)
"""Limits of the rows `*-widest`. A scale of 0.5 is the least force that holds the unloaded object;
5 is more than the twin's motors give in most grips."""
V5_FORCE = 2.0
"""Grasping force of the reflex of the V5, over that before."""


class ConstantForce(Law):
    """Law that multiplies the first grip once.

    Args:
        scale: force scale.
    """

    def __init__(self, scale: float) -> None:
        self.scale = scale

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Do nothing."""

    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Return the scale for all fingers."""
        return [(self.scale, GripReason.MARGIN) for _ in touches]


class KnownLoad(Law):
    """Law that presses by a multiple of the true least force.

    Args:
        multiple: of the least force.

    Attributes:
        force: least sum of normal forces now [N], from the truth.
        start_force: sum of the true normal forces when the grip began [N].
    """

    def __init__(self, multiple: float) -> None:
        self.multiple = multiple
        self.force = self.start_force = 0.0
        self._began = False

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Begin a grip."""
        self._began = True

    def know(self, simulation: Simulation, trial: Trial) -> None:
        """Take the truth of a sample."""
        self.force = min(needed_force(trial).at(simulation.held_for))
        # The first grip is the unit of every scale, so it is what was measured last before it.
        if not self._began:
            self.start_force = float(simulation.world.loads.sum())

    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Return the scale that gives the multiple of the least force."""
        # Nothing to press with, or no force that holds: an oracle has no answer, so it stays.
        if not (self.start_force > 0 and self.force < np.inf):
            return [(touch.scale, GripReason.NONE) for touch in touches]
        scale = self.multiple * self.force / self.start_force
        return [
            (scale, GripReason.LOAD if scale > touch.scale else GripReason.RELAX)
            for touch in touches
        ]


class V5Reflex(Law):
    """Reflex of the driver of the Allegro Hand V5: from force 1 to force 2, once.

    As in the driver: when the sum of the fingertip readings exceeds a level, the grasping force of
    all fingers rises from 1 to 2. The level there is 200, in the unit of the hand's own fingertip
    sensors, for which no calibration is known. Here the sum is that of the normal forces, and the
    level is a multiple of the sum with which the grip began, so it is the same for light and
    heavy objects; with a level below 1 the force doubles as soon as the grip begins. The force
    does not return to 1: the doubled force itself keeps the sum above the level.

    Args:
        level: sum of the normal forces that starts the reflex, over that of the first grip.
    """

    def __init__(self, level: float = 0.0) -> None:
        self.level = level

    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Begin a grip."""
        self._raised = False

    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Return a scale of 2 from when the sum has exceeded the level."""
        first = sum(touch.start_normal for touch in touches)
        total = sum(touch.normal for touch in touches if touch.known)
        self._raised = self._raised or total > self.level * first
        if not self._raised:
            return stay(touches)
        return [(V5_FORCE, GripReason.MARGIN)] * len(touches)


REFERENCE_ROWS: dict[str, Callable[[], Law]] = {
    "fixed-1.5": lambda: ConstantForce(1.5),
    "fixed-2": lambda: ConstantForce(2.0),
    TRUE_SLIPS: LAWS["holdfast"],
    "true-load-1.5": lambda: KnownLoad(1.5),
    "true-load-2": lambda: KnownLoad(2.0),
    "v5-reflex": V5Reflex,
    "holdfast-widest": LAWS["holdfast"],
    "pr2-widest": LAWS["pr2"],
}
"""Rows that are no laws for a hand, by name."""


def limits_of(row: str) -> Limits:
    """Return the limits of a law or reference row."""
    return WIDEST_LIMITS if row.endswith("-widest") else Limits()


def row_named(name: str) -> Law:
    """Return a new law or reference row.

    Raises:
        ValueError: there is no such law or row; the message lists the names.
    """
    if name in LAWS:
        return law_named(name)
    if name not in REFERENCE_ROWS:
        names = ", ".join([*LAWS, *REFERENCE_ROWS])
        raise ValueError(f"unknown law {name!r}; there are {names}")
    return REFERENCE_ROWS[name]()


def true_estimate(estimate: HandEstimate, simulation: Simulation) -> HandEstimate:
    """Return an estimate whose states and slips are those of the twin, with the measured forces."""
    tips = simulation.world.contact.tips
    fingers = {}
    for finger, row in zip(FINGERS, tips, strict=True):
        touching, slides = row[TIP_LOAD] > CONTACT_FORCE, row[TIP_SLIP] > SLIP_SPEED
        # Where the laws have no estimate, in a tare or a fault, this row has none either.
        if estimate.fingers[finger].state is ContactState.UNKNOWN:
            fingers[finger] = estimate.fingers[finger]
            continue
        state = ContactState.UNSTABLE if slides else ContactState.STABLE
        fingers[finger] = msgspec.structs.replace(
            estimate.fingers[finger],
            state=state if touching else ContactState.NO_CONTACT,
            cause=Cause.SLIP if touching and slides else None,
            stable_probability=SLIPPING_PROBABILITY if slides else HOLDING_PROBABILITY,
            slip_probability=float(touching and slides),
            slip_speed=1e3 * float(row[TIP_SLIP]) if touching and slides else 0.0,
        )
    # The state of the hand follows from those of its fingers by the rule of the detector.
    codes = np.array([finger.state.code for finger in fingers.values()], dtype=np.int64)
    number = hand_state(codes, len(fingers))
    state = next(kind for kind in ContactState if kind.code == number)
    return HandEstimate(estimate.time, state, fingers)
