"""From a seed and a number to a recording of a randomized hand, with exact truth."""

from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import Phase
from holdfast.metrics.truth_labels import LabelRule, labels_from_truth
from holdfast.recordings import Recording, Tactile
from holdfast.sensors.types import Array, Flags, Integers
from holdfast.twin.hand import FINGERS
from holdfast.twin.operator import draw_tremor
from holdfast.twin.profile import profile
from holdfast.twin.protocol import OPEN_GAP, THUMB_SHARE, Command, Plan, Protocol
from holdfast.twin.simulation import generator_of
from holdfast.twin.steps import hold_wrench
from holdfast.twin.uskin import Uskin, with_server_effects
from holdfast.twin.world import TruthLog
from holdfast_lab.randomized.drawing import (
    MEASURED,
    SENSOR_KINDS,
    SensorDraw,
    draw_drives,
    draw_layout,
    draw_moving_vibration,
    draw_object,
    draw_sensor,
    draw_skin,
    measured_ranges,
    random_rotation,
    ranges,
    with_measured,
)
from holdfast_lab.randomized.gripper import GripperWorld, OperatorForce
from holdfast_lab.randomized.palm import (
    Segment,
    carrying_legs,
    draw_carrier,
    log_uniform,
    palm_motion,
    person_acceleration,
    uniform,
)
from holdfast_lab.randomized.scenario import Scenario, draw_events

MAX_TRIES = 12
"""Draws of an object and positions of the pads until the pads reach it."""
MAX_SECONDS = 45.0
"""Longest recording [s]."""
HOLD_ATTEMPTS = 6
"""A hold that fails at once is drawn again, this often at the most."""
SHORTEST_HOLD = 2.5
"""A hold that ends sooner after the lock than this has failed at once [s]."""
WATCHED_AFTER_LOSS = 1.5
"""A recording goes on for so long after the object was lost [s]."""


@dataclass(frozen=True)
class RandomHold:
    """Identity of a recording of a randomized hand.

    Attributes:
        number: from 0 on; every number is another hand, sensor, object and hold.
        seed: of all.
        kind: of the sensor; None draws it.
        attempt: from 0 on; a hold that fails at once is drawn again.
        grasp: from 1 on, for several grasps of one hand: hand, grip, sensor and gains depend on
            the number alone; object, positions of the pads and events on the grasp too. None for
            the only grasp of a hand.
        measured: mechanisms of `drawing.MEASURED` with which the sensor is read and the arm
            moves as real ones do. All else that is drawn is the same with and without them.
        whole: whether the recording begins with an open hand, whatever was drawn.

    Raises:
        ValueError: a mechanism is unknown.
    """

    number: int
    seed: int = 0
    kind: str | None = None
    attempt: int = 0
    grasp: int | None = None
    measured: tuple[str, ...] = ()
    whole: bool = False

    def __post_init__(self) -> None:
        if unknown := [name for name in self.measured if name not in MEASURED]:
            raise ValueError(f"unknown mechanism {unknown[0]!r}; there are {', '.join(MEASURED)}")

    @property
    def name(self) -> str:
        """Name of its recording."""
        name = f"hand{self.number:04d}"
        return name if self.grasp is None else f"{name}-grasp{self.grasp:02d}"

    @property
    def hand(self) -> "RandomHold":
        """The hold from which all is drawn that does not change with the grasp."""
        return self if self.grasp is None else replace(self, attempt=0, grasp=None)

    def generator(self, part: str) -> np.random.Generator:
        """Make the random numbers of one part; parts do not disturb each other."""
        grasp = "" if self.grasp is None else f"grasp{self.grasp}/"
        return generator_of(self.seed, f"{self.number}/{grasp}{self.attempt}/{part}")


def simulate_random(hold: RandomHold) -> Recording:
    """Simulate one hold of a randomized hand.

    Returns:
        Readings of two to four pads, with truth and labels. The metadata say what was drawn.
    """
    for attempt in range(HOLD_ATTEMPTS):
        run = _run(replace(hold, attempt=attempt))
        run.play()
        if run.held_for >= SHORTEST_HOLD and not run.world.unstable:
            break
    return run.recording()


def _run(hold: RandomHold) -> "_Run":
    """Draw a hold.

    Raises:
        ValueError: no object that was drawn fits the hand.
    """
    generator = hold.hand.generator("hand")
    span = ranges()
    kind = hold.kind or str(generator.choice(SENSOR_KINDS))
    drawn = draw_sensor(hold.hand.generator("sensor"), kind)
    if hold.measured:
        drawn = with_measured(drawn, kind, hold.measured, hold.hand.generator("measured"))
    n_pads = int(generator.choice(span["hand"]["pads"]))
    grip = log_uniform(generator, span["hand"]["grip"])
    # Drives and skin belong to the hand: with several grasps they are drawn before the numbers of
    # the grasp begin. With one they come after the object, an order that keeps old seeds valid.
    if hold.grasp is not None:
        drives, skin = draw_drives(generator), draw_skin(generator)
        generator = hold.generator("grasp")
    for _ in range(MAX_TRIES):
        item = draw_object(generator, grip, n_pads - 1)
        try:
            layout = draw_layout(generator, kind, item, n_pads)
            break
        except ValueError:
            continue
    else:
        raise ValueError(f"no object of {MAX_TRIES} fits the hand {hold.number}")
    if hold.grasp is None:
        drives, skin = draw_drives(generator), draw_skin(generator)
    world = GripperWorld(layout, item, drives, skin, hold.generator("world"), drawn.sensor.rate)
    return _Run(hold, world, _plan(generator, grip, n_pads), drawn)


def _plan(generator: np.random.Generator, grip: float, n_pads: int) -> Plan:
    span = ranges()
    events = span["events"]
    chosen = msgspec.structs.replace(
        profile("reference"),
        name="randomized",
        hold=uniform(generator, events["hold"]),
        grip=grip,
    )
    grips = grip * np.array([THUMB_SHARE * (n_pads - 1), *[1.0] * (n_pads - 1)])
    return Plan(
        profile=chosen,
        grips=grips,
        speed=uniform(generator, span["hand"]["closing_speed"]),
        before=uniform(generator, events["idle"]),
        after=uniform(generator, events["idle"]),
        disturbances=(),
    )


class _Run:
    """One hold as it is simulated, sample by sample."""

    def __init__(
        self, hold: RandomHold, world: GripperWorld, plan: Plan, drawn: SensorDraw
    ) -> None:
        generator = hold.generator("scenario")
        span = ranges()
        self.hold, self.world, self.plan, self.drawn = hold, world, plan, drawn
        self.period = 1 / drawn.sensor.rate
        self.protocol = Protocol(plan, self.period)
        tremors = np.stack([draw_tremor(generator), draw_tremor(generator)])
        self.events = draw_events(generator, span["events"], span["arm"], plan.profile.hold)
        self.scenario = Scenario(self.events, tremors, plan.profile.tremor)
        segments = [event.segment for event in self.events if event.segment is not None]
        vibration = log_uniform(generator, span["arm"]["vibration"])
        orientation = random_rotation(generator)
        duration = plan.profile.hold + 1.0
        self.carrier = carrier_of(hold)
        legs: list[Segment] = []
        acceleration: Array | float = 0.0
        if self.carrier is not None:
            carried = measured_ranges()[self.carrier]
            draws = hold.generator(self.carrier)
            if self.carrier == "carry":
                legs = carrying_legs(draws, carried, orientation, duration)
            else:
                acceleration = person_acceleration(draws, carried, orientation, duration)
        moving = 1.0  # factor on the vibration of the arm while it moves
        if "vibration" in hold.measured:
            moving = draw_moving_vibration(hold.hand.generator("vibration")) / vibration
        self.palm = palm_motion(
            generator, segments + legs, orientation, vibration, duration, max(1.0, moving),
            acceleration,
        )  # fmt: skip
        self.holder = _Holder(world, self.scenario, tremors[0], plan.profile.tremor)
        uskin = hold.hand.generator("skin")
        nodes = world.layout.surface.nodes
        self.skins = [
            Uskin(drawn.parameters, drawn.sensor, nodes, uskin) for _ in range(world.layout.n_pads)
        ]
        self._truth_log = TruthLog(FINGERS[: world.layout.n_pads])
        self._forces: list[list[Array]] = [[] for _ in self.skins]

    def play(self) -> None:
        """Simulate until the object is released, or lost and watched for a while."""
        touch_depths: Array | None = None
        k = 0
        while True:
            time = k * self.period
            body = self.world.bodies[-1]
            command = self.protocol.command(time, self.world.loads, self.world.slip, body)
            since = -1.0
            if self.protocol.locked_at is not None:
                since = time - self.protocol.locked_at
                if touch_depths is None:
                    # Depths at which each drive, alone, would just hold its load: where the grip
                    # begins.
                    touch_depths = command.depths + self.world.loads / self.world.drives.stiffness
                    item = self.world.item
                    limit = float(item.mu_static * self.world.loads.sum())
                    self.scenario.spare = max(limit - 9.81 * item.mass, 0.0)
                holding = self.protocol.lost_at is None and command.phase is not Phase.RELEASED
                if holding and since < self.plan.profile.hold:
                    self.scenario.step(since, self.world.slip, body[15:18], body, self.period)
                    self.scenario.set_down(self.palm.gravity[self.palm.at(since)])
            travels = OPEN_GAP - command.depths
            if touch_depths is not None and command.phase is Phase.LOCKED:
                # Only the part beyond the touch makes force, so only that part is scaled.
                pressed = travels - (OPEN_GAP - touch_depths)
                travels = OPEN_GAP - touch_depths + self.scenario.grip_scale * pressed
            self.world.scale_friction(self.scenario.friction_scale)
            self.holder.command(command, self.protocol.anchor, since, self.world.time)
            self.world.advance(travels, self.holder, self.palm, since)
            self._log(command)
            k += 1
            lost_at = self.protocol.lost_at
            lost = lost_at is not None and time > lost_at + WATCHED_AFTER_LOSS
            if self.protocol.is_over(time) or lost or time > MAX_SECONDS:
                return

    def _log(self, command: Command) -> None:
        world = self.world
        acting = self.scenario.acting or command.hold > 0
        force = world.outside[:3] * acting
        # The truth has forces alone: a torque counts as a push, or a twist would be no disturbance.
        if self.scenario.acting and np.linalg.norm(world.outside[3:]) > 0.002:
            force = force + 0.06 * np.array([0.0, 0.0, 1.0])
        self._truth_log.add(
            command.phase,
            world.contact,
            outside_force=force,
            object_pose=world.object_pose,
            set_point_error=world.set_point_error,
            gravity=world.hand.model.opt.gravity,
        )
        for pile, skin, forces in zip(
            self._forces, self.skins, world.contact.node_forces, strict=True
        ):
            pile.append(skin.taxel_forces(forces[None])[0])

    @property
    def held_for(self) -> float:
        """How long the object was held [s]."""
        locked_at, lost_at = self.protocol.locked_at, self.protocol.lost_at
        if locked_at is None:
            return 0.0
        return (len(self._truth_log) * self.period if lost_at is None else lost_at) - locked_at

    def recording(self) -> Recording:
        """Make the recording of what was simulated."""
        times: Array = np.arange(len(self._truth_log), dtype=np.float64) * self.period
        fingers = FINGERS[: self.world.layout.n_pads]
        truth = self._truth_log.truth(times)
        generator = self.hold.generator("readout")
        modules: dict[str, Tactile] = {}
        server = generator.random() < ranges()["sensor"]["server"]
        for finger, skin, pile in zip(fingers, self.skins, self._forces, strict=True):
            stamps: Array = times
            readings: npt.NDArray[Any] = skin.counts(np.array(pile), times, generator)
            if skin.sensor.unit == "N":
                parameters = skin.parameters
                above = readings.astype(np.float64) - parameters.baseline
                readings = np.asarray((above / parameters.counts_per_newton).astype(np.float32))
            effects = self.drawn.stream
            if effects.rows_per_update != 1.0:
                # Each row shows the last update of the sensor.
                rate = self.drawn.sensor.rate / effects.rows_per_update
                readings = readings[last_updates(times, rate, effects.update_phase)]
            if server:
                stamps, readings = with_server_effects(
                    times, readings, generator, jitter=0.1 * self.period
                )
            if effects.jitter:
                # Made anew for each finger: all fingers of a hold have the same stamps and gaps.
                draws = self.hold.generator("stamps")
                kept = kept_in_gaps(stamps, effects.gap_rate, effects.gap, draws)
                jitter = effects.jitter / self.drawn.sensor.rate
                unsteady, _ = with_server_effects(stamps, stamps, draws, jitter, repeat_share=0.0)
                stamps, readings = unsteady[kept], readings[kept]
            # No label lasts beyond the last sample that was sent.
            end = stamps[-1] + self.period
            labels = tuple(
                replace(label, end=min(label.end, end))
                for label in labels_from_truth(truth, finger, LabelRule(margin=0.0))
                if label.start < end
            )
            modules[finger] = Tactile(skin.sensor, stamps, readings, skin.sensor.unit, labels)
        whole = Recording(self.hold.name, modules, self._metadata(), truth)
        return self._cut(whole, generator)

    def _cut(self, whole: Recording, generator: np.random.Generator) -> Recording:
        """Cut the beginning off half of the recordings, so that they begin in contact."""
        loaded = generator.random() < ranges()["sensor"]["loaded_start"]
        locked_at = self.protocol.locked_at
        if not loaded or locked_at is None or self.hold.whole:
            return whole
        start = locked_at + float(generator.uniform(0.3, 2.0))
        modules = {
            name: module.slice(int(np.searchsorted(module.times, start)), module.n_samples)
            for name, module in whole.modules.items()
        }
        metadata = {**whole.metadata, "starts_loaded": True}
        truth = whole.truth
        if truth is not None:
            truth = truth.slice(int(np.searchsorted(truth.times, start)), len(truth.times))
        return Recording(whole.name, modules, metadata, truth)

    def _metadata(self) -> dict[str, object]:
        item = self.world.item
        return {
            "object": item.shape,
            "object_mass": item.mass,
            "friction": item.mu_static,
            "sensor_kind": self.drawn.sensor.name,
            "n_pads": self.world.layout.n_pads,
            "grip": self.plan.profile.grip,
            "events": [event.kind for event in self.events],
            "case": "failed" if self.protocol.failed else "random",
            "profile": "randomized",
            "seed": self.hold.seed,
            "hand": f"random-{self.hold.number}",
            **({} if self.hold.grasp is None else {"grasp": self.hold.grasp}),
            **({"measured": list(self.hold.measured)} if self.hold.measured else {}),
            **({"carrier": self.carrier} if self.carrier else {}),
            "source": "twin",
            "locked_at": self.protocol.locked_at,
            "lost_at": self.protocol.lost_at,
        }


def carrier_of(hold: RandomHold) -> str | None:
    """Return what carries the hand all the time, of the mechanisms of the hold."""
    drawn = draw_carrier(hold.hand.generator("carrier"), measured_ranges())
    return drawn if drawn in hold.measured else None


class _Holder(OperatorForce):
    """The operator: holds the object until the lock and after the hold, else acts by events."""

    def __init__(self, world: GripperWorld, scenario: Scenario, tremor: Array, rms: float) -> None:
        self._weight_of = world.item.mass
        self._world = world
        self._scenario = scenario
        self._tremor, self._rms = tremor, rms
        self._hold, self._time, self._since = 1.0, 0.0, -1.0
        self._anchor = np.zeros(12)

    def command(self, command: Command, anchor: Array, since: float, time: float) -> None:
        """Take what to do during the next sample."""
        self._hold, self._since, self._time = command.hold, since, time
        self._anchor = anchor

    def fill(self, body: Array, out: Array, ahead: float) -> None:
        """Fill the force and torque on the object: see `OperatorForce`."""
        if self._since >= 0:
            self._scenario.fill(body, out, ahead)
        else:
            out[:] = 0.0
        if self._hold > 0:
            held = hold_wrench(
                body, self._anchor, self._hold, 0.0, self._tremor, self._rms, self._time + ahead
            )
            out += held
            gravity = self._world.hand.model.opt.gravity
            out[:3] -= self._hold * self._weight_of * gravity


def last_updates(times: npt.ArrayLike, rate: float, phase: float) -> Integers:
    """Return (n,) the sample that each row of a stream shows, if the sensor updates slowly.

    The sensor updates at a rate of its own; a row shows the first sample since the last update.

    Args:
        times: (n,) increasing times of the rows [s].
        rate: of updates [Hz].
        phase: of the updates, from 0 to 1.

    Example:
        >>> last_updates([0.0, 0.025, 0.05, 0.075, 0.1, 0.125], 10.0, 0.0).tolist()
        [0, 0, 0, 0, 4, 4]
    """
    number = np.floor(np.asarray(times, dtype=np.float64) * rate + phase + 1e-9)
    first = np.diff(number, prepend=-np.inf) > 0
    result: Integers = np.maximum.accumulate(np.where(first, np.arange(len(number)), 0))
    return result


def kept_in_gaps(
    times: npt.ArrayLike, rate: float, length: tuple[float, float], generator: np.random.Generator
) -> Flags:
    """Return (n,) which samples of a stream remain where packets are lost in gaps.

    Args:
        times: (n,) increasing times [s].
        rate: of gaps [1/s].
        length: range of the time in which all packets are lost [s].
        generator: random number generator.
    """
    clock = np.asarray(times, dtype=np.float64)
    kept = np.ones(len(clock), dtype=bool)
    if len(clock) < 2:
        return kept
    n_gaps = int(generator.poisson(rate * (clock[-1] - clock[0])))
    starts = generator.uniform(clock[0], clock[-1], n_gaps)
    for start, stop in zip(starts, starts + generator.uniform(*length, n_gaps), strict=True):
        kept[slice(*np.searchsorted(clock, (start, stop)))] = False
    kept[[0, -1]] = True
    return kept
