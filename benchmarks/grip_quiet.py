"""False reactions of grip laws in long quiet holds, with and without glitches of the hand.

The trials are those of `holdfast trial`, with the load moved to the end of a long hold. In the
profile of the trials the hand's own controller jerks a finger 7 times a minute; a reaction to
such a glitch counts here, unless a fingertip slid in the 0.3 s before it.

    python benchmarks/grip_quiet.py [--n 36] [--hold 15] [--seed 2] [--laws holdfast]
"""

import argparse
from dataclasses import replace

from holdfast.grip import LAWS
from holdfast.parallel import Engine
from holdfast_lab.trial.run import run_trial
from holdfast_lab.trial.trials import Trial, draw_trials


def quiet(trial: Trial, hold: float, glitch_rate: float | None) -> Trial:
    """Return a trial with a later load, and with another rate of glitches."""
    grasp = replace(trial.grasp, glitch_rate=glitch_rate)
    return replace(trial, grasp=grasp, load=trial.load._replace(start=hold))


def rate(law: str, trials: list[Trial]) -> str:
    """Return the false reactions per minute of a law, and the time that they rest on."""
    results = list(Engine(-1).map_ordered(run_trial, [(trial, law) for trial in trials]))
    minutes = sum(one.quiet_time for one in results) / 60
    return f"{sum(one.n_false for one in results) / minutes:8.1f} ({minutes:.1f} min)"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--n", type=int, default=36, help="number of holds")
    parser.add_argument("--hold", type=float, default=15.0, help="duration of a hold [s]")
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=list(LAWS))
    given = parser.parse_args()
    drawn = draw_trials(given.n, given.seed)
    print(f"{'law':16}{'no glitches':>20}{'7 a minute':>20}   false reactions a minute")
    for name in given.laws:
        cells = [rate(name, [quiet(one, given.hold, r) for one in drawn]) for r in (0.0, None)]
        print(f"{name:16}{cells[0]:>20}{cells[1]:>20}", flush=True)
