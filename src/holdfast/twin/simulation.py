"""Simulate a grasp from a seed: a recording with exact truth, without a clock."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import msgspec
import numpy as np

from holdfast.contact import Phase
from holdfast.metrics.truth_labels import LabelRule, labels_from_truth, phases_from_touch
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import sensor
from holdfast.sensors.types import Array
from holdfast.twin.contact import SLIP, SLIPPING_SHARE
from holdfast.twin.control import STEPS_PER_CONTROL, draw_controller
from holdfast.twin.grasp import ClosingPath, closing_path
from holdfast.twin.hand import FINGERS, N_JOINTS, RATE, TIMESTEP, HandModel
from holdfast.twin.objects import GraspObject, object_named
from holdfast.twin.operator import draw_disturbances, draw_tremor
from holdfast.twin.profile import Profile, profile
from holdfast.twin.protocol import CONTACT_LOAD, THUMB_SHARE, Command, Plan, Protocol
from holdfast.twin.surface import curved_fingertip
from holdfast.twin.uskin import Uskin, with_server_effects
from holdfast.twin.uskin_parameters import UskinParameters
from holdfast.twin.world import World

RETRY_DEPTH_FACTOR = 0.75
"""Factor of the depths of disturbances after a failed grasp, as a person disturbs the next less."""
CASES = (1, 2)
"""1: close, hold, release. 2: the same with disturbances while the object is locked."""
MAX_DURATION = 60.0
"""Time for which random numbers of the controller are drawn, longer than any grasp [s]."""
PLACE_SPREAD, TURN_SPREAD = 0.002, 0.05
"""Standard deviations of the object's position [m] and turn [rad], as a person places it."""
GRIP_SPREAD = 0.1
"""Standard deviation, over grasps, of the logarithm of the load at which the fingers stop."""


@dataclass(frozen=True)
class Grasp:
    """Description of a grasp, from which its recording is made.

    Attributes:
        object: name of the object.
        case: 1 (undisturbed) or 2 (disturbed).
        repeat: number of the repeat, from 1.
        profile: name of the profile.
        seed: seed of the whole protocol.
        attempt: number of the attempt, from 0; a failed grasp is tried again.
        server: whether stamps are unsteady and packets repeat, as a server sends them.
        table: path of another table of objects, like `OTHER_OBJECTS`; None for the built-in one.
        glitch_rate: glitches of the hand's controller per second [1/s]; None for the profile's.
        noise: rms of a reading at rest [count]; rounding to whole counts remains. None for that
            of the sensor.
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
    noise: float | None = None

    @property
    def item(self) -> GraspObject:
        """The object.

        Raises:
            ValueError: the table has no object of that name.
        """
        return _object(self.object, self.table)

    @property
    def name(self) -> str:
        """Name of the recording if the grasp does not fail."""
        return f"{self.object}-case{self.case}-{self.repeat}"

    @property
    def failed_name(self) -> str:
        """Name of the recording if the grasp fails."""
        return f"{self.name}-failed{self.attempt + 1}"

    def generator(self, part: str) -> np.random.Generator:
        """Return the random number generator of one part, which is independent of other parts."""
        drawn_as = profile(self.profile).drawn_as or self.profile
        key = f"{self.object}/{self.case}/{self.repeat}/{drawn_as}/{self.attempt}/{part}"
        return _generator(self.seed, key)


SampleCallback = Callable[[World, Command], None]


def simulate(
    grasp: Grasp,
    parameters: UskinParameters | None = None,
    on_sample: SampleCallback | None = None,
) -> Recording:
    """Simulate one grasp and return its recording with truth and labels.

    Args:
        grasp: the grasp.
        parameters: parameters of the skin; by default `UskinParameters()`.
        on_sample: function that is called after each sample, for instance to draw a picture.

    Returns:
        Recording of four fingertips in counts at 150 Hz. The metadata of a grasp that was never
        locked, or lost its object, have the case "failed".

    Raises:
        ValueError: object, profile or case is unknown, or the object cannot be grasped.
    """
    if grasp.case not in CASES:
        raise ValueError(f"case 1 or 2 expected, {grasp.case} given")
    chosen = profile(grasp.profile)
    if grasp.glitch_rate is not None:
        chosen = msgspec.structs.replace(chosen, glitch_rate=grasp.glitch_rate)
    plan = _draw_plan(grasp, chosen)
    world = _world(grasp, chosen.glitch_rate)
    chosen_skin = parameters or UskinParameters()
    if grasp.noise is not None:
        chosen_skin = replace(chosen_skin, noise_counts=grasp.noise)
    uskins = [_skin(grasp.seed, finger, chosen_skin) for finger in FINGERS]
    protocol = Protocol(plan, 1 / RATE)
    truth_log = _TruthLog()
    taxel_forces: list[list[Array]] = [[] for _ in FINGERS]
    k = 0
    while not protocol.is_over(k / RATE):
        command = protocol.command(k / RATE, world.loads, world.slip, world.bodies[-1])
        world.advance(command, plan, protocol.anchor)
        truth_log.add(world, command)
        for collected, uskin, forces in zip(
            taxel_forces, uskins, world.contact.node_forces, strict=True
        ):
            collected.append(uskin.taxel_forces(forces[None])[0])
        if on_sample is not None:
            on_sample(world, command)
        k += 1
    times = np.arange(k) / RATE
    truth = truth_log.truth(times)
    modules = {}
    for finger, uskin, collected in zip(FINGERS, uskins, taxel_forces, strict=True):
        noise = grasp.generator(f"skin {finger}")
        counts, stamps = uskin.counts(np.array(collected), times, noise), times
        if grasp.server:
            stamps, counts = with_server_effects(times, counts, grasp.generator(f"server {finger}"))
        labels = labels_from_truth(truth, finger, label_rule(chosen))
        modules[finger] = Tactile(uskin.sensor, stamps, counts, labels=labels)
    name = grasp.failed_name if protocol.failed else grasp.name
    return Recording(name, modules, _metadata(grasp, protocol), truth)


def label_rule(chosen: Profile) -> LabelRule:
    """Return the rule that labels the recordings of a profile."""
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
        disturbances=draw_disturbances(generator, chosen, RETRY_DEPTH_FACTOR**grasp.attempt)
        if grasp.case == 2
        else (),
    )


def _world(grasp: Grasp, glitch_rate: float) -> World:
    item = grasp.item
    generator = grasp.generator("world")
    controller = draw_controller(generator, MAX_DURATION, STEPS_PER_CONTROL * TIMESTEP, glitch_rate)
    tremors = np.stack([draw_tremor(generator), draw_tremor(generator)])
    start = generator.standard_normal(4) * [*[PLACE_SPREAD] * 3, TURN_SPREAD]
    return World(
        HandModel.build(item), item, _path(grasp.object, grasp.table), controller, tremors, start
    )


@cache
def _skin(seed: int, finger: str, parameters: UskinParameters) -> Uskin:
    """Return the skin of a finger: one seed is one hand, with the same gains in all its grasps."""
    nodes = curved_fingertip().nodes
    return Uskin(parameters, sensor("uskin-curved"), nodes, _generator(seed, f"skin/{finger}"))


def _generator(seed: int, key: str) -> np.random.Generator:
    """Return a random number generator for a key, independent of other keys."""
    return np.random.default_rng([seed, zlib.crc32(key.encode())])


@cache
def _object(name: str, table: str | Path | None) -> GraspObject:
    return object_named(name, table)


@cache
def _path(name: str, table: str | Path | None) -> ClosingPath:
    return closing_path(_object(name, table))


class _TruthLog:
    """Collector of the truth, sample by sample."""

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
                "slipping_share": tips[:, place, SLIPPING_SHARE],
                "tip_pose": _poses(bodies[:, place]),
            }
            for place, finger in enumerate(FINGERS)
        }
        hand = {name: np.array(rows) for name, rows in self._rows.items()}
        push = np.linalg.norm(hand["outside_force"], axis=1)  # the only other contact then
        phase = phases_from_touch(np.array(self._phase, dtype=str), push, CONTACT_LOAD)
        return Truth(times, {"phase": phase, **hand}, fingers)


def _poses(bodies: Array) -> Array:
    """Return positions [m] and quaternions w, x, y, z, (n, 7)."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(bodies[:, 3:12].reshape(-1, 3, 3)).as_quat()
    return np.column_stack([bodies[:, :3], turns[:, 3], turns[:, :3]])


def _metadata(grasp: Grasp, protocol: Protocol) -> dict[str, object]:
    item = grasp.item
    return {
        "object": grasp.object,
        "object_mass": item.mass,
        "case": "failed" if protocol.failed else str(grasp.case),
        "planned_case": grasp.case,
        "repeat": grasp.repeat,
        "attempt": grasp.attempt,
        "profile": grasp.profile,
        **({} if grasp.glitch_rate is None else {"glitch_rate": grasp.glitch_rate}),
        **({} if grasp.noise is None else {"noise": grasp.noise}),
        "seed": grasp.seed,
        "server": grasp.server,
        "hand": "allegro-right",
        "source": "twin",
        "locked_at": protocol.locked_at,
        "lost_at": protocol.lost_at,
    }
