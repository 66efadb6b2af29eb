"""From a seed to a recording of one grasp, with exact truth: deterministic, without a clock."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import msgspec
import numpy as np

from holdfast.contact import Phase
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import sensor
from holdfast.sensors.types import Array
from holdfast.twin.contact import SHARE, SLIP
from holdfast.twin.control import EVERY, draw_controller
from holdfast.twin.grasp import ClosingPath, closing_path
from holdfast.twin.hand import FINGERS, N_JOINTS, RATE, TIMESTEP, HandModel
from holdfast.twin.labels import LabelRule, labels_from_truth, phases_as_felt
from holdfast.twin.objects import Thing
from holdfast.twin.objects import thing as find_thing
from holdfast.twin.operator import draw_pushes, draw_tremor
from holdfast.twin.profile import Profile, profile
from holdfast.twin.protocol import THUMB_SHARE, TOUCH, Command, Plan, Protocol
from holdfast.twin.surface import curved_fingertip
from holdfast.twin.uskin import Uskin, with_server_effects
from holdfast.twin.uskin_parameters import UskinParameters
from holdfast.twin.world import World

CALMER = 0.75
"""After a failed grasp a person disturbs the next one less: depths of pushes go down by it."""
CASES = (1, 2)
"""1: close, hold, release. 2: the same with disturbances while the object is locked."""
LONGEST = 60.0
"""No grasp lasts longer [s]."""
PLACE_SPREAD, TURN_SPREAD = 0.002, 0.05
"""Standard deviations of how a person places the object [m] and [rad]."""
GRIP_SPREAD = 0.1
"""Of the logarithm of the load at which a finger stops: it differs from grasp to grasp."""


@dataclass(frozen=True)
class Grasp:
    """Which grasp it is: everything that a recording is made from.

    Attributes:
        object: name of the object.
        case: 1 or 2.
        repeat: from 1 on.
        profile: name of the profile.
        seed: of the whole protocol.
        attempt: from 0 on; after a failed grasp the same is tried again.
        server: whether stamps are unsteady and packets repeat, as servers send them.
        table: another table of objects, like `OTHER_OBJECTS` or one's own; None for the one
            that is built in.
        glitch_rate: glitches of the hand's controller per second [1/s]; None for the profile's.
    """

    object: str
    case: int
    repeat: int
    profile: str = "reference"
    seed: int = 0
    attempt: int = 0
    server: bool = False
    table: str | Path | None = None
    glitch_rate: float | None = None

    @property
    def thing(self) -> Thing:
        """The object.

        Raises:
            ValueError: the table has none of that name.
        """
        return _thing(self.object, self.table)

    @property
    def name(self) -> str:
        """What its recording is called where it does not fail."""
        return f"{self.object}-case{self.case}-{self.repeat}"

    @property
    def failed_name(self) -> str:
        """What its recording is called where it fails."""
        return f"{self.name}-failed{self.attempt + 1}"

    def generator(self, part: str) -> np.random.Generator:
        """Random numbers of one part of it; parts do not disturb each other."""
        drawn_as = profile(self.profile).drawn_as or self.profile
        key = f"{self.object}/{self.case}/{self.repeat}/{drawn_as}/{self.attempt}/{part}"
        return _generator(self.seed, key)


Watch = Callable[[World, Command], None]


def simulate(
    grasp: Grasp, parameters: UskinParameters | None = None, watch: Watch | None = None
) -> Recording:
    """The recording of one grasp, with truth and labels.

    Args:
        grasp: which one.
        parameters: of the skin.
        watch: is called after each sample; may draw a picture.

    Returns:
        Counts of four fingertips at 150 Hz. A grasp that was never locked, or lost its object,
        has the case "failed" in its metadata.

    Raises:
        ValueError: an unknown object, profile or case, or an object that cannot be grasped.
    """
    if grasp.case not in CASES:
        raise ValueError(f"case 1 or 2 expected, {grasp.case} given")
    chosen = profile(grasp.profile)
    if grasp.glitch_rate is not None:
        chosen = msgspec.structs.replace(chosen, glitch_rate=grasp.glitch_rate)
    plan = _draw_plan(grasp, chosen)
    world = _world(grasp, chosen.glitch_rate)
    uskins = [_skin(grasp.seed, finger, parameters or UskinParameters()) for finger in FINGERS]
    protocol = Protocol(plan, 1 / RATE)
    log = _Log()
    taxel_forces: list[list[Array]] = [[] for _ in FINGERS]
    k = 0
    while not protocol.over(k / RATE):
        command = protocol.command(k / RATE, world.loads, world.slip, world.bodies[-1])
        world.advance(command, plan, protocol.anchor)
        log.add(world, command)
        for pile, uskin, forces in zip(
            taxel_forces, uskins, world.contact.node_forces, strict=True
        ):
            pile.append(uskin.taxel_forces(forces[None])[0])
        if watch is not None:
            watch(world, command)
        k += 1
    times = np.arange(k) / RATE
    truth = log.truth(times)
    modules = {}
    for finger, uskin, pile in zip(FINGERS, uskins, taxel_forces, strict=True):
        noise = grasp.generator(f"skin {finger}")
        counts, stamps = uskin.counts(np.array(pile), times, noise), times
        if grasp.server:
            stamps, counts = with_server_effects(times, counts, grasp.generator(f"server {finger}"))
        labels = labels_from_truth(truth, finger, label_rule(chosen))
        modules[finger] = Tactile(uskin.sensor, stamps, counts, labels=labels)
    name = grasp.failed_name if protocol.failed else grasp.name
    return Recording(name, modules, _metadata(grasp, protocol), truth)


def label_rule(chosen: Profile) -> LabelRule:
    """Return the rule by which a profile's recordings are labelled."""
    return LabelRule(
        margin=chosen.label_margin, glitch=LabelRule.glitch if chosen.label_glitches else None
    )


def _draw_plan(grasp: Grasp, chosen: Profile) -> Plan:
    generator = grasp.generator("plan")
    scale = chosen.grip * np.exp(GRIP_SPREAD * generator.standard_normal())
    grips = scale * np.array([THUMB_SHARE * 3, 1.0, 1.0, 1.0])
    return Plan(
        profile=chosen,
        grips=grips,
        speed=float(generator.uniform(*chosen.closing_speed)),
        before=float(generator.uniform(*chosen.idle)),
        after=float(generator.uniform(*chosen.idle)),
        pushes=draw_pushes(generator, chosen, CALMER**grasp.attempt) if grasp.case == 2 else (),
    )


def _world(grasp: Grasp, glitch_rate: float) -> World:
    item = grasp.thing
    generator = grasp.generator("world")
    controller = draw_controller(generator, LONGEST, EVERY * TIMESTEP, glitch_rate)
    tremors = np.stack([draw_tremor(generator), draw_tremor(generator)])
    start = generator.standard_normal(4) * [*[PLACE_SPREAD] * 3, TURN_SPREAD]
    return World(
        HandModel.build(item), item, _path(grasp.object, grasp.table), controller, tremors, start
    )


@cache
def _skin(seed: int, finger: str, parameters: UskinParameters) -> Uskin:
    """The skin of a finger: a seed is a hand, and has the same gains in all its grasps."""
    nodes = curved_fingertip().nodes
    return Uskin(parameters, sensor("uskin-curved"), nodes, _generator(seed, f"skin/{finger}"))


def _generator(seed: int, key: str) -> np.random.Generator:
    """Random numbers of their own for every key, whatever else is drawn."""
    return np.random.default_rng([seed, zlib.crc32(key.encode())])


@cache
def _thing(name: str, table: str | Path | None) -> Thing:
    return find_thing(name, table)


@cache
def _path(name: str, table: str | Path | None) -> ClosingPath:
    return closing_path(_thing(name, table))


class _Log:
    """Collects what is true, sample by sample."""

    def __init__(self) -> None:
        self._phase: list[Phase] = []
        self._rows: dict[str, list[Array]] = {
            name: [] for name in ("outside_force", "object_pose", "joints", "set_point_error")
        }
        self._tips: list[Array] = []
        self._bodies: list[Array] = []

    def add(self, world: World, command: Command) -> None:
        data = world.hand.data
        self._phase.append(command.phase)
        self._rows["outside_force"].append(world.outside[:3].copy())
        pose = np.concatenate([world.bodies[-1, :3], data.qpos[N_JOINTS + 3 :]])
        self._rows["object_pose"].append(pose)
        self._rows["joints"].append(data.qpos[:N_JOINTS].copy())
        self._rows["set_point_error"].append(np.array(world.set_point_error))
        self._tips.append(world.contact.tips.copy())
        self._bodies.append(world.bodies[:-1].copy())

    def truth(self, times: Array) -> Truth:
        tips = np.array(self._tips)
        bodies = np.array(self._bodies)
        fingers = {
            finger: {
                "contact_force": -tips[:, place, :3],
                "slip_speed": tips[:, place, SLIP],
                "slipping_share": tips[:, place, SHARE],
                "tip_pose": _poses(bodies[:, place]),
            }
            for place, finger in enumerate(FINGERS)
        }
        hand = {name: np.array(rows) for name, rows in self._rows.items()}
        push = np.linalg.norm(hand["outside_force"], axis=1)  # no one else touches it meanwhile
        phase = phases_as_felt(np.array(self._phase, dtype=str), push, TOUCH)
        return Truth(times, {"phase": phase, **hand}, fingers)


def _poses(bodies: Array) -> Array:
    """(n, 7) position and quaternion w x y z."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(bodies[:, 3:12].reshape(-1, 3, 3)).as_quat()
    return np.column_stack([bodies[:, :3], turns[:, 3], turns[:, :3]])


def _metadata(grasp: Grasp, protocol: Protocol) -> dict[str, object]:
    item = grasp.thing
    return {
        "object": grasp.object,
        "object_mass": item.mass,
        "case": "failed" if protocol.failed else str(grasp.case),
        "planned_case": grasp.case,
        "repeat": grasp.repeat,
        "attempt": grasp.attempt,
        "profile": grasp.profile,
        **({} if grasp.glitch_rate is None else {"glitch_rate": grasp.glitch_rate}),
        "seed": grasp.seed,
        "server": grasp.server,
        "hand": "allegro-right",
        "source": "twin",
        "locked_at": protocol.locked_at,
        "lost_at": protocol.lost_at,
    }
