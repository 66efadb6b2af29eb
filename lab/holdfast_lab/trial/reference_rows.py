"""Rows beside the laws: constant forces, and oracles that know what no sensor knows.

They bound what a law can reach. `fixed-2` raises the first grip once. `true-slips` is the law of
holdfast with the true slip of each finger in place of the estimates. `true-load-2` presses by twice
the least force that holds, with the true load, friction and contacts. `without-kick` and
`without-advance` are the law of holdfast without one of its rules.
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
from holdfast_grip.laws.base import ForceTarget
from holdfast_grip.laws.stability import Stability
from holdfast_lab.trial.needed_force import needed_force
from holdfast_lab.trial.trials import Trial

TRUE_SLIPS = "true-slips"
"""The row whose estimates are replaced by the truth."""
SLIPPING_PROBABILITY, HOLDING_PROBABILITY = 0.02, 0.98
"""Probability of stability of a finger that slides, and of one that does not, in that row."""


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


REFERENCE_ROWS: dict[str, Callable[[], Law]] = {
    "without-kick": lambda: Stability(kick=False),
    "without-advance": lambda: Stability(advance=False),
    "fixed-2": lambda: ConstantForce(2.0),
    TRUE_SLIPS: LAWS["holdfast"],
    "true-load-2": lambda: KnownLoad(2.0),
}
"""Rows that are no laws for a hand, by name."""


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
