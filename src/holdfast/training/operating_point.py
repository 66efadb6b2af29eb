"""Thresholds of a model on its user's own handling, which has no labels."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import takewhile

import msgspec
import numpy as np

from holdfast.contact import STABLE, UNSTABLE
from holdfast.detection import FingerModel, HeadName
from holdfast.errors import TrainingError
from holdfast.metrics import FingerDecisions
from holdfast.metrics.masks import runs
from holdfast.metrics.slip_thresholds import THRESHOLDS
from holdfast.sensors.types import Array, Flags
from holdfast.training.own_handling import grasped_durations, location_and_scale
from holdfast.training.replay import ThresholdReplay

STABLE_SHARE = 0.95
"""Share of the held samples of own handling that is STABLE."""
RAISED_SHARE = 0.05
"""Share of the held samples of own handling in which a slip may be reported."""
WORSE = 0.5
"""Change of a share of the held samples from which a calibration made it worse [% points]."""
MAX_DISTANCE = 3.0
"""A threshold is at most this many scales of the log odds from their location: what is further
away is taken for slip, and the share is not reached then."""
HIGHEST_THRESHOLD = 0.9
"""Highest threshold of stability that own handling sets."""


Thresholds = dict[HeadName, float]
"""Thresholds of a model on one sensor, by head."""


class HandlingFigures(msgspec.Struct, frozen=True):
    """Decisions of a model about own handling.

    Attributes:
        threshold: of the probability of stability.
        stable: share of the held samples that are STABLE [%].
        alarms_per_minute: alarms of all fingers per minute of held time.
        slip_threshold: of the probability of a slip; None without a slip rule.
        raised: share of the held samples in which a slip is reported [%]; None without one.
    """

    threshold: float
    stable: float
    alarms_per_minute: float
    slip_threshold: float | None = None
    raised: float | None = None

    def worse_than(self, other: "HandlingFigures") -> bool:
        """Return whether STABLE is rarer, slip is reported more, or alarms are more frequent.

        An alarm begins and ends with STABLE, so more of them are no worse where more samples are
        STABLE: a finger that is never STABLE has no alarm.
        """
        stable = self.stable - other.stable
        raised = (self.raised or 0.0) - (other.raised or 0.0)
        more_alarms = self.alarms_per_minute > other.alarms_per_minute
        return stable < -WORSE or raised > WORSE or (stable <= 0 and more_alarms)


@dataclass(frozen=True, eq=False)
class GraspingFinger:
    """One finger of one recording of own handling, decided with any threshold.

    Attributes:
        name: of the finger.
        replay: of the recording.
        grasped: (n,) True where the finger holds something.
    """

    name: str
    replay: ThresholdReplay
    grasped: Flags

    @property
    def decisions(self) -> FingerDecisions:
        """Decisions about the finger without debouncing."""
        return self.replay.raw.fingers[self.name]

    @property
    def seconds(self) -> float:
        """Held time [s]."""
        return float(grasped_durations(self.decisions.times)[self.grasped].sum())

    def stable(self, threshold: float) -> Flags:
        """Return (n,) where the finger is STABLE at a threshold."""
        return np.asarray(self.replay.states(self.decisions, threshold) == STABLE)

    def n_alarms(self, threshold: float) -> int:
        """Return the number of alarms: UNSTABLE between STABLE and STABLE.

        An alarm that ends with the release of the object is right in ordinary handling.
        """
        states = self.replay.states(self.decisions, threshold)
        spells = runs(states == UNSTABLE)
        inside = [(a, b) for a, b in spells if self.grasped[a] and a > 0 and b < len(states)]
        return sum(bool(states[a - 1] == states[b] == STABLE) for a, b in inside)

    def raised(self, threshold: float) -> Flags:
        """Return (n,) where a slip is reported at a threshold; nowhere without a slip rule."""
        slip = self.decisions.slip
        if slip is None:
            return np.zeros_like(self.grasped)
        return np.asarray(slip.raised_at(np.array([threshold]))[0])


@dataclass(frozen=True, eq=False)
class GraspingFingers:
    """All fingers of one sensor in own handling."""

    fingers: Sequence[GraspingFinger]

    @property
    def seconds(self) -> float:
        """Held time of the finger that holds longest [s]."""
        totals: dict[str, float] = {}
        for finger in self.fingers:
            totals[finger.name] = totals.get(finger.name, 0.0) + finger.seconds
        return max(totals.values(), default=0.0)

    def figures(self, part: FingerModel) -> HandlingFigures:
        """Return the figures at the thresholds of a model, which made the decisions."""
        stable = part.stable.threshold
        slip = None if part.slip is None else part.slip.threshold
        return HandlingFigures(
            threshold=stable,
            stable=100 * self.stable_share(stable),
            alarms_per_minute=self.alarms_per_minute(stable),
            slip_threshold=slip,
            raised=None if slip is None else 100 * self.raised_share(slip),
        )

    def stable_share(self, threshold: float) -> float:
        """Return the share of the held samples that are STABLE at a threshold."""
        return self._share(lambda finger: finger.stable(threshold))

    def stable_log_odds(self) -> Array:
        """Return the log odds of stability of the held samples."""
        return _log_odds([f.decisions.stable_probability[f.grasped] for f in self.fingers])

    def slip_log_odds(self) -> Array:
        """Return the log odds of a slip of the held samples; none without a slip rule."""
        slips = [(finger.decisions.slip, finger.grasped) for finger in self.fingers]
        return _log_odds([slip.probability[grasped] for slip, grasped in slips if slip is not None])

    def alarms_per_minute(self, threshold: float) -> float:
        """Return the number of alarms of all fingers per minute of held time."""
        n = sum(finger.n_alarms(threshold) for finger in self.fingers)
        return 60 * n / self.seconds

    def raised_share(self, threshold: float) -> float:
        """Return the share of the held samples in which a slip is reported at a threshold."""
        return self._share(lambda finger: finger.raised(threshold))

    def slips_per_minute(self, threshold: float) -> float:
        """Return the number of reported slips of all fingers per minute of held time."""
        n = sum(len(runs(finger.raised(threshold) & finger.grasped)) for finger in self.fingers)
        return 60 * n / self.seconds

    def _share(self, mask_of: Callable[[GraspingFinger], Flags]) -> float:
        n_grasped = sum(int(finger.grasped.sum()) for finger in self.fingers)
        n = sum(int((mask_of(finger) & finger.grasped).sum()) for finger in self.fingers)
        return n / max(n_grasped, 1)


def choose_operating_point(
    handling: GraspingFingers,
    part: FingerModel,
    false_alarms: float | None = None,
    *,
    moves: bool = False,
) -> Thresholds:
    """Choose the thresholds of a model on own handling.

    The threshold of stability is at most that of the model, the threshold of slips at least:
    handling that is still says nothing about motion, so it is no reason to alarm more. Handling
    in which the arm moves may raise the threshold of stability to `HIGHEST_THRESHOLD`. Up to there
    it is the most sensitive at which enough held samples are quiet: `STABLE_SHARE` of them STABLE,
    a slip reported in at most `RAISED_SHARE`, but not further than `MAX_DISTANCE`; or at which
    there are at most so many alarms of either kind.

    Args:
        handling: decided with its own location and scale.
        part: model of the fingers, with the thresholds of the model.
        false_alarms: maximum number of alarms a minute of held time; None for the shares.
        moves: whether the arm moves in the handling.

    Raises:
        TrainingError: no threshold gives so few alarms of a kind.
    """
    default = max(part.stable.threshold, HIGHEST_THRESHOLD if moves else 0.0)
    lowest = _probability_at(handling.stable_log_odds(), -MAX_DISTANCE)
    stable = HandlingCurve(
        [*THRESHOLDS[default > THRESHOLDS].tolist(), default],
        is_near=lambda t: t >= lowest,
        is_quiet=lambda t: handling.stable_share(t) >= STABLE_SHARE,
        alarms=handling.alarms_per_minute,
        kind="alarms",
    )
    chosen: Thresholds = {"stable": stable.choose(false_alarms)}
    if part.slip is not None:
        default = part.slip.threshold
        highest = _probability_at(handling.slip_log_odds(), MAX_DISTANCE)
        slip = HandlingCurve(
            [*THRESHOLDS[default < THRESHOLDS][::-1].tolist(), default],
            is_near=lambda t: t <= highest,
            is_quiet=lambda t: handling.raised_share(t) <= RAISED_SHARE,
            alarms=handling.slips_per_minute,
            kind="reported slips",
        )
        chosen["slip"] = slip.choose(false_alarms)
    return chosen


@dataclass(frozen=True)
class HandlingCurve:
    """What a head answers about own handling, at thresholds.

    Attributes:
        thresholds: from the quietest to the most sensitive.
        is_near: whether a threshold is near the probabilities of this handling.
        is_quiet: whether enough held samples are quiet at a threshold.
        alarms: number of alarms a minute at a threshold.
        kind: of the alarms.
    """

    thresholds: Sequence[float]
    is_near: Callable[[float], bool]
    is_quiet: Callable[[float], bool]
    alarms: Callable[[float], float]
    kind: str

    def choose(self, false_alarms: float | None) -> float:
        """Return the most sensitive threshold that is quiet, as all quieter ones are.

        Args:
            false_alarms: maximum number a minute; None for the share of quiet samples, of which
                the quietest near threshold falls short where none has it.

        Raises:
            TrainingError: no threshold gives so few alarms.
        """
        if false_alarms is None:
            near = [t for t in self.thresholds if self.is_near(t)] or [self.thresholds[-1]]
            return [near[0], *takewhile(self.is_quiet, near)][-1]
        # Up to the first that alarms too often: beyond it alarms may be fewer again, as a finger
        # that is never STABLE has none.
        quiet = list(takewhile(lambda t: self.alarms(t) <= false_alarms, self.thresholds))
        if not quiet:
            raise TrainingError(
                f"no threshold gives at most {false_alarms:g} {self.kind} a minute of this "
                f"handling; the least is {min(map(self.alarms, self.thresholds)):.2g}"
            )
        return quiet[-1]


def _log_odds(probabilities: Sequence[Array]) -> Array:
    """Return (n, 1) the log odds of probabilities, which may be 0 or 1."""
    bounded = np.clip(np.concatenate([np.empty(0), *probabilities]), 1e-12, 1 - 1e-12)
    return np.asarray(np.log(bounded / (1 - bounded)))[:, None]


def _probability_at(log_odds: Array, distance: float) -> float:
    """Return the probability at so many scales of log odds from their location."""
    location, scale = location_and_scale(log_odds)
    return float(1 / (1 + math.exp(-(location[0] + distance * scale[0]))))
