"""Functions in C (`c/steps.h`). They refuse all but arrays in C order of the right shape."""

from collections.abc import Callable

import numpy as np

from holdfast.sensors.types import Array
from holdfast.twin.contact import Constants, Contact
from holdfast.twin.control import Controller
from holdfast.twin.hand import HandArrays
from holdfast.twin.physics import Action, Physics
from holdfast.twin.uskin_readout import Counts, _Constants, _State

Wrench = tuple[float, float, float, float, float, float]
"""Force [N] and torque about the centre of mass [N m] on the object."""

SOURCES: str
"""The digest of the C files that this extension was built from."""

REVOLVED: int
BOX: int
HEXAGON: int
CAPSULE: int
CODE: int
SIDE_OUT: int
SIDE_UP: int
SIDE_LENGTH: int
EXTENSION: int
CENTRE: int
TEXTURE_AMPLITUDE: int
AROUND_2: int
MU_STATIC: int
MU_KINETIC: int
N_OBJECT_NUMBERS: int
MAX_RELIEF: float

def distances(solid: Array, points: Array, out: Array, /) -> None:
    """Fill (n,) with the distances of points (n, 3) in the object's frame from its surface [m]."""

def probe(solid: Array, x: float, y: float, z: float, /) -> tuple[float, float, float, float]:
    """Return the distance of a point from the smooth object [m], and its gradient."""

def relief(solid: Array, x: float, y: float, z: float, /) -> float:
    """Return the depth of the texture at a point in the object's frame [m]."""

N_BRISTLE: int
MAX_COUPLED: int
TIP_SLIP: int
TIP_SLIPPING_SHARE: int
TIP_LOAD: int
N_TIP: int

def touch(state: Contact, constants: Constants, bodies: Array, dt: float, /) -> None:
    """Compute a step of the contact of bodies (n_tips + 1, 18), the last of which is the object."""

def fill_bodies(hand: HandArrays, bodies: Array, /) -> None:
    """Fill position, rotation, velocity and spin of fingertips and object, (n_tips + 1, 18)."""

def apply_forces(hand: HandArrays, tips: Array, total: Array, bodies: Array, /) -> None:
    """Apply wrenches on fingertips (n_tips, N_TIP) and object (6,) in MuJoCo."""

def on_object(
    fingers: Array,
    outside: Array,
    body: Array,
    inertia: Array,
    mass: float,
    spin: Array,
    turn: Array,
    /,
) -> Wrench:
    """Return fingers, operator and the inertia of a frame that spins [rad/s] and turns."""

DERIVATIVE: float
ENCODER_STEP: float
TORQUE_STEP: float
TORQUE_LIMIT: float

def control(
    controller: Controller,
    tick: int,
    joints: Array,
    bias: Array,
    target: Array,
    period: float,
    torques: Array,
    /,
) -> None:
    """Compute a step of the controller: the first 16 torques [N m]."""

PUSH: int
JERK: int
SHAKE: int
MOVE: int
HOLD_STIFFNESS: float
HOLD_TURN_STIFFNESS: float
PUSH_LIMIT: float
PUSH_GAP: float
MOVE_GRASP_TIME: float
GUIDE_STIFFNESS: int
N_GUIDE: int

def fill_targets(
    grid: Array, joints: Array, first: np.ndarray, depths: Array, out: Array, /
) -> None:
    """Fill the joints (16,) for the gaps of the fingertips on a path, see `ClosingPath`."""

def tremor_at(tremor: Array, time: float, axis: int, /) -> tuple[float, float]:
    """Return displacement and speed of a tremor of rms 1 along an axis."""

def aim(
    style: int, depth: float, rate: float, elapsed: float, duration: float, /
) -> tuple[float, float]:
    """Return the set-point of a pushing finger along its direction [m], and its speed [m/s]."""

def hold_wrench(
    body: Array,
    anchor: Array,
    gain: float,
    weight: float,
    tremor: Array,
    rms: float,
    time: float,
    /,
) -> Wrench:
    """Return the wrench of the hand that holds the object at an anchor (12,)."""

def guide_wrench(body: Array, guide: Array, ahead: float, tremor: Array, time: float, /) -> Wrench:
    """Return the wrench of a hand (N_GUIDE,) that takes the object along."""

def disturb_wrench(
    body: Array,
    origin: Array,
    parameters: Array,
    style: int,
    duration: float,
    tremor: Array,
    rms: float,
    elapsed: float,
    /,
) -> Wrench:
    """Return the wrench of a disturbance; `origin` (12,) is the pose when it began."""

def advance_sample(
    first_half: Callable[[], None],
    second_half: Callable[[], None],
    physics: Physics,
    tick: int,
    target: Array,
    action: Action,
    /,
) -> float:
    """Advance the physics by a sample; return the largest error of a set-point [rad].

    Args:
        first_half: `mj_step1` of MuJoCo's model and state.
        second_half: `mj_step2` of them.
        physics: everything else; it is written.
        tick: number of the first step.
        target: (16,) set-points of the joints [rad].
        action: what the operator does.
    """

def saturated(newtons: float, limit: float, /) -> float:
    """Return a reading that saturates at a limit [N]."""

def read_out(
    forces: Array,
    times: Array,
    drawn: Array,
    constants: _Constants,
    state: _State,
    out: Counts,
    /,
) -> None:
    """Fill the counts of samples (n, n_taxels, 3), and advance the state."""
