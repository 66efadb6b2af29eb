"""One trial with one law: the twin, the detector and the controller in turns."""

import math
from functools import cache

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import CONTACT_FORCE, SLIP_SPEED
from holdfast.detector import Detector
from holdfast.grip.command import GripCommand, LoopState
from holdfast.grip.controller import GripController
from holdfast.grip.limits import Limits
from holdfast.model import Model
from holdfast.sensors.types import Array
from holdfast.sensors.xela_models import NEWTONS_PER_NORMAL_COUNT, NEWTONS_PER_SHEAR_COUNT
from holdfast.twin.contact import TIP_LOAD, TIP_SLIP
from holdfast.twin.grasp import GRASP_DIRECTION
from holdfast.twin.hand import FINGERS, GRAVITY, RATE
from holdfast.twin.loads import load_state
from holdfast.twin.simulation import Simulation
from holdfast_lab.trial.trials import Trial

LIMITS = Limits()
"""Limits of all laws: those that `holdfast hold` has by default. The lowest scale is 1.6 times the
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
REST_TIME = 0.3
"""A new rise of force later than this after the last one is another reaction [s]."""
SLIP_MEMORY = 0.3
"""A reaction within this time after a fingertip slid is not false [s]: glitches of the hand's
controller make fingertips slide before the load comes."""
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
        dropped: whether the object was lost afterwards.
        slip: largest sliding distance of a fingertip [m]; infinite if dropped.
        slipped: whether a fingertip slid faster than `SLIP_SPEED`.
        reaction: time from the onset of slip to the rise of the commanded force, 0 if it rose
            before [s]; infinite without a rise, NaN if nothing slipped.
        force_ratio: mean normal force over the mean of the least force, until the drop.
        peak_ratio: largest normal force over the largest least force.
        quiet_time: time of control before the load in which nothing slid shortly before [s].
        n_false: number of reactions in this time.
    """

    number: int
    law: str
    object: str
    unseen: bool
    kind: str
    n_fingers: int
    held: bool
    dropped: bool = True
    slip: float = math.inf
    slipped: bool = False
    reaction: float = math.nan
    force_ratio: float = math.nan
    peak_ratio: float = math.nan
    quiet_time: float = 0.0
    n_false: int = 0


def run_trial(trial: Trial, law: str, model: str = "builtin:any") -> TrialResult:
    """Run a trial with a law.

    Args:
        trial: the trial.
        law: name of the law.
        model: name of the model of the detector. `builtin:any` was trained on any grip;
            `builtin:twin` calls the light grips of the trials unstable.
    """
    running = RunningTrial(trial, law, model)
    log = _TrialLog(trial)
    while not (running.is_over or running.is_lost):
        command = running.step()
        log.add(running.simulation, command, running.scales)
    return log.result(law, lost=running.is_lost)


class RunningTrial:
    """One trial with one law, sample by sample.

    The command that follows from a sample acts from the next sample on, 6.7 ms later.

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
        sensors = {finger: uskin.sensor for finger, uskin in self.simulation.uskins.items()}
        self._detector = Detector(_model(model), sensors)
        self._controller = GripController(
            LIMITS, law, sensors=sensors, newtons_per_unit=NEWTONS_PER_FINGERTIP_COUNT
        )
        self.scales = np.ones(len(FINGERS))

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
        estimate = self._detector.update(self.simulation.read(), time)
        command = self._controller.update(estimate, time)
        self.scales = np.array([_scale(command, finger) for finger in FINGERS])
        return command


@cache
def _model(name: str) -> Model:
    return Model.load(name)


def _scale(command: GripCommand, finger: str) -> float:
    finger_command = command.fingers.get(finger)
    return 1.0 if finger_command is None else finger_command.scale


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


class _TrialLog:
    """Numbers of a trial, sample by sample."""

    def __init__(self, trial: Trial) -> None:
        self._trial = trial
        self._rows: list[tuple[float, float, float, float]] = []  # time, force, least, slip speed
        self._scales: list[Array] = []
        self._slid = np.zeros(len(FINGERS))
        self._began_at = math.nan
        self._rising_at = self._slid_at = -math.inf
        self._quiet_time = 0.0
        self._n_false = 0

    def add(self, simulation: Simulation, command: GripCommand, scales: Array) -> None:
        """Add a sample."""
        held_for = simulation.held_for
        if held_for < 0:
            return
        if command.state is not LoopState.IDLE and math.isnan(self._began_at):
            self._began_at = held_for
        tips = simulation.world.contact.tips
        speeds = np.where(tips[:, TIP_LOAD] > CONTACT_FORCE, tips[:, TIP_SLIP], 0.0)
        if held_for >= self._trial.load.start:
            self._slid += np.where(speeds > SLIP_SPEED, speeds, 0.0) / RATE
        elif command.state is not LoopState.IDLE:
            self._add_quiet(held_for, command, slides=bool(speeds.max() > SLIP_SPEED))
        least = least_force_at(self._trial, held_for)
        self._rows.append((held_for, float(tips[:, TIP_LOAD].sum()), least, float(speeds.max())))
        self._scales.append(scales)

    def _add_quiet(self, held_for: float, command: GripCommand, *, slides: bool) -> None:
        """Count reactions before the load, and the time in which one would be false."""
        if slides:
            self._slid_at = held_for
        quiet = held_for - self._slid_at > SLIP_MEMORY
        self._quiet_time += quiet / RATE
        if command.state is LoopState.REACT:
            self._n_false += quiet and held_for - self._rising_at > REST_TIME
            self._rising_at = held_for

    def result(self, law: str, *, lost: bool) -> TrialResult:
        """Return the result of the trial."""
        trial = self._trial
        rows = np.array(self._rows).reshape(-1, 4)
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
        )
        if not (loaded.any() or controlled.any()):
            return base
        scored = loaded | controlled
        force, least = rows[scored, 1], rows[scored, 2]
        slipping = loaded & (rows[:, 3] > SLIP_SPEED)
        return msgspec.structs.replace(
            base,
            held=True,
            dropped=lost,
            slip=math.inf if lost else float(self._slid.max()),
            slipped=bool(slipping.any()),
            reaction=self._reaction(rows[:, 0], loaded, slipping),
            force_ratio=float(force.mean() / least.mean()),
            peak_ratio=float(force.max() / least.max()),
            quiet_time=self._quiet_time,
            n_false=self._n_false,
        )

    def _reaction(self, times: Array, loaded: Mask, slipping: Mask) -> float:
        if not slipping.any():
            return math.nan
        scales = np.array(self._scales)
        first = scales[np.argmax(loaded)]  # slipping is loaded: there is a sample
        risen = loaded & (scales > RISE * first).any(axis=1)
        if not risen.any():
            return math.inf
        return max(0.0, float(times[np.argmax(risen)] - times[np.argmax(slipping)]))
