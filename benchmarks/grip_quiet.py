"""False rises of grip laws in long quiet holds, with and without jerks of the hand.

The trials are those of `holdfast trial`, without their load and with a longer hold. In the profile
of the trials the hand's own controller jerks a finger 7 times a minute. A rise counts as in the
trials: not within 0.3 s after a fingertip slid or the loop began; `all` counts the others too.
"joints" says whether the law sees the joint angles that the hand's driver reports. `lost` counts
objects that fell.

    python benchmarks/grip_quiet.py [--n 24] [--hold 30] [--seed 2] [--laws holdfast] [--jobs 1]
"""

import argparse
import math
from collections import Counter
from dataclasses import replace
from typing import NamedTuple

from holdfast.contact import CONTACT_FORCE, SLIP_SPEED
from holdfast.parallel import Engine
from holdfast.twin.hand import RATE
from holdfast.twin.steps import TIP_LOAD, TIP_SLIP
from holdfast_grip import LAWS, LoopState
from holdfast_lab.trial.run import SLIP_MEMORY, START_TIME, RunningTrial
from holdfast_lab.trial.trials import Trial, draw_trials


class Hold(NamedTuple):
    """Quiet time [s], false rises by reason, all rises, and whether the object was lost."""

    quiet: float
    rises: dict[str, int]
    n_rises: int
    lost: bool


def quiet(trial: Trial, hold: float, glitch_rate: float | None) -> Trial:
    """Return a trial whose load comes after the hold, and with another rate of jerks."""
    grasp = replace(trial.grasp, glitch_rate=glitch_rate)
    return replace(trial, grasp=grasp, load=trial.load._replace(start=hold))


def run_hold(trial: Trial, law: str, joints: bool) -> Hold:
    """Run a trial until its load."""
    running = RunningTrial(trial, law, "builtin:any", reports_joints=joints)
    began, slid, was_rising, time, rises = math.nan, -math.inf, False, 0.0, Counter[str]()
    n_rises = 0
    while not running.is_over and not running.is_lost:
        command = running.step()
        now, tips = running.simulation.held_for, running.simulation.world.contact.tips
        if now >= trial.load.start:
            break
        if math.isnan(began) and command.state is not LoopState.IDLE:
            began = now
        if tips[tips[:, TIP_LOAD] > CONTACT_FORCE, TIP_SLIP].max(initial=0.0) > SLIP_SPEED:
            slid = now
        is_rising = command.state is LoopState.REACT
        n_rises += is_rising and not was_rising
        if now - slid > SLIP_MEMORY and now - began > START_TIME:
            time += 1 / RATE
            if is_rising and not was_rising:
                rises[next(str(one.reason) for one in command.fingers.values() if one.reason)] += 1
        was_rising = is_rising
    return Hold(time, dict(rises), n_rises, running.is_lost)


def row(law: str, trials: list[Trial], joints: bool, jobs: int) -> str:
    """Return rate, time, reasons and losses of a law as text."""
    tasks = [(trial, law, joints) for trial in trials]
    holds = list(Engine(jobs).map_ordered(run_hold, tasks))
    minutes = sum(one.quiet for one in holds) / 60
    reasons: Counter[str] = sum((Counter(one.rises) for one in holds), Counter())
    why = ", ".join(f"{n} {reason}" for reason, n in sorted(reasons.items())) or "none"
    rate = reasons.total() / minutes
    n_rises, n_lost = sum(one.n_rises for one in holds), sum(one.lost for one in holds)
    return f"{rate:6.2f} {minutes:8.1f} {n_rises:4} {n_lost:5}   {why}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--n", type=int, default=24, help="number of holds")
    parser.add_argument("--hold", type=float, default=30.0, help="duration of a hold [s]")
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--plant", default="mild", help="profile of the plant")
    parser.add_argument("--jobs", type=int, default=-1)
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=["holdfast"])
    given = parser.parse_args()
    drawn = draw_trials(given.n, given.seed, given.plant)
    print(f"{'law':16}{'jerks':>9}{'joints':>8}  a min  minutes  all  lost   false rises by reason")
    for name in given.laws:
        for jerks, rate, joints in (("none", 0.0, True), ("yes", None, False), ("yes", None, True)):
            trials = [quiet(trial, given.hold, rate) for trial in drawn]
            cells = row(name, trials, joints, given.jobs)
            print(f"{name:16}{jerks:>9}{'yes' if joints else 'no':>8} {cells}", flush=True)
