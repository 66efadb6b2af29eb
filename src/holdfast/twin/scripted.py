"""Grasps with a given course: the twin performs a step of `holdfast teach`."""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import msgspec
import numpy as np

from holdfast.recordings import Recording
from holdfast.twin.impacts import draw_impacts
from holdfast.twin.loads import Load, LoadKind
from holdfast.twin.operator import PUSH_DIRECTIONS, Disturbance, draw_disturbance
from holdfast.twin.profile import GRASP_ATTEMPTS, profile
from holdfast.twin.simulation import RETRY_DEPTH_FACTOR, Grasp, Simulation, draw_plan
from holdfast.twin.slip_events import SlipEvent, SlipKind, draw_slip_event
from holdfast.twin.steps import PUSH

SCRIPT_PROFILE = "slips"
"""Profile of fingers and slip events of these grasps, with the fingers of `reference`."""
FIRST_MOVE, FIRST_ACTION = 0.8, 3.0
"""Times from the lock to the move to and fro before pulls, and to the first action [s]."""
AFTER_RELEASE = 6.0
"""Time with an open hand after the release, in which the skins creep back [s]."""
MIN_REST = 0.6
"""Shortest rest between two actions [s]: an onset needs a level before it."""
MIN_ACTION = 0.1
"""Shortest action, in a time with too many of them [s]."""
SPREAD_START = 0.2
"""Share of the time of an action by which its start is drawn."""
LAST_ACTION = 1.0
"""Time from the end of the last action to the release [s]."""


class Script(NamedTuple):
    """Events while the object is held; without any field set, there are none.

    Attributes:
        kinds: slip events, in turn.
        disturbed_as: profile from which disturbances are drawn; empty for none.
        style: of the disturbances; None as drawn.
        depth: factor of their depth.
        struck_as: profile from which impacts are drawn, which take turns with the disturbances;
            empty for none.
        carried: whether the arm moves the hand.
    """

    kinds: tuple[SlipKind, ...] = ()
    disturbed_as: str = ""
    style: int | None = None
    depth: float = 1.0
    struck_as: str = ""
    carried: bool = False


SCRIPTS = {
    "open": None,
    "carry": Script(carried=True),
    "pull": Script(kinds=(SlipKind.CREEP, SlipKind.TWIST, SlipKind.TURN)),
    "push": Script(disturbed_as="reference"),
    "touch": Script(disturbed_as="gentle", style=PUSH, depth=0.5, struck_as="coupled"),
}
"""Course of the grasp of each step, by its name; None is an open hand. Fixed before the first
model was taught by them."""
TRANSPORT_ACCELERATION = (2.0, 5.0)
"""Range of the largest acceleration of an arm that carries [m/s^2]."""
TRANSPORT_DURATION = (1.2, 2.0)
"""Range of the duration of a movement of that arm [s]."""


def perform(grasp: Grasp, action: str, n_actions: int, seconds: float) -> Recording:
    """Simulate a step, with exact truth; a grasp that fails is tried again.

    Args:
        grasp: object, repeat and seed.
        action: one of `SCRIPTS`.
        n_actions: number of pulls, pushes or movements of the arm; each has its part of the time,
            and ends with it.
        seconds: time for which the object is held, or the hand is open [s].

    Raises:
        ValueError: there is no such action.
    """
    if action not in SCRIPTS:
        raise ValueError(f"unknown action {action!r}; there are {', '.join(SCRIPTS)}")
    script = SCRIPTS[action]
    base = replace(grasp, case=1, profile=SCRIPT_PROFILE)
    for attempt in range(GRASP_ATTEMPTS):
        simulation = _simulation(replace(base, attempt=attempt), script, n_actions, seconds)
        while not simulation.is_over:
            simulation.step()
        if script is None or not simulation.protocol.failed:
            break
    return simulation.recording()


def _simulation(grasp: Grasp, script: Script | None, n_actions: int, seconds: float) -> Simulation:
    chosen = msgspec.structs.replace(profile(SCRIPT_PROFILE), hold=seconds)
    plan = draw_plan(grasp, chosen)._replace(profile=chosen, after=AFTER_RELEASE)
    if script is None:  # released from the beginning: the hand stays open
        simulation = Simulation(grasp, plan=plan._replace(after=seconds))
        simulation.protocol.release(0.0)
        return simulation
    generator = grasp.generator("script")
    scale = RETRY_DEPTH_FACTOR**grasp.attempt
    disturbances: list[Disturbance] = []
    events: list[SlipEvent] = []
    loads: list[Load] = []
    if script.kinds:  # a person moves it to and fro first: so the clock of a camera is found
        moving = msgspec.structs.replace(profile("gentle"), move_share=1.0)
        moved = draw_disturbance(generator, moving, FIRST_MOVE, "left", scale)
        longest = FIRST_ACTION - FIRST_MOVE - MIN_REST
        disturbances.append(moved._replace(duration=min(moved.duration, longest)))
    ends = np.linspace(FIRST_ACTION, seconds - LAST_ACTION, n_actions + 1).tolist()
    spans = list(pairwise(ends))
    if script.struck_as and (ranges := profile(script.struck_as).impacts) is not None:
        always = msgspec.structs.replace(ranges, share=1.0)
        plan = plan._replace(impacts=draw_impacts(generator, always, spans[::2]))
        spans = spans[1::2]
    for k, (begin, end) in enumerate(spans):
        start = begin + SPREAD_START * (end - begin) * float(generator.random())
        room = max(end - start - MIN_REST, MIN_ACTION)
        if script.kinds and chosen.slips is not None:
            kind = script.kinds[k % len(script.kinds)]
            event = draw_slip_event(generator, chosen.slips, kind, start, scale)
            longest = max(room - event.recovery, MIN_ACTION)
            events.append(event._replace(duration=min(event.duration, longest)))
        elif script.disturbed_as:
            drawn = _disturbance(generator, script, start, k, scale)
            disturbances.append(drawn._replace(duration=min(drawn.duration, room)))
        elif script.carried:
            way = generator.normal(size=3)
            along = tuple((way / np.linalg.norm(way)).tolist())
            duration, size = (
                float(generator.uniform(*span))
                for span in (TRANSPORT_DURATION, TRANSPORT_ACCELERATION)
            )
            loads.append(Load(LoadKind.TRANSPORT, start, min(duration, room), size, along))
    plan = plan._replace(disturbances=disturbances, slip_events=events)
    return Simulation(grasp, plan=plan, loads=loads)


def _disturbance(
    generator: np.random.Generator, script: Script, start: float, k: int, scale: float
) -> Disturbance:
    direction = PUSH_DIRECTIONS[k % len(PUSH_DIRECTIONS)]
    drawn = draw_disturbance(
        generator, profile(script.disturbed_as), start, direction, scale * script.depth
    )
    return drawn if script.style is None else drawn._replace(style=script.style)
