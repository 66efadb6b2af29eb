"""The grip law in long quiet holds of the twin: false rises, objects lost, and knocks answered.

The trials are those of `holdfast trial`, with the load after a longer hold. A rise is false as it
is there: not within 0.3 s after a fingertip slid or the loop began, nor within 0.5 s after an
impact. Impacts are counted apart by whether a fingertip slid by more than 0.1 mm in that time.

    python benchmarks/long_holds.py [--n 64] [--hold 30] [--seed 88] [--plant hard] [--impacts 3]
"""

import argparse
import math
from dataclasses import replace
from typing import NamedTuple

from holdfast.contact import CONTACT_FORCE
from holdfast.parallel import Engine
from holdfast.twin.steps import TIP_LOAD, TIP_SLIP
from holdfast_grip.command import LoopState
from holdfast_lab.trial.quiet_hold import QuietHold
from holdfast_lab.trial.run import RunningTrial
from holdfast_lab.trial.trials import Trial, draw_trial

SLID = 1e-4
"""Sliding distance from which an impact moved a finger [m]."""


class Hold(NamedTuple):
    """Quiet time [s], false rises, whether the object was lost, and (slid, answered) by impact."""

    quiet: float
    n_false: int
    lost: bool
    impacts: list[tuple[bool, bool]]


def run_hold(trial: Trial, model: str) -> Hold:
    """Run a trial until its load."""
    running, hold = RunningTrial(trial, "holdfast", model), QuietHold(trial.impacts())
    while not (running.is_over or running.is_lost):
        command = running.step()
        now, tips = running.simulation.held_for, running.simulation.world.contact.tips
        if now >= trial.load.start:
            break
        if command.state is not LoopState.IDLE:
            speed = tips[tips[:, TIP_LOAD] > CONTACT_FORCE, TIP_SLIP].max(initial=0.0)
            hold.add(now, float(speed), command)
    impacts = [(impact.distance > SLID, impact.is_answered) for impact in hold.impacts]
    lost = running.is_lost and not math.isnan(hold.began_at)  # else the first grip failed
    return Hold(hold.quiet_time, hold.n_false, lost, impacts)


def share(answered: list[bool]) -> str:
    """Return how many of some impacts were answered, in words."""
    return f"{sum(answered)} of {len(answered)}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--n", type=int, default=64, help="number of holds")
    parser.add_argument("--hold", type=float, default=30.0, help="duration of a hold [s]")
    parser.add_argument("--seed", type=int, default=88)
    parser.add_argument("--plant", default="mild")
    parser.add_argument("--impacts", type=int, default=0)
    parser.add_argument("--model", default="builtin:twin")
    parser.add_argument("--jobs", type=int, default=-1)
    given = parser.parse_args()
    for jerks, rate in (("no", 0.0), ("yes", None)):
        tasks = []
        for k in range(given.n):
            trial = draw_trial(k, given.seed, given.plant, given.impacts)
            grasp = replace(trial.grasp, glitch_rate=rate)
            load = trial.load._replace(start=given.hold)
            tasks.append((replace(trial, grasp=grasp, load=load), given.model))
        holds = list(Engine(given.jobs).map_ordered(run_hold, tasks))
        minutes, n_false = sum(one.quiet for one in holds) / 60, sum(one.n_false for one in holds)
        impacts = [impact for one in holds for impact in one.impacts]
        print(
            f"jerks {jerks:3}: {n_false / minutes:.2f} false rises a minute in {minutes:.1f} min, "
            f"{sum(one.lost for one in holds)} of {given.n} objects lost; impacts answered: "
            f"{share([rose for slid, rose in impacts if slid])} that moved a finger, "
            f"{share([rose for slid, rose in impacts if not slid])} that did not",
            flush=True,
        )
