"""Choice of the threshold of slips from decisions out of fold, for `holdfast train`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from holdfast.detection import Model
from holdfast.metrics.slip_thresholds import (
    SLIP_THRESHOLDS,
    SlipSummary,
    ThresholdChoice,
    choose_threshold,
    slip_summary,
    summarise_choice,
)
from holdfast.metrics.slips import SlipCounts, SlipCurve, slip_metrics
from holdfast.training.tune import CurvePoint

SLIP_FALSE_ALARMS = 1.0
"""False alarms per minute of all held time of a finger for which the threshold is set."""

NO_SLIP_DECISIONS = (
    "no decision about a slip out of fold, from which a threshold could be chosen; the model gets "
    "no slip rule"
)


@dataclass(frozen=True)
class ChosenThreshold:
    """Threshold of the slip rules of a model, and the metrics out of fold.

    Attributes:
        index: of the threshold in `SLIP_THRESHOLDS`; None if none has few enough false alarms.
        counts: of all recordings at this threshold; at the highest if there is none.
        metrics: out of fold, each recording by the threshold of the others.
    """

    index: int | None
    counts: SlipCounts
    metrics: SlipSummary

    @property
    def reason(self) -> str:
        """Why there is no threshold; empty if there is one."""
        if self.index is not None:
            return ""
        minutes = self.counts.held_seconds / 60
        if not _supports(self.counts, SLIP_FALSE_ALARMS):
            return (
                f"{minutes:.2g} min of held time given; a threshold of slips for "
                f"{SLIP_FALSE_ALARMS:g} false alarms a minute needs at least "
                f"{1 / SLIP_FALSE_ALARMS:.2g} min; the model gets no slip rule"
            )
        return (
            f"no threshold of slips has at most {SLIP_FALSE_ALARMS:g} false alarms a minute in "
            f"{minutes:.2g} min of held time; the model gets no slip rule"
        )


def choose_slip_threshold(
    curves: Sequence[Mapping[str, SlipCurve]], groups: Sequence[int], seed: int
) -> ChosenThreshold | None:
    """Choose the threshold of slips from decisions out of fold.

    Args:
        curves: of each finger, of each recording.
        groups: unit of each recording; the threshold of its metrics is chosen without it.
        seed: of the bootstrap.

    Returns:
        The threshold; None if no recording has decisions about known slips.
    """
    used = [(fingers, unit) for fingers, unit in zip(curves, groups, strict=True) if fingers]
    if not used:
        return None
    known, units = [fingers for fingers, _ in used], [unit for _, unit in used]
    pooled = SlipCurve.total([SlipCurve.total(list(fingers.values())) for fingers in known])
    index = choose_threshold(pooled, SLIP_FALSE_ALARMS)
    shown = len(SLIP_THRESHOLDS) - 1 if index is None else index
    if len(set(units)) > 1:
        choice = ThresholdChoice(SLIP_FALSE_ALARMS)
        metrics = summarise_choice(known, choice, groups=units, seed=seed)
    else:
        counts = [{name: curve[shown] for name, curve in fingers.items()} for fingers in known]
        metrics = slip_summary(counts)
    if metrics is None:
        return None
    supported = _supports(pooled[0], SLIP_FALSE_ALARMS)
    return ChosenThreshold(index if supported else None, pooled[shown], metrics)


def _supports(counts: SlipCounts, false_alarms: float) -> bool:
    """Return whether the held time is long enough for one false alarm at the rate."""
    return counts.held_seconds / 60 * false_alarms >= 1


def with_slip_threshold(model: Model, chosen: ChosenThreshold | None) -> Model:
    """Return the model whose slip rules have a threshold; without slip rules if there is none."""
    if chosen is None or chosen.index is None:
        return model.changed(
            lambda part: part.without_thresholds("slip").without_heads("slip", "slip_speed")
        )
    threshold = float(SLIP_THRESHOLDS[chosen.index])
    point = CurvePoint.of_slips(threshold, slip_metrics(chosen.counts))
    return model.with_threshold("slip", threshold, point.choice(SLIP_FALSE_ALARMS))
