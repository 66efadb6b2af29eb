"""Simulate a grasp from a seed: a recording with exact truth, without a clock."""

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.metrics.slip_truth import MIN_SLIP_DISTANCE, finger_slips
from holdfast.metrics.truth_labels import (
    LabelRule,
    glitches,
    labels_from_truth,
    phases_from_touch,
)
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import Sensor, sensor
from holdfast.sensors.types import Array
from holdfast.twin.control import STEPS_PER_CONTROL, draw_controller
from holdfast.twin.force_skin import FORCE_SENSORS, ForceReadout, ForceSkin
from holdfast.twin.grasp import ClosingPath, Pressing, closing_path
from holdfast.twin.hand import FINGERS, N_JOINTS, RATE, TIMESTEP, HandModel
from holdfast.twin.impacts import NO_IMPACT, Impact, ImpactState, draw_impacts, impact_state
from holdfast.twin.loads import Load, LoadState, draw_arm_motions, load_state
from holdfast.twin.magnetic_faults import WITHOUT_FAULTS, MagneticFaults
from holdfast.twin.objects import GraspObject, object_named
from holdfast.twin.operator import draw_disturbances, draw_tremor
from holdfast.twin.plant import MILD, plant_named
from holdfast.twin.profile import GRASP_ATTEMPTS, Profile, profile
from holdfast.twin.protocol import (
    MIN_TOUCH_LOAD,
    THUMB_SHARE,
    Command,
    Plan,
    Protocol,
    touched_phase,
)
from holdfast.twin.slip_events import NO_SLIP, SlipEvents, SlipState, draw_course
from holdfast.twin.steps import tremor_at
from holdfast.twin.uskin import Uskin, with_server_effects
from holdfast.twin.uskin_readout import Readout, UskinParameters
from holdfast.twin.world import TruthLog, World, fingertip_of

RETRY_DEPTH_FACTOR = 0.75
"""Factor of the depths of disturbances after a failed grasp, as a person disturbs the next less."""
MAX_EASED, N_EASED_ALONE = 8, 3
"""How often a grasp is made until nothing slides, before all is drawn anew; and how often only what
acts is weaker. An object that is nearly too heavy for the grip needs a firmer one, too."""
GRASP_CASES = (1, 2)
"""1: close, hold, release. 2: the same with disturbances while the object is locked."""
MAX_DURATION, MAX_UNHELD_DURATION = 60.0, 25.0
"""Time for which random numbers of the controller are drawn, longer than a grasp [s]; a long hold
needs its own duration and this time before and after it."""
TOUCH_LEVER = 0.03
"""Lever of a fingertip about the grasp line, by which a torque counts as a touch [m]."""
PLACE_SPREAD, TURN_SPREAD = 0.002, 0.05
"""Standard deviations of the object's position [m] and turn [rad], as a person places it."""
GRIP_SPREAD = 0.1
"""Standard deviation, over grasps, of the logarithm of the load at which the fingers stop."""
USKIN = "uskin-curved"
"""Sensor whose surface the fingertips have."""
FINGERTIP_SENSORS = (USKIN, *FORCE_SENSORS)
"""Sensors that the fingertips can have."""

Readings = npt.NDArray[Any]


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
        plant: name of the plant, see `holdfast.twin.plant`.
        faults: troubles of the skins.
        sensor: name of the sensor of every fingertip, of `FINGERTIP_SENSORS`.
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
    plant: str = MILD
    faults: MagneticFaults = WITHOUT_FAULTS
    sensor: str = USKIN

    @property
    def item(self) -> GraspObject:
        """The object.

        Raises:
            ValueError: the table has no object of that name.
        """
        return _object(self.object, self.table)

    @property
    def fingertip(self) -> Sensor:
        """Sensor of every fingertip.

        Raises:
            ValueError: the twin has no such fingertips, or none with these faults.
        """
        if self.sensor not in FINGERTIP_SENSORS:
            raise ValueError(
                f"no fingertips with the sensor {self.sensor!r}; there are "
                f"{', '.join(FINGERTIP_SENSORS)}"
            )
        if self.sensor != USKIN and not self.faults.changes_nothing:
            raise ValueError(f"faults are those of {USKIN}; the sensor {self.sensor} given")
        return sensor(self.sensor)

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
        return generator_of(self.seed, key)


class Simulation:
    """Simulation of one grasp, sample by sample. It takes grip forces while it runs.

    Args:
        grasp: the grasp.
        parameters: parameters of a uSkin; by default `UskinParameters()`.
        plan: plan of the grasp; by default the one that is drawn for it.
        loads: loads on the held object, in addition to the disturbances of the plan.

    Attributes:
        grasp: the grasp.
        world: its physical state.
        protocol: its course.
        skins: skin of each fingertip.
        n_samples: number of samples so far.
        command: command of the last sample.

    Raises:
        ValueError: object, profile, plant, case or sensor is unknown, or the object cannot be
            grasped.
    """

    def __init__(
        self,
        grasp: Grasp,
        parameters: UskinParameters | None = None,
        *,
        plan: Plan | None = None,
        loads: Sequence[Load] = (),
    ) -> None:
        if grasp.case not in GRASP_CASES:
            raise ValueError(f"case 1 or 2 expected, {grasp.case} given")
        chosen, plant = profile(grasp.profile), plant_named(grasp.plant)
        rate = plant.jerk_rate if grasp.glitch_rate is None else grasp.glitch_rate
        if rate is not None:
            chosen = msgspec.structs.replace(chosen, glitch_rate=rate)
        self.grasp, self._profile = grasp, chosen
        self.plan = plan or draw_plan(grasp, chosen)
        self._loads = [*self.plan.loads, *loads]
        self.world = _world(grasp, chosen, self.plan.glitch_size)
        tip, skin = grasp.fingertip, parameters or UskinParameters()
        self.skins = {f: _skin(grasp.seed, f, tip, skin, chosen.coupled) for f in FINGERS}
        self.protocol = Protocol(self.plan, 1 / RATE)
        self.command: Command | None = None
        self.n_samples = 0
        self._pressing: Pressing | None = None
        lag = plant.motor_time * RATE
        # Share of the way to a command that a force goes in a sample: 1 without a lag.
        self._motor_part = -math.expm1(-1.0 / lag) if lag > 0 else 1.0
        self._forces = np.ones(len(FINGERS))  # scales that act, behind the scales of the commands
        self._slip_events = SlipEvents(self.plan.slip_events, grasp.item, 1 / RATE)
        self._arm_tremor = draw_tremor(grasp.generator("arm"))
        self._truth_log = TruthLog(FINGERS)
        self._bodies: list[Array] = []  # (4, 18) of each sample
        self._taxel_forces: list[Array] = []  # (4, n_taxels, 3) of each sample [N]
        self._readouts: dict[str, Readout | ForceReadout] = {}

    @property
    def time(self) -> float:
        """Time of the next sample [s]."""
        return self.n_samples / RATE

    @property
    def held_for(self) -> float:
        """Time since the object was locked [s]; negative before."""
        locked_at = self.protocol.locked_at
        return -1.0 if locked_at is None else self.time - locked_at

    @property
    def is_over(self) -> bool:
        """Whether the grasp is complete."""
        return self.protocol.is_over(self.time)

    def step(self, scales: Array | None = None) -> None:
        """Simulate one sample.

        Args:
            scales: (4,) force of each finger as a multiple of that at the lock; None, and before
                the lock and during the release, leaves the set-points of the plan.
        """
        world, protocol = self.world, self.protocol
        was_locked = protocol.locked_at is not None
        command = protocol.command(self.time, world.loads, world.slip, world.bodies[-1])
        if protocol.locked_at is not None and not was_locked:
            joints = world.hand.data.qpos[:N_JOINTS]
            self._pressing = Pressing(world.path, command.depths, joints)
        slipping, events, impact = NO_SLIP, self.plan.slip_events, NO_IMPACT
        if was_locked and events and protocol.lost_at is None:
            slipping = self._slip_events.step(self.held_for, world.slip, world.bodies[-1])
        if was_locked and protocol.lost_at is None:
            impact = impact_state(self.plan.impacts, self.held_for, 1 / RATE)
        if was_locked and (self._loads or events or self.plan.impacts or self._profile.arm_tremor):
            world.set_load(self._load(slipping, impact))
        if slipping.touching or impact.kind:
            command = command._replace(phase=touched_phase(world.slip))
        if slipping.grip_scale < 1.0:
            scales = slipping.grip_scale * (np.ones(len(FINGERS)) if scales is None else scales)
        moved, released = None, protocol.is_released(self.time)
        if scales is not None and self._pressing is not None and not released:
            moved = self._pressing.displacement(self.followed(scales))
        world.advance(command, self.plan, protocol.anchor, moved)
        # Of what only slip events or impacts change.
        slip_truth: dict[str, Array | float | str] = {}
        if self._profile.impacts is not None:
            slip_truth["impact"] = impact.kind
        if self._profile.slips is not None:
            slip_truth |= {
                "outside_torque": world.outside[3:],
                "added_mass": slipping.load.added_mass,
                "grip_scale": slipping.grip_scale,
                "friction_scale": slipping.load.friction,
            }
        self._truth_log.add(
            command.phase,
            world.contact,
            outside_force=world.outside[:3],
            object_pose=world.object_pose,
            joints=world.hand.data.qpos[:N_JOINTS],
            set_point_error=world.set_point_error,
            **slip_truth,
        )
        self._bodies.append(world.bodies[:-1].copy())
        skin = self.skins[FINGERS[0]]  # all fingertips have the same nodes and taxels
        self._taxel_forces.append(skin.taxel_forces(world.contact.node_forces))
        self.command = command
        self.n_samples += 1

    def _load(self, slipping: SlipState, impact: ImpactState) -> LoadState:
        """Return the sum of loads, slip events, an impact and tremor of the arm."""
        load, state = slipping.load, load_state(self._loads, self.held_for)
        rms = self._profile.arm_tremor
        shaken = [rms * tremor_at(self._arm_tremor, self.time, axis)[0] for axis in range(3)]
        return load._replace(
            force=state.force + impact.force,
            torque=load.torque + impact.torque,
            acceleration=state.acceleration + shaken + impact.acceleration,
            friction=load.friction * state.friction,
        )

    def followed(self, scales: Array) -> Array:
        """Return the scales that act; they follow the scales of the commands as the motors do."""
        if self._motor_part < 1.0:
            self._forces = self._forces + self._motor_part * (scales - self._forces)
            return self._forces
        return scales

    def joint_angles(self) -> Array:
        """Return the joint angles (16,) that the hand's driver publishes now [rad]."""
        return self.world.controller.published.copy()

    def read(self) -> dict[str, Readings]:
        """Return the readings (n_taxels, 3) of the last sample; call it after every `step`."""
        time = np.array([(self.n_samples - 1) / RATE])
        readings = {}
        for (finger, skin), forces in zip(self.skins.items(), self._taxel_forces[-1], strict=True):
            if finger not in self._readouts:
                self._readouts[finger] = skin.readout(self.grasp.generator(f"skin {finger}"))
            readings[finger] = self._readouts[finger].read(forces[None], time)
        return {finger: x[0] for finger, x in self._with_faults(readings, time).items()}

    def _with_faults(self, readings: dict[str, Readings], times: Array) -> Mapping[str, Readings]:
        """Return the readings (n, n_taxels, 3) of each finger with the troubles of the skins."""
        if self.grasp.faults.changes_nothing:
            return readings
        skins = {finger: skin for finger, skin in self.skins.items() if isinstance(skin, Uskin)}
        sensors = {finger: skin.sensor for finger, skin in skins.items()}
        rest = {finger: skin.taxels.baseline for finger, skin in skins.items()}
        return self.grasp.faults.apply(sensors, readings, times, rest, self.grasp.seed)

    def recording(self) -> Recording:
        """Return the recording so far, with truth and labels."""
        grasp, times = self.grasp, np.arange(self.n_samples) / RATE
        truth = self.truth()
        taxel_forces = np.array(self._taxel_forces)
        glitch = LabelRule.glitch if self._profile.label_glitches else None
        rule = LabelRule(margin=self._profile.label_margin, glitch=glitch)
        modules = {}
        read = {
            finger: skin.readout(grasp.generator(f"skin {finger}")).read(
                taxel_forces[:, index], times
            )
            for index, (finger, skin) in enumerate(self.skins.items())
        }
        for finger, readings in self._with_faults(read, times).items():
            stamps, sent = times, readings
            if grasp.server:
                server = grasp.generator(f"server {finger}")
                stamps, sent = with_server_effects(times, readings, server)
            labels = labels_from_truth(truth, finger, rule)
            modules[finger] = Tactile(grasp.fingertip, stamps, sent, labels=labels)
        name = grasp.failed_name if self.protocol.failed else grasp.name
        metadata = _metadata(grasp, self.protocol)
        if self._profile.slips is not None:  # in the time of the recording
            lock = self.protocol.locked_at or 0.0
            metadata["slip_events"] = [
                {**record, **{key: lock + record[key] for key in ("start", "end")}}
                for record in self._slip_events.records
            ]
        if not grasp.faults.changes_nothing:
            metadata["magnetic_faults"] = asdict(grasp.faults)
        return Recording(name, modules, metadata, truth)

    def truth(self) -> Truth:
        """Return the truth so far, in which disturbances last from touch to touch."""
        from scipy.spatial.transform import Rotation

        times = np.arange(self.n_samples) / RATE
        truth, bodies = self._truth_log.truth(times), np.array(self._bodies)
        push = np.linalg.norm(truth.hand["outside_force"], axis=1)  # the only other contact then
        if "outside_torque" in truth.hand:
            push += np.linalg.norm(truth.hand["outside_torque"], axis=1) / TOUCH_LEVER
        if "impact" in truth.hand:  # a bump touches the arm only
            push[truth.hand["impact"] != ""] = math.inf
        phase = phases_from_touch(truth.hand["phase"], push, MIN_TOUCH_LOAD)
        fingers = {}
        for index, finger in enumerate(FINGERS):
            body = bodies[:, index]
            turns = Rotation.from_matrix(body[:, 3:12].reshape(-1, 3, 3)).as_quat()  # x y z w
            pose = np.column_stack([body[:, :3], turns[:, 3], turns[:, :3]])
            fingers[finger] = {**truth.fingers[finger], "tip_pose": pose}
        return Truth(times, {**truth.hand, "phase": phase}, fingers)


def simulate(
    grasp: Grasp,
    parameters: UskinParameters | None = None,
) -> Recording:
    """Simulate one grasp and return its recording with truth and labels.

    Args:
        grasp: the grasp.
        parameters: parameters of a uSkin; by default `UskinParameters()`.

    Returns:
        Recording of four fingertips at 150 Hz. The metadata of a grasp that was never
        locked, or lost its object, have the case "failed".

    Raises:
        ValueError: object, profile, case or sensor is unknown, or the object cannot be grasped.
    """
    plan = None
    if profile(grasp.profile).without_slips:
        grasp, plan = without_slips(grasp, parameters)
    simulation = Simulation(grasp, parameters, plan=plan)
    while not simulation.is_over:
        simulation.step()
    return simulation.recording()


def without_slips(grasp: Grasp, parameters: UskinParameters | None = None) -> tuple[Grasp, Plan]:
    """Return a grasp and its plan by which no finger slides 0.1 mm.

    Whatever made a finger slide is weaker when the grasp is made again, as `Plan.eased` says, and
    after a few times the grip is firmer: a person who feels the object slide pushes less there,
    and holds it better. After `MAX_EASED` times, all numbers are drawn anew as for another attempt.

    Raises:
        ValueError: something slides however often the grasp is made.
    """
    for attempt in range(grasp.attempt, grasp.attempt + GRASP_ATTEMPTS):
        drawn = replace(grasp, attempt=attempt)
        plan = draw_plan(drawn, profile(grasp.profile))
        for n_made in range(MAX_EASED):
            simulation = Simulation(drawn, parameters, plan=plan)
            while not simulation.is_over:
                simulation.step()
            lock, truth = simulation.protocol.locked_at, simulation.truth()
            if lock is None:  # never closed
                break
            slips = [slip for finger in FINGERS for slip in finger_slips(truth, finger)]
            onsets = np.array([s.onset for s in slips if s.distance >= MIN_SLIP_DISTANCE])
            if not onsets.size and not simulation.protocol.failed:
                return drawn, plan
            shaken = glitches(truth, LabelRule())[np.searchsorted(truth.times, onsets)]
            plan = plan.eased(onsets - lock, shaken, firmer=n_made >= N_EASED_ALONE)
    raise ValueError(f"{grasp.name}: something slides in each of {GRASP_ATTEMPTS} attempts")


def draw_plan(grasp: Grasp, chosen: Profile) -> Plan:
    """Return the plan of a grasp, with numbers that are drawn from the ranges of a profile."""
    generator = grasp.generator("plan")
    scale = chosen.grip * np.exp(GRIP_SPREAD * generator.standard_normal())
    grips = scale * np.array([THUMB_SHARE * 3, 1.0, 1.0, 1.0])
    plan = Plan(
        profile=chosen,
        grips=grips,
        speed=float(generator.uniform(*chosen.closing_speed)),
        before=float(generator.uniform(*chosen.idle)),
        after=float(generator.uniform(*chosen.idle)),
        disturbances=(),
    )
    if grasp.case != 2:
        return plan
    factor = RETRY_DEPTH_FACTOR**grasp.attempt
    if chosen.slips is not None:
        disturbances, events = draw_course(generator, chosen, chosen.slips, factor)
        return plan._replace(disturbances=disturbances, slip_events=events)
    disturbances, impacts = draw_disturbances(generator, chosen, factor), list[Impact]()
    loads: list[Load] = []
    ends = [0.0, *(push.end for push in disturbances)]
    rests = list(zip(ends, [*(push.start for push in disturbances), chosen.hold], strict=True))
    if chosen.arm is not None:
        loads = draw_arm_motions(grasp.generator("arm motions"), chosen.arm, rests)
        rests = [(a, b) for a, b in rests if not any(a <= load.start < b for load in loads)]
    if chosen.impacts is not None:
        impacts = draw_impacts(grasp.generator("impacts"), chosen.impacts, rests)
    return plan._replace(disturbances=disturbances, impacts=impacts, loads=loads)


def _world(grasp: Grasp, chosen: Profile, glitch_size: float) -> World:
    item = grasp.item
    generator = grasp.generator("world")
    # The order of the draws is part of the seed.
    duration = max(MAX_DURATION, chosen.hold + MAX_UNHELD_DURATION)
    period = STEPS_PER_CONTROL * TIMESTEP
    plant = plant_named(grasp.plant)
    controller = draw_controller(
        generator, duration, period, chosen.glitch_rate,
        glitch_error=glitch_size * plant.jerk_size, backlash=plant.backlash,
    )  # fmt: skip
    tremors = np.stack([draw_tremor(generator), draw_tremor(generator)])
    start = generator.standard_normal(4) * [*[PLACE_SPREAD] * 3, TURN_SPREAD]
    hand = HandModel.build(item, plant.joint_friction)
    path = _path(grasp.object, grasp.table)
    return World(hand, item, path, controller, tremors, start, chosen.coupled)


@cache
def _skin(
    seed: int, finger: str, tip: Sensor, parameters: UskinParameters, coupled: bool
) -> Uskin | ForceSkin:
    """Return the skin of a finger: one seed is one hand, with the same gains in all its grasps."""
    nodes = fingertip_of(coupled).nodes
    if tip.name in FORCE_SENSORS:
        return ForceSkin(tip, nodes)
    return Uskin(parameters, tip, nodes, generator_of(seed, f"skin/{finger}"))


def generator_of(seed: int, key: str) -> np.random.Generator:
    """Return a random number generator for a key, independent of other keys."""
    return np.random.default_rng([seed, zlib.crc32(key.encode())])


@cache
def _object(name: str, table: str | Path | None) -> GraspObject:
    return object_named(name, table)


@cache
def _path(name: str, table: str | Path | None) -> ClosingPath:
    return closing_path(_object(name, table))


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
        **({} if grasp.plant == MILD else {"plant": grasp.plant}),
        **({} if grasp.sensor == USKIN else {"sensor": grasp.sensor}),
        "seed": grasp.seed,
        "server": grasp.server,
        "hand": "allegro-right",
        "source": "twin",
        "locked_at": protocol.locked_at,
        "lost_at": protocol.lost_at,
    }
