"""Numbers of each law over all trials, with intervals by bootstrap over trials.

All laws run on the same trials, and the same resamples serve all of them. A drop counts as an
infinite slip and an infinite reaction time, and so does no reaction. A trial in which nothing
slipped has no onset of slip, and where the force had risen before the slip nothing reacted to it:
neither has a reaction time. `n_reacting` counts the others.
"""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from holdfast.metrics.statistics import (
    bootstrap_interval,
    finite_or_none,
    quantile,
    quantile_of,
    ratio_of_sums,
)
from holdfast.sensors.types import Array
from holdfast.twin.loads import LoadKind
from holdfast_lab.trial.run import TrialResult

Summary = dict[str, Any]
LONG_SLIP = 0.003
"""Sliding distance of a fingertip that a trial should not exceed [m]."""


def summarize(results: Sequence[TrialResult]) -> Summary:
    """Return the numbers of one law, as `trial.json` has them.

    Trials whose object was lost before the load and before the loop had begun are counted in
    `n_not_held`, trials that no force can hold in `n_infeasible`, and both in nothing else.

    Returns:
        `n`, `n_not_held`, `n_infeasible`, `n_slipped`, `n_raised_before`, `n_reacting`,
        `n_friction_reacting` and `drops`, their number by reason; `dropped` [%], `slip_median`,
        `slip_p75` and `slip_p90` [m], `slipped_over_3mm` [%], `reaction_median` and, of friction
        trials, `friction_reaction_median` [s], `force_ratio_mean`, `static_ratio_mean`,
        `coulomb_ratio_mean`, `peak_ratio_mean`, `false_reactions_per_minute` and
        `impact_reactions` [% of `n_impacts`]. Each of these is
        {"value": x, "interval": [low, high]}, null where it is infinite or not known.

    Example:
        >>> held = TrialResult(
        ...     number=0, law="fixed", object="can", unseen=False, kind="pull", n_fingers=4,
        ...     held=True, dropped=True, force_ratio=1.2, peak_ratio=1.0, quiet_time=3.0)
        >>> summarize([held, held])["dropped"]
        {'value': 100.0, 'interval': [100.0, 100.0]}
    """
    # Trials that no force can hold are left out: they say nothing about a law.
    held = [result for result in results if result.held and result.feasible]
    slips = [result.slip for result in held]
    reacting = [result for result in held if not math.isnan(reaction_time(result))]
    reactions = [reaction_time(result) for result in reacting]
    friction_reactions = [reaction_time(r) for r in reacting if r.kind == LoadKind.FRICTION]
    return {
        "n": len(held),
        "n_not_held": sum(result.feasible and not result.held for result in results),
        "n_infeasible": sum(not result.feasible for result in results),
        "n_slipped": sum(result.slipped for result in held),
        "n_raised_before": sum(result.raised_before for result in held),
        "n_reacting": len(reactions),
        "n_friction_reacting": len(friction_reactions),
        "drops": dict(Counter(result.drop_reason for result in held if result.dropped)),
        "dropped": _mean([100.0 * result.dropped for result in held]),
        "slip_median": _quantile(slips, 0.5),
        "slip_p75": _quantile(slips, 0.75),
        "slip_p90": _quantile(slips, 0.9),
        "slipped_over_3mm": _mean([100.0 * (slip > LONG_SLIP) for slip in slips]),
        "reaction_median": _quantile(reactions, 0.5),
        "friction_reaction_median": _quantile(friction_reactions, 0.5),
        "force_ratio_mean": _mean([result.force_ratio for result in held]),
        "static_ratio_mean": _mean([result.static_ratio for result in held]),
        "coulomb_ratio_mean": _mean([result.coulomb_ratio for result in held]),
        "peak_ratio_mean": _mean([result.peak_ratio for result in held]),
        "false_reactions_per_minute": _ratio(
            [60.0 * result.n_false for result in held], [result.quiet_time for result in held]
        ),
        "n_impacts": sum(result.n_impacts for result in held),
        "impact_reactions": _ratio(
            [100.0 * result.n_impact_reactions for result in held],
            [float(result.n_impacts) for result in held],
        ),
    }


def reaction_time(result: TrialResult) -> float:
    """Return the reaction time [s]: infinite after a drop, NaN if there was no slip to react to."""
    if result.raised_before:
        return math.nan
    return math.inf if result.dropped else result.reaction


def compare(results: Sequence[TrialResult], others: Sequence[TrialResult]) -> Summary:
    """Return the paired differences of a law to another, on the trials that both held.

    Slip and reaction may be infinite, so their difference is not always known. The shares of
    trials in which one law was better are: two infinite values are equal.

    Args:
        results: of the law.
        others: of the law that it is compared with, on the same trials.

    Returns:
        `n`; the differences `dropped` [percentage points], `force_ratio_mean`,
        `peak_ratio_mean` and `false_reactions_per_minute`; and the shares of trials
        `slid_less`, `slid_more` [%] and, of those in which something slipped under both laws,
        `reacted_sooner` and `reacted_later` [%]. Each number is {"value": x, "interval": ...}.
    """
    # Paired by trial: what differs between trials, such as weight and friction, cancels.
    by_number = {outcome.number: outcome for outcome in others if outcome.held and outcome.feasible}
    pairs = [
        (result, by_number[result.number])
        for result in results
        if result.held and result.feasible and result.number in by_number
    ]
    ones = [1.0] * len(pairs)
    reactions = [(reaction_time(outcome), reaction_time(other)) for outcome, other in pairs]
    # NaN: there was no slip to react to under one of the laws.
    times_of_both = [times for times in reactions if not np.isnan(times).any()]
    return {
        "n": len(pairs),
        "dropped": _ratio(
            [100.0 * outcome.dropped - 100.0 * other.dropped for outcome, other in pairs], ones
        ),
        "slid_less": _mean([100.0 * (outcome.slip < other.slip) for outcome, other in pairs]),
        "slid_more": _mean([100.0 * (outcome.slip > other.slip) for outcome, other in pairs]),
        "reacted_sooner": _mean([100.0 * (outcome < other) for outcome, other in times_of_both]),
        "reacted_later": _mean([100.0 * (outcome > other) for outcome, other in times_of_both]),
        "force_ratio_mean": _ratio(
            [outcome.force_ratio - other.force_ratio for outcome, other in pairs], ones
        ),
        "peak_ratio_mean": _ratio(
            [outcome.peak_ratio - other.peak_ratio for outcome, other in pairs], ones
        ),
        "false_reactions_per_minute": _false_reactions(pairs),
    }


def _false_reactions(pairs: Sequence[tuple[TrialResult, TrialResult]]) -> Summary:
    """Return the difference of the rates of false reactions [1/min]; quiet times may differ."""
    counts = np.array([
        [60.0 * a.n_false, a.quiet_time, 60.0 * b.n_false, b.quiet_time] for a, b in pairs
    ]).reshape(-1, 4)  # fmt: skip

    def statistic(draws: Array) -> Array:
        sums = draws @ counts
        # A resample may have no quiet time under one of the laws.
        is_counted = (sums[:, 1] > 0) & (sums[:, 3] > 0)
        rates = sums[is_counted]
        difference = np.full(len(sums), np.nan)
        difference[is_counted] = rates[:, 0] / rates[:, 1] - rates[:, 2] / rates[:, 3]
        return difference

    value = float(statistic(np.ones((1, len(counts))))[0])
    return _number(value, bootstrap_interval(statistic, len(counts)))


def _ratio(parts: Sequence[float], wholes: Sequence[float]) -> Summary:
    whole = sum(wholes)
    value = sum(parts) / whole if whole > 0 else None
    interval = bootstrap_interval(ratio_of_sums(parts, wholes), len(parts)) if parts else None
    return _number(value, interval)


def _mean(values: Sequence[float]) -> Summary:
    """Return the mean of the values that are known: those that are not NaN."""
    numbers = [value for value in values if not math.isnan(value)]
    return _ratio(numbers, [1.0] * len(numbers))


def _quantile(values: Sequence[float], share: float) -> Summary:
    single: list[Array] = [np.array([value]) for value in values]
    value = quantile(np.sort(np.array(values)), share)
    return _number(value, bootstrap_interval(quantile_of(single, share), len(values)))


def _number(value: float | None, interval: tuple[float | None, float | None] | None) -> Summary:
    ends = None if interval is None else list(interval)
    return {"value": finite_or_none(value), "interval": ends}
