"""The set of trials: grasps of the twin and the loads on them, drawn from a seed.

The set and the first grip were fixed, and committed, before any law but `fixed` ran on it.

First grip: the fingers stop closing at twice the least force that holds the unloaded object by
Coulomb friction, shared evenly by the fingers opposite to the thumb. In the hold this gives 1.6 to
2.0 times the least force. It is the smallest round multiple at which all objects are held
unloaded: at 1.8 and below some fall as soon as the operator lets go, because no finger carries
exactly its share. The two spheres fall unloaded in a grip of three fingers, so they have four.

Sizes of the loads, on physical grounds, relative to the weight W and mass m of the object:

- weight: 0.6 to 1.4 m more, a container that is filled;
- pull: 0.8 to 1.6 W in one of six directions, for 0.6 to 1.2 s;
- friction: falls to 0.4 to 0.65 of its value, as of a surface that becomes wet;
- shake: 6 to 12 m/s^2 at 2 to 4 Hz for 1.5 s;
- transport: 6 to 12 m/s^2, a motion of 0.5 to 0.8 s, as of a fast robot arm.

With impacts, a tool knocks on the object, a person taps it or something bumps into the arm before
the load comes, with the sizes of the profile `coupled`: causes that need no force.
"""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np

from holdfast.twin.hand import FINGERS, GRAVITY
from holdfast.twin.impacts import Impact, draw_impacts
from holdfast.twin.loads import Load, LoadKind
from holdfast.twin.objects import OTHER_OBJECTS, GraspObject, load_objects
from holdfast.twin.plant import MILD, plant_named
from holdfast.twin.profile import profile
from holdfast.twin.protocol import THUMB_SHARE, Plan
from holdfast.twin.simulation import Grasp

GRIP_MULTIPLE = 2.0
"""First grip, as a multiple of the least force for the unloaded object."""
QUIET_TIME = (2.5, 3.5)
"""Time from the lock to the load [s]."""
AFTER_TIME = 2.5
"""Time after the load, or after the start of one that stays [s]."""
BEFORE_TIME = 0.6
"""Time with an open hand, for the tare [s]."""
CLOSING_SPEED = (0.012, 0.03)
"""Speed of closing [m/s], that of the profile `reference`."""
PROFILE = "reference"
"""Profile of the tremor of the operator and the glitches of the hand's controller."""
IMPACT_PROFILE = "coupled"
"""Profile of the sizes of impacts."""
IMPACT_SPACING = 1.0
"""Time in which there is one impact, by which the load comes later for each [s]."""
AXIS_DIRECTIONS = [(s * x, s * y, s * z) for x, y, z in np.eye(3).tolist() for s in (1.0, -1.0)]
LOAD_KINDS = tuple(LoadKind)


@dataclass(frozen=True)
class Trial:
    """One trial: a grasp and one load.

    Attributes:
        number: number of the trial in the set, from 0.
        grasp: object and seed.
        n_fingers: 4, or 3 without the ring finger.
        load: load on the object.
        speed: speed of closing [m/s].
        latency: latency of sensor and bus [samples].
        n_impacts: number of impacts before the load.
    """

    number: int
    grasp: Grasp
    n_fingers: int
    load: Load
    speed: float
    latency: int = 0
    n_impacts: int = 0

    @property
    def unseen(self) -> bool:
        """Whether the object is one of the six others, which `builtin:twin` was not trained on."""
        return self.grasp.table is not None

    @property
    def duration(self) -> float:
        """Time from the lock to the end of the trial [s]."""
        return self.load.start + self.load.duration + AFTER_TIME

    def plan(self) -> Plan:
        """Return the plan of the grasp, without disturbances."""
        force = GRIP_MULTIPLE * least_force(self.grasp.item) / 2
        used = np.array([1.0, 1.0, 1.0, 1.0 if self.n_fingers == len(FINGERS) else 0.0])
        grips = force * used / used[1:].sum()
        grips[0] = THUMB_SHARE * force
        chosen = msgspec.structs.replace(profile(PROFILE), hold=self.duration + 1.0)
        return Plan(chosen, grips, self.speed, BEFORE_TIME, 0.0, (), impacts=self.impacts())

    def impacts(self) -> list[Impact]:
        """Return the impacts before the load."""
        ranges = profile(IMPACT_PROFILE).impacts
        if ranges is None or not self.n_impacts:
            return []
        times = [self.load.start - k * IMPACT_SPACING for k in range(self.n_impacts, -1, -1)]
        every = msgspec.structs.replace(ranges, share=1.0)
        return draw_impacts(self.grasp.generator("impacts"), every, list(pairwise(times)))


def least_force(item: GraspObject) -> float:
    """Return the least sum of all normal forces that holds an object, m g / mu_s [N].

    Coulomb friction on both sides carries the weight: mu (N_thumb + N_fingers) = m g.
    """
    return item.mass * GRAVITY / item.mu_static


def draw_trial(number: int, seed: int = 0, plant: str = MILD, n_impacts: int = 0) -> Trial:
    """Draw one trial of a set, which does not depend on the others.

    Args:
        number: number of the trial, from 0.
        seed: of all random numbers.
        plant: name of the plant.
        n_impacts: number of impacts before the load.

    Raises:
        ValueError: there is no such plant.
    """
    objects = _objects()
    name, item, table = objects[number % len(objects)]
    # Shifted by one after each round of the objects, so that every object meets every kind.
    kind = LOAD_KINDS[(number + number // len(objects)) % len(LOAD_KINDS)]
    generator = np.random.default_rng([seed, number])
    grasp = Grasp(name, 1, 1 + number, PROFILE, seed, table=table, plant=plant)
    # Every kind takes the same draws first, so that a change of one kind changes no other.
    start = float(generator.uniform(*QUIET_TIME)) + n_impacts * IMPACT_SPACING
    direction = AXIS_DIRECTIONS[int(generator.integers(len(AXIS_DIRECTIONS)))]
    share = float(generator.random())

    def between(low: float, high: float) -> float:
        return low + (high - low) * share

    if kind is LoadKind.WEIGHT:
        load = Load(kind, start, 0.0, item.mass * between(0.6, 1.4))
    elif kind is LoadKind.FRICTION:
        load = Load(kind, start, 0.0, between(0.65, 0.4))  # a larger share is a harder load
    elif kind is LoadKind.PULL:
        duration = float(generator.uniform(0.6, 1.2))
        load = Load(kind, start, duration, item.mass * GRAVITY * between(0.8, 1.6), direction)
    elif kind is LoadKind.SHAKE:
        rate = float(generator.uniform(2.0, 4.0))
        load = Load(kind, start, 1.5, between(6.0, 12.0), direction, rate)
    else:
        load = Load(kind, start, float(generator.uniform(0.5, 0.8)), between(6.0, 12.0), direction)
    # Every object with three fingers in every second round; spheres fall in such a grip.
    three = item.shape != "sphere" and number // len(objects) % 2 == 1
    speed = float(generator.uniform(*CLOSING_SPEED))
    shortest, longest = plant_named(plant).latency
    # From a stream of its own: a plant with another latency has the same loads.
    latency = int(grasp.generator("latency").integers(shortest, longest + 1))
    return Trial(number, grasp, 3 if three else 4, load, speed, latency, n_impacts)


@cache
def _objects() -> list[tuple[str, GraspObject, Path | None]]:
    """Return all objects with their names and tables: the six, then the six others."""
    return [
        (name, item, table)
        for table in (None, OTHER_OBJECTS)
        for name, item in load_objects(table).items()
    ]
