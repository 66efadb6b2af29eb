"""Thresholds of a model on its user's own handling, which has no labels."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from holdfast.classifiers.slip import raised_at
from holdfast.contact import STABLE, UNSTABLE
from holdfast.errors import TrainingError
from holdfast.metrics import FingerDecisions
from holdfast.metrics.masks import runs
from holdfast.metrics.slip_thresholds import THRESHOLDS
from holdfast.model import FingerModel
from holdfast.sensors.types import Flags
from holdfast.training.own_handling import held_durations
from holdfast.training.threshold import ThresholdReplay

STABLE_SHARE = 0.9
"""Share of the held samples of own handling that is STABLE: a tenth of it may be slip."""
RAISED_SHARE = 0.05
"""Share of the held samples of own handling in which a slip may be reported."""
STABLE_THRESHOLDS = 1.0 / (1.0 + np.exp(0.1 * np.arange(60, -61, -1)))
"""Thresholds of the probability of stability that are tried, lowest first."""


class OperatingPoint(NamedTuple):
    """Thresholds of a model on one sensor.

    Attributes:
        threshold: probability of stability from which a contact is stable.
        slip_threshold: probability from which a finger slides; None without a slip rule.
    """

    threshold: float
    slip_threshold: float | None


@dataclass(frozen=True, eq=False)
class HeldFinger:
    """One finger of one recording of own handling, decided with any threshold.

    Attributes:
        name: of the finger.
        replay: of the recording.
        held: (n,) True where the finger holds something.
    """

    name: str
    replay: ThresholdReplay
    held: Flags

    @property
    def decisions(self) -> FingerDecisions:
        """Decisions about the finger without debouncing."""
        return self.replay.raw.fingers[self.name]

    @property
    def seconds(self) -> float:
        """Held time [s]."""
        return float(held_durations(self.decisions.times)[self.held].sum())

    def stable(self, threshold: float) -> Flags:
        """Return (n,) where the finger is STABLE at a threshold."""
        return np.asarray(self.replay.states(self.decisions, threshold) == STABLE)

    def n_alarms(self, threshold: float) -> int:
        """Return the number of alarms: UNSTABLE between STABLE and STABLE.

        An alarm that ends with the release of the object is right in ordinary handling.
        """
        states = self.replay.states(self.decisions, threshold)
        spells = runs(states == UNSTABLE)
        inside = [(a, b) for a, b in spells if a > 0 and b < len(states)]
        return sum(bool(states[a - 1] == states[b] == STABLE) for a, b in inside)

    def raised(self, threshold: float) -> Flags:
        """Return (n,) where a slip is reported at a threshold; nowhere without a slip rule."""
        slip = self.decisions.slip
        if slip is None:
            return np.zeros_like(self.held)
        return raised_at(slip.times, slip.probability, threshold, slip.hold)


@dataclass(frozen=True, eq=False)
class HeldFingers:
    """All fingers of one sensor in own handling."""

    fingers: Sequence[HeldFinger]

    @property
    def seconds(self) -> float:
        """Held time of the finger that holds longest [s]."""
        totals: dict[str, float] = {}
        for finger in self.fingers:
            totals[finger.name] = totals.get(finger.name, 0.0) + finger.seconds
        return max(totals.values(), default=0.0)

    def stable_share(self, threshold: float) -> float:
        """Return the share of the held samples that are STABLE at a threshold."""
        return self._share(lambda finger: finger.stable(threshold))

    def alarms_per_minute(self, threshold: float) -> float:
        """Return the number of alarms of all fingers per minute of held time."""
        n = sum(finger.n_alarms(threshold) for finger in self.fingers)
        return 60 * n / self.seconds

    def raised_share(self, threshold: float) -> float:
        """Return the share of the held samples in which a slip is reported at a threshold."""
        return self._share(lambda finger: finger.raised(threshold))

    def slips_per_minute(self, threshold: float) -> float:
        """Return the number of reported slips of all fingers per minute of held time."""
        n = sum(len(runs(finger.raised(threshold) & finger.held)) for finger in self.fingers)
        return 60 * n / self.seconds

    def _share(self, mask_of: Callable[[HeldFinger], Flags]) -> float:
        n_held = sum(int(finger.held.sum()) for finger in self.fingers)
        n = sum(int((mask_of(finger) & finger.held).sum()) for finger in self.fingers)
        return n / max(n_held, 1)


def choose_operating_point(
    handling: HeldFingers, part: FingerModel, false_alarms: float | None = None
) -> OperatingPoint:
    """Choose the thresholds of a model on own handling.

    They never make the model more suspicious than it is: the threshold of stability is at most
    that of the model, the threshold of slips at least. Up to there it is the highest (of slips the
    lowest) at which enough held samples are quiet: `STABLE_SHARE` of them STABLE, a slip reported
    in at most `RAISED_SHARE`; or at most so many alarms of either kind.

    Args:
        handling: decided with its own location and scale.
        part: model of the fingers, with the thresholds of the model.
        false_alarms: maximum number of alarms a minute of held time; None for the shares.

    Raises:
        TrainingError: no threshold gives so few alarms.
    """
    alone = false_alarms is None
    most = math.inf if false_alarms is None else false_alarms

    def is_calm(threshold: float) -> bool:
        if alone:
            return handling.stable_share(threshold) >= STABLE_SHARE
        return handling.alarms_per_minute(threshold) <= most

    def is_silent(threshold: float) -> bool:
        if alone:
            return handling.raised_share(threshold) <= RAISED_SHARE
        return handling.slips_per_minute(threshold) <= most

    usual = part.classifier.threshold
    tried = [*(t for t in STABLE_THRESHOLDS.tolist() if t < usual), usual]
    threshold = _last_of_first(tried, is_calm)
    if threshold is None and not alone:
        raise TrainingError(
            f"no threshold gives at most {most:g} alarms a minute of this handling; the least is "
            f"{min(map(handling.alarms_per_minute, tried)):.2g}"
        )
    slip_threshold = None
    if part.slip is not None:
        usual = part.slip.classifier.threshold
        tried = [usual, *(t for t in THRESHOLDS.tolist() if t > usual)]
        slip_threshold = next(filter(is_silent, tried), tried[-1])
    return OperatingPoint(threshold or STABLE_THRESHOLDS[0].item(), slip_threshold)


def _last_of_first(values: Sequence[float], fits: Callable[[float], bool]) -> float | None:
    """Return the last of the first values that fit without a break; None if the first does not."""
    last = None
    for value in values:
        if not fits(value):
            break
        last = value
    return last
