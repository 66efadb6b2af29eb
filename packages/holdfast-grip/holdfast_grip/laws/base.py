"""Input and output of a grip law."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from holdfast.contact import Cause, ContactEstimate, ContactState
from holdfast_grip.command import GripReason

Three = tuple[float, float, float]
_NO_CONTACT = ContactState.NO_CONTACT


class Touch:
    """Raw estimate of one loaded finger, which the controller updates at every sample.

    Args:
        finger: name of the finger.
        normal: unit vector of the skin's normal in the fingertip frame.
        factors: factor of each axis of the readings' forces, for a calibration.
        reports_slips: whether the model ever reports a slip.

    Attributes:
        finger: name of the finger.
        known: whether there is an estimate; False while the state is UNKNOWN.
        touching: whether the finger is in contact.
        probability: probability that the contact is stable, of this sample, not debounced.
        slides: whether the slip rule of the model decides that the finger slides; False without
            such a rule.
        knows_slips: whether the model has a slip rule, and reports slips.
        slip_probability: probability that the finger slides; 0 unless it `knows_slips`.
        force: (F_x, F_y, F_z) in the fingertip frame [N with a calibration, else the readings'].
        normal: force along the normal of the skin, at least 0 [as `force`].
        tangential: force along the skin [as `force`].
        start_normal: `normal` when the grip began [as `force`].
        scale: force scale that was commanded last.
    """

    __slots__ = (
        "_factors",
        "_normal",
        "_reports_slips",
        "finger",
        "force",
        "known",
        "knows_slips",
        "normal",
        "probability",
        "scale",
        "slides",
        "slip_probability",
        "start_normal",
        "tangential",
        "touching",
    )

    def __init__(
        self,
        finger: str,
        normal: Three = (1.0, 0.0, 0.0),
        factors: Three = (1.0, 1.0, 1.0),
        *,
        reports_slips: bool = True,
    ) -> None:
        self._normal, self._factors = normal, factors
        self._reports_slips = reports_slips
        self.finger = finger
        self.known = self.touching = False
        self.probability = math.nan
        self.slides = self.knows_slips = False
        self.slip_probability = 0.0
        self.force = (0.0, 0.0, 0.0)
        self.normal = self.tangential = 0.0
        self.start_normal = 0.0
        self.scale = 1.0

    def read(self, estimate: ContactEstimate) -> bool:
        """Copy an estimate that is not UNKNOWN; return False if a number is not finite."""
        x, y, z = estimate.force
        a, b, c = self._factors
        u, v, w = self._normal
        x, y, z = a * x, b * y, c * z
        along = x * u + y * v + z * w
        square = x * x + y * y + z * z
        across = square - along * along
        self.known = True
        self.touching = estimate.state is not _NO_CONTACT
        self.probability = probability = estimate.stable_probability
        # A slip rule that never decides a slip has a probability all the same, which only ranks.
        slip = estimate.slip_probability if self._reports_slips else None
        self.knows_slips = slip is not None
        self.slides = slip is not None and estimate.cause is Cause.SLIP
        self.slip_probability = 0.0 if slip is None else slip
        self.force = (x, y, z)
        self.normal = along if along > 0.0 else 0.0
        # Rounding makes it negative where the force is along the normal.
        self.tangential = math.sqrt(across) if across > 0.0 else 0.0
        # Each comparison is False for NaN as well as for infinity.
        return square < math.inf and abs(probability) < math.inf and abs(slip or 0.0) <= 1.0

    def start(self) -> None:
        """Take the present force as that of the start of the grip."""
        self.start_normal = self.normal


ForceTarget = tuple[float, GripReason]
"""Target force scale of a finger, and the reason if it differs from the present one."""


class Law(ABC):
    """Law of grip force: from the touches of the loaded fingers to their target scales.

    The controller limits the speed, range and cooldown of the targets. A law has no clock, and two
    objects of a class return the same targets for the same touches.

    Attributes:
        needs_newtons: whether the law needs forces in newtons.
        dead_time: time after the start of a reaction in which the law starts no other one on
            that finger [s]; the rise of force itself shakes the contact.
        notice: a message for the user, which the loop logs and clears; empty without one.
    """

    needs_newtons: ClassVar[bool] = False
    dead_time: float = 0.0
    notice: str = ""

    @abstractmethod
    def start(self, touches: Sequence[Touch], thumb: int) -> None:
        """Begin a grip.

        Args:
            touches: of the loaded fingers, at the start of the grip.
            thumb: index of the finger opposite to all others; -1 if there is none.
        """

    @abstractmethod
    def targets(self, touches: Sequence[Touch], time: float, dt: float) -> list[ForceTarget]:
        """Return the target of each finger.

        Args:
            touches: of the loaded fingers, in the order of `start`.
            time: time of the update [s].
            dt: time since the last update [s].
        """


def stay(touches: Sequence[Touch]) -> list[ForceTarget]:
    """Return the present scales as targets."""
    return [(touch.scale, GripReason.NONE) for touch in touches]
