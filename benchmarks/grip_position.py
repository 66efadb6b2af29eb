"""Normal forces that a force scale gives on a hand that takes set-points of its joints.

The position controller of the twin's hand takes the set-points that the hand `ros1:positions`
publishes, the same formula as that of `ros2:v4` and `ros2:v5`. Objects and grips are those of
`holdfast trial`, without a load and without glitches. Forces are means of 0.5 s before the scale
and of 1 s that begins 0.5 s after it.

    python benchmarks/grip_position.py [--scales 1.5 2 3] [--n 6] [--seed 3] [--gain 1]

`--gain` multiplies the change of the scale: 1.8 is what the twin's own hand needs
(`holdfast.twin.grasp.SERIES_GAIN`).
"""

import argparse
from dataclasses import replace

import numpy as np

from holdfast.devices.uri import parse
from holdfast.twin.control import PROPORTIONAL
from holdfast.twin.hand import FINGERS, N_JOINTS
from holdfast.twin.simulation import Simulation
from holdfast.twin.steps import TIP_LOAD
from holdfast_grip import FingerCommand, GripCommand, LoopState
from holdfast_lab.trial.trials import Trial, draw_trial
from holdfast_ros.hands.kinds import HAND_KINDS
from holdfast_ros.hands.parameters import Parameters
from holdfast_ros.link import Link, Publisher, TakeStates
from holdfast_ros.topic_messages import JointStates

STIFFNESS = ",".join(map(str, PROPORTIONAL.tolist()))
URI = f"ros1:positions?stiffness={STIFFNESS}&max_effort=9&shared=true"
"""The hand; the ceiling of its torques is not what is measured here."""
QUIET, BEGIN, SETTLED, END = 0.5, 1.0, 1.5, 2.5
"""Times after the lock: forces before from the first to the second, after from the third [s]."""


class TwinLink(Link):
    """Connection to the position controller of the twin's hand, without ROS.

    Attributes:
        state: newest joint states.
        set_points: newest set-points (16,) [rad]; None before the first command.
    """

    where = "in the twin"

    def __init__(self) -> None:
        self.state = JointStates((), np.zeros(N_JOINTS), np.zeros(N_JOINTS))
        self.set_points: np.ndarray | None = None

    def open(self) -> None:
        pass

    def close(self) -> None:
        pass

    def publisher(self, topic: str, kind: str) -> Publisher:
        return Publisher(self.follow, lambda: 1)

    def joint_states(self, topic: str) -> TakeStates:
        return lambda: [self.state]

    def follow(self, message) -> None:
        self.set_points = np.array(message["position"])

    def n_other_publishers(self, topic: str) -> int:
        return 0

    def subscribed_topics(self) -> list[str]:
        return []

    def published_topics(self) -> list[str]:
        return []


def forces(trial: Trial, scale: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the normal forces (4,) before and after a scale [N]; None if the object falls."""
    simulation = Simulation(replace(trial.grasp, glitch_rate=0.0), plan=trial.plan())
    world, link = simulation.world, TwinLink()
    advance, before, after = world.advance, [], []

    def follow(command, plan, anchor, displacement=None):
        """Advance the twin with the set-points of the hand."""
        target = world.path.targets(command.depths)
        angles = world.hand.data.qpos[:N_JOINTS].copy()
        link.state = JointStates((), angles, PROPORTIONAL * (target - angles))
        moved = None if link.set_points is None else link.set_points - target
        advance(command, plan, anchor, moved)

    world.advance = follow
    hand = HAND_KINDS["ros1"]["positions"].make(
        "twin", link, Parameters(parse(URI)[1]), standby=False
    )
    fingers = {name: FingerCommand(scale) for name in FINGERS}
    while simulation.held_for < QUIET and not simulation.is_over:
        simulation.step()
    with hand:
        while simulation.held_for < END:
            if simulation.is_over or simulation.protocol.lost_at is not None:
                return None
            simulation.step()
            begun = simulation.held_for >= BEGIN
            hand.send(GripCommand(0.0, LoopState.REACT if begun else LoopState.IDLE, fingers))
            if not begun or simulation.held_for >= SETTLED:
                (after if begun else before).append(world.contact.tips[:, TIP_LOAD].copy())
    return np.mean(before, axis=0), np.mean(after, axis=0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scales", type=float, nargs="+", default=[1.5, 2.0, 3.0])
    parser.add_argument("--n", type=int, default=6, help="number of grips")
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--gain", type=float, default=1.0)
    given = parser.parse_args()
    print(
        f"{'grip':14}{'scale':>6}{'thumb before':>14}{'after':>8}{'all before':>12}{'after':>8}  N"
    )
    for wanted in given.scales:
        ratios = []
        for drawn in (draw_trial(number, given.seed) for number in range(given.n)):
            found = forces(drawn, 1.0 + given.gain * (wanted - 1.0))
            if found is None:
                print(f"{drawn.grasp.object:14}{wanted:6.1f}  lost")
                continue
            first, last = found
            ratios.append(last.sum() / first.sum())
            print(
                f"{drawn.grasp.object:14}{wanted:6.1f}{first[0]:14.2f}{last[0]:8.2f}"
                f"{first.sum():12.2f}{last.sum():8.2f}  x {ratios[-1]:.2f}", flush=True,
            )  # fmt: skip
        print(f"scale {wanted:g}: {min(ratios):.2f} to {max(ratios):.2f} times the force\n")
