"""Settings of the rival grip laws on trials of a tuning seed, by one rule.

    python benchmarks/tune_laws.py OUT.jsonl [--laws pr2 wong-zhu] [--n 60] [--seed 100]

Each law has the same number of settings, listed below before any of them ran. The trials are those
of `holdfast trial --seed 100`, by the same functions. The rule: among the settings with at most 5 %
dropped, those with at most 1 false reaction a minute, else the one with the fewest; of these the
one with the least force. If every setting drops more, the one with the fewest drops.

OUT gets one line for each trial and setting. The trials take turns, so that a run that was stopped
has all settings on the same trials; the same command continues it. The tables are of the trials
that all settings have.
"""

import argparse
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

import msgspec

from holdfast_grip.laws import Law
from holdfast_grip.laws.costanzo import Costanzo
from holdfast_grip.laws.friction_margin import FrictionMargin
from holdfast_grip.laws.pr2 import Pr2
from holdfast_grip.laws.wong_zhu import WongZhu
from holdfast_lab.trial import run
from holdfast_lab.trial.reference_rows import V5Reflex
from holdfast_lab.trial.run import TrialResult, run_trial
from holdfast_lab.trial.summary import Summary, summarize
from holdfast_lab.trial.trials import draw_trial

MOST_DROPPED, MOST_FALSE = 5.0, 1.0
"""Drops [%] and false reactions [1/min] that the rule allows."""
SETTINGS: dict[str, tuple[type[Law], list[dict[str, Any]]]] = {
    "pr2": (Pr2, [
        {"threshold_factor": 1.0, "fall": 0.0},
        {"threshold_factor": 1.0, "fall": 0.2},
        {"threshold_factor": 1.5, "fall": 0.2},
        {"threshold_factor": 2.0, "fall": 0.2},
        {"threshold_factor": 1.5, "fall": 0.5},
    ]),
    "wong-zhu": (WongZhu, [
        {"threshold": 0.05, "fall": 0.0},
        {"threshold": 0.05, "fall": 0.2},
        {"threshold": 0.1, "fall": 0.2},
        {"threshold": 0.1, "fall": 0.2, "together": True},
        {"threshold": 0.2, "fall": 0.2, "together": True},
    ]),
    "friction-margin": (FrictionMargin, [
        {"first_friction": 0.5, "margin": 1.15, "acts_at": 1.15, "fall": 7.5},
        {"first_friction": 0.4, "margin": 1.15, "acts_at": 1.1, "fall": 0.2},
        {"first_friction": 0.5, "margin": 1.15, "acts_at": 1.1, "fall": 0.2},
        {"first_friction": 0.7, "margin": 1.15, "acts_at": 1.1, "fall": 0.2},
        {"first_friction": 0.5, "margin": 1.3, "acts_at": 1.1, "fall": 0.2},
    ]),
    "costanzo": (Costanzo, [
        {"first_friction": 0.5, "least_friction": 0.25, "gain": 0.3, "slip_level": 0.1},
        {"first_friction": 0.5, "least_friction": 0.25, "gain": 1.0, "slip_level": 0.1},
        {"first_friction": 0.5, "least_friction": 0.25, "gain": 0.3, "slip_level": 0.03},
        {"first_friction": 0.4, "least_friction": 0.25, "gain": 0.3, "slip_level": 0.1},
        {"first_friction": 0.7, "least_friction": 0.4, "gain": 1.0, "slip_level": 0.03},
    ]),
    "v5-reflex": (V5Reflex, [
        {"level": 0.0},
        {"level": 1.02},
        {"level": 1.05},
        {"level": 1.1},
        {"level": 1.2},
    ]),
}  # fmt: skip
"""Settings by law; the first ones of the first three laws are those of the laws before. A fall of
7.5 /s is 5 % a step."""


def name_of(law: str, setting: Mapping[str, Any]) -> str:
    """Return the name of a law with a setting."""
    return " ".join([law, *(f"{key}={value}" for key, value in setting.items())])


def run_settings(path: Path, laws: list[str], n: int, seed: int) -> None:
    """Run what is missing in the file, trial by trial."""
    known = {(result.law, result.number) for result in stored(path)}
    for number in range(n):
        for law in laws:
            kind, settings = SETTINGS[law]
            for setting in settings:
                if (name_of(law, setting), number) not in known:
                    result = run_setting(law, kind, setting, number, seed)
                    with path.open("a") as file:
                        print(json.dumps(msgspec.structs.asdict(result)), file=file)


def run_setting(
    law: str, kind: type[Law], setting: Mapping[str, Any], number: int, seed: int
) -> TrialResult:
    """Run one trial with one setting of a law."""
    with patch.object(run, "row_named", lambda _: kind(**setting)):
        return run_trial(draw_trial(number, seed), name_of(law, setting))


def stored(path: Path) -> list[TrialResult]:
    """Return the stored results."""
    lines = path.read_text().splitlines() if path.exists() else []
    return [TrialResult(**json.loads(line)) for line in lines]


def print_tables(path: Path, laws: list[str]) -> None:
    """Print the table of each law, its best setting marked."""
    results = stored(path)
    for law in laws:
        names = [name_of(law, setting) for setting in SETTINGS[law][1]]
        numbers = [{one.number for one in results if one.law == name} for name in names]
        common = set.intersection(*numbers)
        if not common:
            continue
        shared = [one for one in results if one.number in common]
        rows = {name: summarize([one for one in shared if one.law == name]) for name in names}
        best = best_of(rows)
        print(f"\n| {law} | trials | dropped % | force / least | false a minute | slip p90 mm |")
        print("|---|--:|--:|--:|--:|--:|")
        for name, row in rows.items():
            shown = f"**{name}**" if name == best else name
            p90 = row["slip_p90"]["value"]
            slip = "lost" if p90 is None else f"{1e3 * p90:.1f}"
            print(
                f"| {shown} | {row['n']} | {value(row, 'dropped'):.1f} "
                f"| {value(row, 'force_ratio_mean'):.2f} "
                f"| {value(row, 'false_reactions_per_minute'):.1f} | {slip} |"
            )


def best_of(rows: Mapping[str, Summary]) -> str:
    """Return the name of the best setting, by the rule of this file."""
    fewest = min(value(row, "dropped") for row in rows.values())
    most = max(MOST_DROPPED, fewest)
    kept = {name: row for name, row in rows.items() if value(row, "dropped") <= most}
    least = min(value(row, "false_reactions_per_minute") for row in kept.values())
    quiet = max(MOST_FALSE, least)
    kept = {k: row for k, row in kept.items() if value(row, "false_reactions_per_minute") <= quiet}
    return min(kept, key=lambda name: value(kept[name], "force_ratio_mean"))


def value(row: Summary, field: str) -> float:
    """Return a number of a summary, infinite where it is not known."""
    number = row[field]["value"]
    return math.inf if number is None else float(number)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path, help="file of the results")
    parser.add_argument("--laws", nargs="+", choices=SETTINGS, default=list(SETTINGS))
    parser.add_argument("--n", type=int, default=60, help="number of trials")
    parser.add_argument("--seed", type=int, default=100)
    given = parser.parse_args()
    run_settings(given.out, given.laws, given.n, given.seed)
    print_tables(given.out, given.laws)
