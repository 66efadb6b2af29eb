"""Numbers of each law over all trials, with intervals by bootstrap over trials.

All laws run on the same trials, and the same resamples serve all of them. A drop counts as an
infinite slip and an infinite reaction time, and so does no reaction. A trial in which nothing
slipped has no onset of slip, so it has no reaction time; `n_slipped` counts the others.
"""

import math
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
from holdfast_lab.trial.run import TrialResult

Summary = dict[str, Any]


def summarize(results: Sequence[TrialResult]) -> Summary:
    """Return the numbers of one law, as `trial.json` has them.

    Trials whose object was lost before the load and before the loop had begun are counted in
    `n_not_held`, and in nothing else.

    Returns:
        `n`, `n_not_held`, `n_slipped`, `dropped` [%], `slip_median` [m], `reaction_median` [s],
        `force_ratio_mean`, `peak_ratio_mean` and `false_reactions_per_minute`. Each number is
        {"value": x, "interval": [low, high]}, null where it is infinite or not known.

    Example:
        >>> held = TrialResult(
        ...     number=0, law="fixed", object="can", unseen=False, kind="pull", n_fingers=4,
        ...     held=True, dropped=True, force_ratio=1.2, peak_ratio=1.0, quiet_time=3.0)
        >>> summarize([held, held])["dropped"]
        {'value': 100.0, 'interval': [100.0, 100.0]}
    """
    held = [result for result in results if result.held]
    reactions = [time for one in held if not math.isnan(time := reaction_time(one))]
    ones = [1.0] * len(held)
    return {
        "n": len(held),
        "n_not_held": len(results) - len(held),
        "n_slipped": len(reactions),
        "dropped": _ratio([100.0 * one.dropped for one in held], ones),
        "slip_median": _median([one.slip for one in held]),
        "reaction_median": _median(reactions),
        "force_ratio_mean": _ratio([one.force_ratio for one in held], ones),
        "peak_ratio_mean": _ratio([one.peak_ratio for one in held], ones),
        "false_reactions_per_minute": _ratio(
            [60.0 * one.n_false for one in held], [one.quiet_time for one in held]
        ),
    }


def reaction_time(result: TrialResult) -> float:
    """Return the reaction time [s]: infinite after a drop, NaN if nothing slipped."""
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
    by_number = {one.number: one for one in others if one.held}
    pairs = [
        (result, by_number[result.number])
        for result in results
        if result.held and result.number in by_number
    ]
    ones = [1.0] * len(pairs)
    reactions = [(reaction_time(one), reaction_time(other)) for one, other in pairs]
    known = [times for times in reactions if not np.isnan(times).any()]
    return {
        "n": len(pairs),
        "dropped": _ratio(
            [100.0 * one.dropped - 100.0 * other.dropped for one, other in pairs], ones
        ),
        "slid_less": _share([one.slip < other.slip for one, other in pairs]),
        "slid_more": _share([one.slip > other.slip for one, other in pairs]),
        "reacted_sooner": _share([one < other for one, other in known]),
        "reacted_later": _share([one > other for one, other in known]),
        "force_ratio_mean": _ratio(
            [one.force_ratio - other.force_ratio for one, other in pairs], ones
        ),
        "peak_ratio_mean": _ratio(
            [one.peak_ratio - other.peak_ratio for one, other in pairs], ones
        ),
        "false_reactions_per_minute": _false_reactions(pairs),
    }


def _false_reactions(pairs: Sequence[tuple[TrialResult, TrialResult]]) -> Summary:
    """Return the difference of the rates of false reactions [1/min]; quiet times may differ."""
    counts = np.array([[60.0 * one.n_false, one.quiet_time, 60.0 * other.n_false, other.quiet_time]
                       for one, other in pairs]).reshape(-1, 4)  # fmt: skip

    def statistic(draws: Array) -> Array:
        sums = draws @ counts
        known = (sums[:, 1] > 0) & (sums[:, 3] > 0)
        rates = sums[known]
        difference = np.full(len(sums), np.nan)
        difference[known] = rates[:, 0] / rates[:, 1] - rates[:, 2] / rates[:, 3]
        return difference

    value = float(statistic(np.ones((1, len(counts))))[0])
    return _number(value, bootstrap_interval(statistic, len(counts)))


def _share(hits: Sequence[bool]) -> Summary:
    return _ratio([100.0 * hit for hit in hits], [1.0] * len(hits))


def _ratio(parts: Sequence[float], wholes: Sequence[float]) -> Summary:
    whole = sum(wholes)
    value = sum(parts) / whole if whole > 0 else None
    interval = bootstrap_interval(ratio_of_sums(parts, wholes), len(parts)) if parts else None
    return _number(value, interval)


def _median(values: Sequence[float]) -> Summary:
    each: list[Array] = [np.array([value]) for value in values]
    value = quantile(np.sort(np.array(values)), 0.5)
    return _number(value, bootstrap_interval(quantile_of(each, 0.5), len(values)))


def _number(value: float | None, interval: tuple[float | None, float | None] | None) -> Summary:
    ends = None if interval is None else list(interval)
    return {"value": finite_or_none(value), "interval": ends}
