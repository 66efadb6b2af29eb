"""Course of a trial over time, beyond the loss of the object, for a figure."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple, Self

import msgspec
import numpy as np

from holdfast.contact import CONTACT_FORCE
from holdfast.twin.hand import RATE
from holdfast.twin.steps import TIP_LOAD, TIP_SLIP
from holdfast_lab.trial.run import RunningTrial, least_force_at
from holdfast_lab.trial.trials import IMPACT_SPACING, Trial

LEAD_TIME = 0.5
"""Time before the load with which a course begins [s]."""
FALL_TIME = 0.4
"""Time after the loss of the object with which it ends [s]."""


class Instant(NamedTuple):
    """One sample of a trial.

    Attributes:
        time: time since the load began [s].
        force: sum of the normal forces [N].
        least: least sum that holds the object [N].
        slip_speed: largest slip speed of a fingertip in contact [m/s].
        is_lost: whether the object is lost.
    """

    time: float
    force: float
    least: float
    slip_speed: float
    is_lost: bool


class TrialCourse(msgspec.Struct, frozen=True):
    """Course of one trial with one law, by sample.

    Attributes:
        times: (n,) time since the load began [s].
        force: (n,) sum of the normal forces [N].
        least: (n,) least sum that holds the object [N].
        slip_speed: (n,) largest slip speed of a fingertip in contact [m/s].
        lost_at: time at which the object was lost [s]; None if it was held.
    """

    times: list[float]
    force: list[float]
    least: list[float]
    slip_speed: list[float]
    lost_at: float | None = None

    @classmethod
    def of(cls, instants: Iterable[Instant]) -> Self:
        """Return the course of the samples."""
        every = list(instants)
        lost = (moment.time for moment in every if moment.is_lost)
        return cls(
            times=[moment.time for moment in every],
            force=[moment.force for moment in every],
            least=[moment.least for moment in every],
            slip_speed=[moment.slip_speed for moment in every],
            lost_at=next(lost, None),
        )


def follow(trial: Trial, law: str, model: str) -> Iterator[Instant]:
    """Run a trial with a law; yield its samples from shortly before the load to its end.

    The simulation does not end when the object is lost, but `FALL_TIME` later.
    """
    running = RunningTrial(trial, law, model)
    n_lost = 0
    while not running.is_over and n_lost <= FALL_TIME * RATE:
        running.step()
        n_lost += running.is_lost
        held_for = running.simulation.held_for
        # An impact may already cost the object.
        if held_for < trial.load.start - LEAD_TIME - trial.n_impacts * IMPACT_SPACING:
            continue
        tips = running.simulation.world.contact.tips
        # Without contact a fingertip moves over nothing: it does not slide.
        speeds = np.where(tips[:, TIP_LOAD] > CONTACT_FORCE, tips[:, TIP_SLIP], 0.0)
        yield Instant(
            time=held_for - trial.load.start,
            force=float(tips[:, TIP_LOAD].sum()),
            least=least_force_at(trial, held_for),
            slip_speed=float(speeds.max()),
            is_lost=running.is_lost,
        )
