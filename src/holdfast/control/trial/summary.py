"""Numbers of each law over all trials, with intervals by bootstrap over trials.

All laws run on the same trials, and the same resamples serve all of them. A drop counts as an
infinite slip, and no reaction as an infinite reaction time.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from holdfast.control.trial.run import TrialResult
from holdfast.metrics.intervals import bootstrap_interval, quantile_of, ratio_of_sums
from holdfast.metrics.statistics import finite_or_none, quantile
from holdfast.sensors.types import Array


def summarize(results: Sequence[TrialResult]) -> dict[str, Any]:
    """Return the numbers of one law, as `trial.json` has them.

    Trials whose object was lost before the load, or in which the loop had not begun by then,
    are counted in `n_not_held`, and in nothing else.

    Returns:
        `n`, `n_not_held`, `dropped` [%], `slip_median` [m], `reaction_median` [s],
        `force_ratio_mean`, `peak_ratio_mean` and `false_reactions_per_minute`. Each number is
        {"value": x, "interval": [low, high]}, null where it is infinite or not known.

    Example:
        >>> held = TrialResult(
        ...     number=0, law="fixed", object="can", unseen=False, kind="pull", n_fingers=4,
        ...     held=True, dropped=True, force_ratio=1.2, peak_ratio=1.0, quiet_time=3.0)
        >>> summarize([held, held])["dropped"]
        {'value': 100.0, 'interval': [100.0, 100.0]}
    """
    held = [one for one in results if one.held]
    slipped = [one for one in held if one.slipped]
    ones = [1.0] * len(held)
    return {
        "n": len(held),
        "n_not_held": len(results) - len(held),
        "dropped": _ratio([100.0 * one.dropped for one in held], ones),
        "slip_median": _median([one.slip for one in held]),
        "reaction_median": _median([one.reaction for one in slipped]),
        "force_ratio_mean": _ratio([one.force_ratio for one in held], ones),
        "peak_ratio_mean": _ratio([one.peak_ratio for one in held], ones),
        "false_reactions_per_minute": _ratio(
            [60.0 * one.n_false for one in held], [one.quiet_time for one in held]
        ),
    }


def _ratio(parts: Sequence[float], wholes: Sequence[float]) -> dict[str, Any]:
    whole = sum(wholes)
    value = sum(parts) / whole if whole > 0 else None
    interval = bootstrap_interval(ratio_of_sums(parts, wholes), len(parts)) if parts else None
    return _number(value, interval)


def _median(values: Sequence[float]) -> dict[str, Any]:
    each: list[Array] = [np.array([value]) for value in values]
    value = quantile(np.sort(np.array(values)), 0.5)
    return _number(value, bootstrap_interval(quantile_of(each, 0.5), len(values)))


def _number(
    value: float | None, interval: tuple[float | None, float | None] | None
) -> dict[str, Any]:
    ends = None if interval is None else list(interval)
    return {"value": finite_or_none(value), "interval": ends}
