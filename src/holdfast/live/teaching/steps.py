"""Steps of the guided protocol of `holdfast teach`, as a table."""

from enum import StrEnum
from typing import NamedTuple


class Check(StrEnum):
    """Check of a step, as soon as it is over.

    HEALTH: nothing touches the open hand, and its taxels are healthy. CARRIED: the object was held,
    and the force changed. FELT: it was held, and movements were felt. SLID: a camera saw slips.
    """

    HEALTH = "health"
    CARRIED = "carried"
    FELT = "felt"
    SLID = "slid"


class Step(NamedTuple):
    """One step: what a person, or a robot that pulls for itself, does.

    Attributes:
        name: of the step; the twin has a script of the same name.
        words: what the person does, in a few words.
        hint: how, in one sentence.
        check: of each grasp.
        seconds: time for it, from the first contact on [s].
        n_actions: number of pulls, pushes, taps or movements of the arm in that time.
        n_grasps: number of grasps, each a recording.
        in_view: whether the camera sees object and fingertips; an arm that carries leaves it.
    """

    name: str
    words: str
    hint: str
    check: Check
    seconds: float
    n_actions: int = 0
    n_grasps: int = 1
    in_view: bool = True

    @property
    def slides(self) -> bool:
        """Whether the object is to slide."""
        return self.check is Check.SLID


STEPS = (
    Step(
        "open", "OPEN THE HAND", "Nothing may touch it; the arm may turn.",
        Check.HEALTH, 10.0, in_view=False,
    ),
    Step(
        "carry", "CARRY AND TURN IT", "Move as in your task, as fast as in it. Nothing may slide.",
        Check.CARRIED, 30.0, n_actions=12, in_view=False,
    ),
    Step(
        "pull", "PULL UNTIL IT SLIDES", "Move it to and fro first. Then pull or turn it, and rest.",
        Check.SLID, 30.0, n_actions=6, n_grasps=2,
    ),
    Step(
        "push", "PUSH UNTIL IT SLIDES", "From all sides; let it rest between two pushes.",
        Check.SLID, 24.0, n_actions=6, n_grasps=2,
    ),
    Step(
        "touch", "TAP, KNOCK, PUSH SOFTLY", "With finger and tool, in turn; nothing slides.",
        Check.FELT, 40.0, n_actions=10,
    ),
)  # fmt: skip
"""The protocol: six grasps and three and a half minutes of samples, with 24 pulls and pushes of the
whole hand. The open hand comes first, to find noisy and dead taxels.
The slides come before the last step, so that a person who stops early has recorded slips."""
