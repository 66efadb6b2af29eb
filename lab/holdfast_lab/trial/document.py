"""Contents of `trial.json` and `trials.csv`, from the results of all trials."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from holdfast.csv_cells import csv_text
from holdfast.twin.loads import LoadKind
from holdfast.twin.plant import plant_named
from holdfast_lab.trial.plan import TrialPlan
from holdfast_lab.trial.run import LIMITS, TrialResult
from holdfast_lab.trial.summary import Summary, compare, summarize
from holdfast_lab.trial.trials import GRIP_MULTIPLE

OWN_LAW, BASELINE_LAW = "holdfast", "fixed"
"""The law of holdfast, and the hand without control; each other law is compared with both."""
GOALS = {
    "dropped": 5.0,
    "slip_p90": 0.005,
    "friction_reaction_median": 0.06,
    "force_ratio_mean": 2.1,
    "false_reactions_per_minute": 1.0,
}
"""Largest values that the law of holdfast should reach, by the field of `trial.json`."""
TrialResults = Mapping[str, Sequence[TrialResult]]
"""Results of the trials by law."""


def document_of(plan: TrialPlan, results: TrialResults, example: int | None) -> dict[str, Any]:
    """Return the numbers of `trial.json`; the field names are part of the contract.

    Args:
        plan: of the comparison.
        results: by law, in the order of the trials.
        example: number of the trial that is shown; None if there is none.
    """
    # A result for JSON, null for what is infinite or unknown.
    return {
        "laws": _summaries(results),
        "unseen_objects": _summaries(results, unseen=True),
        "seen_objects": _summaries(results, unseen=False),
        "by_kind": {kind.value: _summaries(results, kind=kind.value) for kind in LoadKind},
        "by_fingers": {str(n): _summaries(results, n_fingers=n) for n in (3, 4)},
        "paired": {
            other: {law: compare(results[law], results[other]) for law in results if law != other}
            for other in (BASELINE_LAW, OWN_LAW)
            if other in results
        },
        "example": None if example is None else _example(results, example),
        "infeasible": infeasible_of(results),
        "trials": [
            msgspec.json.decode(msgspec.json.encode(x))
            for trials in results.values()
            for x in trials
        ],
        "n_trials": plan.n,
        "model": plan.model if plan.model.startswith("builtin:") else Path(plan.model).name,
        "model_digest": plan.model_digest,
        "goals": GOALS,
        "first_grip": GRIP_MULTIPLE,
        "plant": msgspec.to_builtins(plant_named(plan.plant)),
        "limits": msgspec.to_builtins(LIMITS),
        "seed": plan.seed,
        "impacts_per_trial": plan.n_impacts,
    }


def example_of(results: TrialResults) -> int | None:
    """Return the number of the first trial that the baseline loses and the own law holds.

    Returns:
        The number; None if there is no such trial, or one of the two laws was not run.
    """
    pairs = zip(results.get(BASELINE_LAW, ()), results.get(OWN_LAW, ()), strict=False)
    saved = (
        trial.number
        for lost, trial in pairs
        if lost.held and lost.dropped and trial.held and trial.feasible and not trial.dropped
    )
    return next(saved, None)


def infeasible_of(results: TrialResults) -> list[dict[str, Any]]:
    """Return the trials that no force can hold, which are left out for every law."""
    return [
        {"number": result.number, "object": result.object, "kind": result.kind}
        for result in next(iter(results.values()), ())
        if not result.feasible
    ]


def trials_csv(results: TrialResults) -> str:
    """Return a line for each trial with each law; `inf` is infinite, an empty field unknown."""
    names = list(TrialResult.__struct_fields__)
    lines = ([getattr(x, name) for name in names] for trials in results.values() for x in trials)
    rows = [["" if str(value) == "nan" else value for value in line] for line in lines]
    return csv_text([names, *rows])


def _summaries(results: TrialResults, **fields: object) -> dict[str, Summary]:
    """Return the numbers of each law over the trials whose fields have these values."""
    return {
        law: summarize(
            [x for x in trials if all(getattr(x, name) == fields[name] for name in fields)]
        )
        for law, trials in results.items()
    }


def _example(results: TrialResults, number: int) -> dict[str, Any]:
    trial = next(trial for trial in results[OWN_LAW] if trial.number == number)
    return {
        "number": number, "object": trial.object, "kind": trial.kind, "n_fingers": trial.n_fingers,
        "lost_by": BASELINE_LAW, "held_by": OWN_LAW,
    }  # fmt: skip
