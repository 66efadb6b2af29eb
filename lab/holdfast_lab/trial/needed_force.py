"""The least force that holds an object, by linear programming with the true contacts of the twin.

The contacts are those of the calm grip right before the load, with the force of the first grip, so
they are the same for every law. Each fingertip in contact is a patch of four points with one
normal. Force and moment of the object must balance at every instant; the sum of all normal forces
is the least one for which the friction at the points can do so.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from holdfast.contact import CONTACT_FORCE
from holdfast.sensors.types import Array
from holdfast.twin.hand import FINGERS, GRAVITY, RATE
from holdfast.twin.loads import load_state
from holdfast.twin.simulation import Simulation
from holdfast.twin.steps import probe
from holdfast.twin.world import World
from holdfast_lab.trial.trials import Trial

N_FACETS = 16
"""Edges of the pyramid inside each friction cone. It has at least cos(pi / 16) = 98.1 % of the
friction of the cone, so the least force is at most 1.9 % too high."""
PATCH_POINTS = 4 / 3
"""Distance of the points of a patch from its middle, over the standard deviation of the pressure
along each axis: four such points have the torsional friction of a disc of even pressure."""
NEED_RATE = 30.0
"""Instants per second at which the least force is computed [Hz]."""
INFEASIBLE_TIME = 0.1
"""Time for which no force may balance the object before a trial counts as infeasible [s]; in a
shorter time it moves by less than 5 cm even in free fall."""
UPWARD = np.array([0.0, 0.0, GRAVITY])


class Patch(NamedTuple):
    """Contact of a fingertip with the object, in the world.

    Attributes:
        points: (4, 3) points that carry the force, from the object's centre of mass [m].
        normal: (3,) unit vector along which the fingertip pushes the object.
    """

    points: Array
    normal: Array


class NeededForce(NamedTuple):
    """Least sums of normal forces over the time of a trial; infinite where no force holds.

    Attributes:
        to_hold: (n,) with static friction [N], at `NEED_RATE` from the lock on.
        to_stop: (n,) with kinetic friction, which acts while the object slides [N].
    """

    to_hold: Array
    to_stop: Array

    @property
    def feasible(self) -> bool:
        """Whether a slide can be stopped at all times but `INFEASIBLE_TIME`, at some force."""
        longest = run = 0
        for force in self.to_stop.tolist():
            run = run + 1 if math.isinf(force) else 0
            longest = max(longest, run)
        return longest <= INFEASIBLE_TIME * NEED_RATE

    def at(self, held_for: float) -> tuple[float, float]:
        """Return the least force to hold and to stop at a time after the lock [N]."""
        k = min(max(round(held_for * NEED_RATE), 0), len(self.to_hold) - 1)
        return float(self.to_hold[k]), float(self.to_stop[k])


@cache
def needed_force(trial: Trial) -> NeededForce:
    """Return the least forces of a trial, from its calm grip before the load."""
    patches = calm_patches(trial)
    item, forces = trial.grasp.item, {}  # most instants have the same load
    rows = []
    for held_for in np.arange(0.0, trial.duration + 1 / NEED_RATE, 1 / NEED_RATE).tolist():
        load = load_state([trial.load], held_for)
        carried = item.mass * (load.acceleration + UPWARD) - load.force
        key = (carried.tobytes(), load.friction)
        if key not in forces:
            forces[key] = [
                least_normal_force(patches, carried, load.friction * mu)
                for mu in (item.mu_static, item.mu_kinetic)
            ]
        rows.append(forces[key])
    columns = np.array(rows)
    return NeededForce(columns[:, 0], columns[:, 1])


def calm_patches(trial: Trial) -> list[Patch]:
    """Return the contacts of the first grip, right before the load or the loss of the object."""
    simulation = Simulation(trial.grasp, plan=trial.plan(), loads=[trial.load])
    patches: list[Patch] = []
    scales = np.ones(len(FINGERS))
    while simulation.held_for < trial.load.start - 1 / RATE and not simulation.is_over:
        simulation.step(scales)
        if simulation.protocol.lost_at is not None:
            break  # the contacts of the sample before stay
        if simulation.held_for >= trial.load.start - 2 / RATE or not patches:
            patches = patches_of(simulation.world) if simulation.held_for > 0 else []
    return patches


def patches_of(world: World) -> list[Patch]:
    """Return the patches of the fingertips that touch the object."""
    patches = []
    for tip in np.flatnonzero(world.loads > CONTACT_FORCE):
        item, finger = world.bodies[-1], world.bodies[tip]
        turn, back = finger[3:12].reshape(3, 3), item[3:12].reshape(3, 3)
        forces = world.contact.node_forces[tip]
        touching = np.any(forces != 0.0, axis=1)
        arms = finger[:3] + world.constants.nodes[touching, :3] @ turn.T - item[:3]
        solid = world.constants.solid
        outward = np.array([probe(solid, *position)[1:] for position in arms @ back]) @ back.T
        # A node whose friction pulls outward presses nothing.
        pressed = np.maximum(np.sum(forces[touching] @ turn.T * outward, axis=1), 0.0)
        middle = pressed @ arms / pressed.sum()
        normal = pressed @ outward
        normal /= np.linalg.norm(normal)
        # The points lie in the plane of the patch, along the main axes of its pressure.
        spread = arms - middle
        spread -= np.outer(spread @ normal, normal)
        values, axes = np.linalg.eigh((pressed[:, None] * spread).T @ spread / pressed.sum())
        reach = PATCH_POINTS * np.sqrt(np.maximum(values[1:], 0.0)) * axes[:, 1:]  # first: normal
        patches.append(Patch(middle + np.vstack([reach.T, -reach.T]), -normal))
    return patches


def least_normal_force(patches: list[Patch], carried: Array, friction: float) -> float:
    """Return the least sum of normal forces that carries a force at the centre of mass [N].

    Minimise sum_k a_k over a_k >= 0, with sum_k a_k (n + mu t_k) = F and the same for the moments;
    t_k are the edges of the pyramid of each point.

    Args:
        patches: contacts of the fingertips.
        carried: (3,) force that the fingers must exert on the object [N].
        friction: coefficient of friction.

    Returns:
        The sum; infinite where no force carries it.
    """
    if len(patches) == 0:
        return math.inf
    wrenches = np.vstack([_wrenches(patch, friction) for patch in patches]).T
    needed = np.concatenate([carried, np.zeros(3)])
    solution = linprog(np.ones(wrenches.shape[1]), A_eq=wrenches, b_eq=needed, method="highs")
    return float(solution.fun) if solution.status == 0 else math.inf


def _wrenches(patch: Patch, friction: float) -> Array:
    """Return force and moment of each edge of the pyramids of a patch, (4 N_FACETS, 6).

    Moments are in units of 3 cm, so that all rows have the same size.
    """
    first = np.cross(patch.normal, np.eye(3)[np.abs(patch.normal).argmin()])
    first /= np.linalg.norm(first)
    angles = 2 * np.pi * np.arange(N_FACETS) / N_FACETS
    around = np.outer(np.cos(angles), first) + np.outer(
        np.sin(angles), np.cross(patch.normal, first)
    )
    edges = patch.normal + friction * around
    moments = np.concatenate([np.cross(point, edges) for point in patch.points])
    return np.column_stack([np.tile(edges, (len(patch.points), 1)), moments / 0.03])
