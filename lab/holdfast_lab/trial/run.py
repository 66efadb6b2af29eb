"""One trial with one law: the twin, the detector and the controller in turns."""

import math
from collections import deque
from functools import cache
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import CONTACT_FORCE, SLIP_SPEED
from holdfast.detection import Detector, Model
from holdfast.sensors.types import Array
from holdfast.sensors.xela_models import NEWTONS_PER_NORMAL_COUNT, NEWTONS_PER_SHEAR_COUNT
from holdfast.twin.grasp import GRASP_DIRECTION
from holdfast.twin.hand import FINGERS, GRAVITY, RATE
from holdfast.twin.loads import load_state
from holdfast.twin.simulation import Simulation
from holdfast.twin.steps import TIP_LOAD, TIP_SLIP
from holdfast.twin.uskin_readout import Counts
from holdfast_grip.command import GripCommand, LoopState
from holdfast_grip.controller import GripController
from holdfast_grip.limits import Limits
from holdfast_lab.trial.needed_force import needed_force
from holdfast_lab.trial.quiet_hold import QuietHold
from holdfast_lab.trial.reference_rows import (
    TRUE_SLIPS,
    KnownLoad,
    row_named,
    true_estimate,
)
from holdfast_lab.trial.trials import Trial

LIMITS = Limits()
"""Limits of all rows: those that `holdfast hold` has by default. The lowest scale is 1.6 times the
least force of an unloaded object."""
NEWTONS_PER_FINGERTIP_COUNT = (
    NEWTONS_PER_NORMAL_COUNT,
    NEWTONS_PER_SHEAR_COUNT,
    NEWTONS_PER_SHEAR_COUNT,
)
"""Calibration for the laws that need newtons, from the data sheet of the flat sensor: normal and
tangential axes of the fingertip frame [N/count]."""
RISE = 1.02
"""Ratio of a force scale to that at the start of the load from which it counts as a reaction."""
LIMIT_SHARE = 0.99
"""Share of the highest scale from which a finger is at its limit of force."""
NEVER_BEGAN, AT_LIMIT, WHILE_SLIPPING = DROP_REASONS = ("never began", "limit of force", "slip")
"""Why an object was lost: the loop never began, a finger was at the highest scale, or neither."""
Mask = npt.NDArray[np.bool_]
UP = np.array([0.0, 0.0, GRAVITY])
"""Acceleration that carries a weight [m/s^2]."""
GRASP_AXIS = np.array([np.cos(GRASP_DIRECTION), -np.sin(GRASP_DIRECTION), 0.0])
"""Direction in the world along which the thumb pushes."""


class TrialResult(msgspec.Struct, frozen=True, kw_only=True):
    """Result of one trial with one law.

    Attributes:
        number: number of the trial.
        law: name of the law.
        object: name of the object.
        unseen: whether the model has not seen the object.
        kind: kind of the load.
        n_fingers: number of fingers of the grip.
        held: False if the object was lost before the load, and before the loop had begun: the
            first grip failed, and nothing is scored.
        feasible: whether the object can be held at all, see `NeededForce.feasible`.
        dropped: whether the object was lost afterwards.
        drop_reason: why; empty if it was not dropped.
        slip: largest sliding distance of a fingertip since the loop began or the load came,
            whichever was first [m]; infinite if dropped.
        slipped: whether a fingertip slid faster than `SLIP_SPEED` under the load.
        raised_before: whether the force had risen since the load began when the first fingertip
            slid: then there is no reaction to that slip.
        reaction: time from the onset of slip to the next rise of the commanded force [s];
            infinite without one, NaN if nothing slipped or the force had risen before.
        force_ratio: mean normal force over the mean of the least force that stops a slide, by
            linear programming (`needed_force`), until the drop.
        static_ratio: the same with static friction, the least force that holds without a slide.
        coulomb_ratio: the same over the least force without contacts and moments, by Coulomb
            friction at rest (`least_force_at`).
        peak_ratio: largest normal force over the largest least force that stops a slide.
        quiet_time: time of control before the load in which nothing slid shortly before [s].
        n_false: number of rises of force in this time.
        n_impacts: number of impacts that the loop saw before the load.
        n_impact_reactions: number of these after which the force rose.
    """

    number: int
    law: str
    object: str
    unseen: bool
    kind: str
    n_fingers: int
    held: bool
    feasible: bool = True
    dropped: bool = True
    drop_reason: str = ""
    slip: float = math.inf
    slipped: bool = False
    raised_before: bool = False
    reaction: float = math.nan
    force_ratio: float = math.nan
    static_ratio: float = math.nan
    coulomb_ratio: float = math.nan
    peak_ratio: float = math.nan
    quiet_time: float = 0.0
    n_false: int = 0
    n_impacts: int = 0
    n_impact_reactions: int = 0


def run_trial(trial: Trial, law: str, model: str = "builtin:twin") -> TrialResult:
    """Run a trial with a law.

    Args:
        trial: the trial.
        law: name of the law.
        model: name of the model of the detector; `builtin:twin` was trained on the twin's hand,
            and `builtin:any` on others.
    """
    running = RunningTrial(trial, law, model)
    log = _TrialLog(trial)
    while not (running.is_over or running.is_lost):
        command = running.step()
        log.add(running.simulation, command, running.scales)
    return log.result(law, lost=running.is_lost)


class RunningTrial:
    """One trial with one law, sample by sample.

    The command that follows from a sample acts from the next sample on, 6.7 ms later. In a plant
    with latency, samples arrive late. Oracles know the truth at once.

    Args:
        trial: the trial.
        law: name of the law.
        model: name of the model of the detector.

    Attributes:
        trial: the trial.
        simulation: the twin.
        scales: (4,) force scales of the last command.
    """

    def __init__(self, trial: Trial, law: str, model: str) -> None:
        self.trial = trial
        self.simulation = Simulation(trial.grasp, plan=trial.plan(), loads=[trial.load])
        sensors = {finger: skin.sensor for finger, skin in self.simulation.skins.items()}
        detecting = _model(model)
        self._detector = Detector(detecting, sensors)
        self._law, self._sees_truth = row_named(law), law == TRUE_SLIPS
        self._controller = GripController(
            LIMITS, self._law, sensors=sensors,
            newtons_per_unit=NEWTONS_PER_FINGERTIP_COUNT,
            reports_slips=detecting.reports_slips or self._sees_truth,
        )  # fmt: skip
        self.scales = np.ones(len(FINGERS))
        self._late: deque[dict[str, Counts]] = deque()

    @property
    def is_lost(self) -> bool:
        """Whether the object is lost."""
        return self.simulation.protocol.lost_at is not None

    @property
    def is_over(self) -> bool:
        """Whether the time of the trial is over, or the grasp."""
        return self.simulation.is_over or self.simulation.held_for > self.trial.duration

    def step(self) -> GripCommand:
        """Simulate one sample and return the command that follows from it."""
        self.simulation.step(self.scales)
        time = (self.simulation.n_samples - 1) / RATE
        # A queue of samples is the latency: each is used when `latency` others have come.
        self._late.append(self.simulation.read())
        if len(self._late) <= self.trial.latency:
            return GripCommand(time, LoopState.IDLE, {})
        samples = self._late.popleft()
        estimate = self._detector.update(samples, time)
        if self._sees_truth:
            estimate = true_estimate(estimate, self.simulation)
        if isinstance(self._law, KnownLoad):
            self._law.know(self.simulation, self.trial)
        command = self._controller.update(estimate, time)
        # Fingers that a command leaves out keep the force of the first grip.
        scales = {
            finger: finger_command.scale for finger, finger_command in command.fingers.items()
        }
        self.scales = np.array([scales.get(finger, 1.0) for finger in FINGERS])
        return command


@cache
def _model(name: str) -> Model:
    return Model.load(name)


def least_force_at(trial: Trial, held_for: float) -> float:
    """Return the least sum of normal forces at a time after the lock, by Coulomb friction [N].

    The fingers carry F = m (a - g) - F_outside. Its part F_t across the axis of the grasp needs
    friction on both sides, |F_t| <= mu_s (N_thumb + N_fingers), and the part along it needs
    |F_n| on one side: the least sum is the larger of |F_t| / mu_s and |F_n|.
    """
    item = trial.grasp.item
    load = load_state([trial.load], held_for)
    carried = item.mass * (load.acceleration + UP) - load.force
    along = float(carried @ GRASP_AXIS)
    across = float(np.linalg.norm(carried - along * GRASP_AXIS))
    return max(across / (item.mu_static * load.friction), abs(along))


class _Sample(NamedTuple):
    """Numbers of one sample of a trial.

    Attributes:
        held_for: time since the lock [s].
        force: sum of the normal forces [N].
        to_hold: least sum that holds by static friction [N].
        to_stop: least sum that stops a slide [N].
        coulomb: least sum without contacts and moments [N].
        slip_speed: largest slip speed of a fingertip in contact [m/s].
    """

    held_for: float
    force: float
    to_hold: float
    to_stop: float
    coulomb: float
    slip_speed: float


class _TrialLog:
    """Numbers of a trial, sample by sample."""

    def __init__(self, trial: Trial) -> None:
        self._trial = trial
        self._needed = needed_force(trial)
        self._samples: list[_Sample] = []
        self._scales: list[Array] = []
        self._slid = np.zeros(len(FINGERS))
        self._began_at = math.nan
        self._at_limit = False
        self._quiet = QuietHold(trial.impacts())

    def add(self, simulation: Simulation, command: GripCommand, scales: Array) -> None:
        """Add a sample."""
        held_for = simulation.held_for
        if held_for < 0:
            return
        began = command.state is not LoopState.IDLE
        if began and math.isnan(self._began_at):
            self._began_at = held_for
        tips = simulation.world.contact.tips
        speeds = np.where(tips[:, TIP_LOAD] > CONTACT_FORCE, tips[:, TIP_SLIP], 0.0)
        is_loaded = held_for >= self._trial.load.start
        if began or is_loaded:
            self._slid += np.where(speeds > SLIP_SPEED, speeds, 0.0) / RATE
        if began and not is_loaded:
            self._quiet.add(held_for, float(speeds.max()), command)
        self._at_limit = bool((scales >= LIMIT_SHARE * LIMITS.max_scale).any())
        least = (*self._needed.at(held_for), least_force_at(self._trial, held_for))
        force = float(tips[:, TIP_LOAD].sum())
        self._samples.append(_Sample(held_for, force, *least, float(speeds.max())))
        self._scales.append(scales)

    def result(self, law: str, *, lost: bool) -> TrialResult:
        """Return the result of the trial."""
        trial = self._trial
        rows = np.array(self._samples).reshape(-1, len(_Sample._fields))
        loaded = rows[:, 0] >= trial.load.start
        controlled = rows[:, 0] >= self._began_at
        base = TrialResult(
            number=trial.number,
            law=law,
            object=trial.grasp.object,
            unseen=trial.unseen,
            kind=trial.load.kind.value,
            n_fingers=trial.n_fingers,
            held=False,
            feasible=self._needed.feasible,
        )
        if not (loaded.any() or controlled.any()):
            return base
        slipping = loaded & (rows[:, -1] > SLIP_SPEED)
        drop_reason = ""
        if lost:
            began = not math.isnan(self._began_at)
            # The state at the last sample: a scale that was at its limit before may have fallen.
            drop_reason = WHILE_SLIPPING if not self._at_limit else AT_LIMIT
            drop_reason = drop_reason if began else NEVER_BEGAN
        raised_before, reaction = self._reaction(rows[:, 0], loaded, slipping)
        return msgspec.structs.replace(
            base,
            held=True,
            dropped=lost,
            drop_reason=drop_reason,
            slip=math.inf if lost else float(self._slid.max()),
            slipped=bool(slipping.any()),
            raised_before=raised_before,
            reaction=reaction,
            quiet_time=self._quiet.quiet_time,
            n_false=self._quiet.n_false,
            n_impacts=len(self._quiet.impacts),
            n_impact_reactions=sum(impact.is_answered for impact in self._quiet.impacts),
            **_force_ratios(rows[loaded | controlled]),
        )

    def _reaction(self, times: Array, loaded: Mask, slipping: Mask) -> tuple[bool, float]:
        """Return whether the force rose before the first slip, and the reaction to it [s]."""
        if not slipping.any():
            return False, math.nan
        scales = np.array(self._scales)
        onset, start = int(np.argmax(slipping)), int(np.argmax(loaded))
        # A force that the law raised for the load itself is no reaction to the slip.
        if (scales[onset - 1] > RISE * scales[start - 1]).any():
            return True, math.nan
        risen = (scales[onset:] > RISE * scales[onset - 1]).any(axis=1)
        return False, float(
            times[onset + np.argmax(risen)] - times[onset]
        ) if risen.any() else math.inf


def _force_ratios(rows: Array) -> dict[str, float]:
    """Return the ratios of the force to the least ones, where these are finite."""
    # Where no force holds, there is nothing to compare with.
    finite = np.isfinite(rows).all(axis=1)
    _, force, to_hold, to_stop, coulomb, _ = rows[finite].T
    if not finite.any():
        return {}
    mean = float(force.mean())
    return {
        "force_ratio": mean / float(to_stop.mean()),
        "static_ratio": mean / float(to_hold.mean()),
        "coulomb_ratio": mean / float(coulomb.mean()),
        "peak_ratio": float(force.max() / to_stop.max()),
    }
