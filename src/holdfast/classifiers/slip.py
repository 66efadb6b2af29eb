"""Rule that decides whether a finger slides, from a smoothed probability, and how fast."""

import math

import msgspec
import numpy as np

from holdfast.classifiers.linear import LinearClassifier
from holdfast.compiled import compiled_step, joined_step
from holdfast.errors import ModelError
from holdfast.features import FeatureSpec
from holdfast.sensors.types import Array, Flags

MAX_SLIP_DURATION = 10.0
"""Maximum smoothing and hold time of a slip rule [s]."""
MAX_DEVIATION = 5.0
"""Squares are of values of at most this many standard deviations: a larger one is no stronger sign
of a slip, nor of a glitch."""


class SlipThresholds(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the threshold of a slip rule was chosen, and what it gave on those recordings.

    Attributes:
        requested: maximum number of false alarms per minute of all held time, of one finger.
        false_alarms_per_minute: that it gave, of held time.
        found: share of the slips found within 0.1 s of their onset [%]; None without slips.
        n_slips: number of slips of the fingers.
        held_minutes: held time of the fingers [min].
        recordings: content digest of each recording, by name; empty if they are those of the
            training.
    """

    requested: float
    false_alarms_per_minute: float
    found: float | None
    n_slips: int
    held_minutes: float
    recordings: dict[str, str] = {}


class SpeedRule(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Estimate of the speed of a finger that slides, from the features of its slip rule.

    The speed is v = min(max(z, 0)^2, highest) [mm/s], with the standardised features
    u_j = (phi_j - mean_j) / scale_j and

        z = intercept + sum_j coefficients_j u_j + sum_j squares_j min(|u_j|, 5)^2

    Attributes:
        mean: of each feature, over the sliding samples of the training.
        scale: standard deviation of each feature there.
        coefficients: of the standardised features.
        squares: coefficients of their squares.
        intercept: of z.
        highest: no speed is above that of the training [mm/s].

    Raises:
        ModelError: lengths differ, or a number is not finite or out of range.
    """

    mean: tuple[float, ...]
    scale: tuple[float, ...]
    coefficients: tuple[float, ...]
    squares: tuple[float, ...]
    intercept: float
    highest: float

    def __post_init__(self) -> None:
        columns = (self.mean, self.scale, self.coefficients, self.squares)
        if len(set(map(len, columns))) != 1:
            given = ", ".join(str(len(column)) for column in columns)
            raise ModelError(
                f"{given} means, scales, coefficients and squares of the slip speed given; the "
                "same number of each expected"
            )
        if min((*self.scale, self.highest)) <= 0:
            raise ModelError("scales and a highest slip speed above 0 expected")
        with np.errstate(over="ignore", invalid="ignore"):
            numbers = (*self.weights(), *self.square_weights().ravel(), self.highest)
        if not np.isfinite(numbers).all():
            raise ModelError("a number of the slip speed is not finite")

    @property
    def n_features(self) -> int:
        """Number of features of its input."""
        return len(self.mean)

    def weights(self) -> Array:
        """Return the weights of z: first the offset, then one weight for each raw feature."""
        folded = np.array(self.coefficients) / np.array(self.scale)
        return np.append(self.intercept - float(folded @ np.array(self.mean)), folded)

    def square_weights(self) -> Array:
        """Return (3, n_features) mean, 1 / scale and weight of the squares."""
        return np.array([self.mean, 1.0 / np.array(self.scale), self.squares])


class SlipRule(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Decision whether a finger slides, from features of its own or of the classifier of stability.

    The log odds z(k) of the classifier are smoothed over time, with the period T of the samples:

        s(k) = s(k-1) + (1 - exp(-T / smoothing)) (z(k) - s(k-1))

    With squares q_j, slope sum_j q_j min(|u_j|, 5)^2 is added to z, of the standardised features
    u_j = (phi_j - mean_j) / scale_j: a moderate jolt of the taxels is a slip, a huge one a glitch.

    The probability of a slip is 1 / (1 + exp(-s)). The finger slides from the threshold of the
    classifier on, and for the hold time after that. Compare the probability with the threshold
    only: it is not calibrated where the rule was trained on some of the samples.

    Attributes:
        classifier: maps features to a probability that the finger slides, with the threshold.
        smoothing: time constant [s]; 0 for none.
        hold: time for which a slip is still reported [s].
        thresholds: how the threshold was chosen; None if it was given.
        features: input of the classifier; those of the classifier of stability if there are none.
        squares: coefficients of the squares of the standardised features, if there are any.
        speed: how fast the finger slides, if it is estimated.

    Raises:
        ModelError: a duration is out of range, or the fields contradict each other.
    """

    classifier: LinearClassifier
    smoothing: float = 0.0
    hold: float = 0.0
    thresholds: SlipThresholds | None = None
    features: tuple[FeatureSpec, ...] | msgspec.UnsetType = msgspec.UNSET
    squares: tuple[float, ...] | msgspec.UnsetType = msgspec.UNSET
    speed: SpeedRule | msgspec.UnsetType = msgspec.UNSET

    def __post_init__(self) -> None:
        for name, seconds in (("smoothing", self.smoothing), ("hold", self.hold)):
            if not 0 <= seconds <= MAX_SLIP_DURATION:
                raise ModelError(
                    f"a {name} of slips from 0 to {MAX_SLIP_DURATION:g} s expected, {seconds} given"
                )
        expected = self.classifier.n_features
        for name in ("features", "squares"):
            values = getattr(self, name)
            if values is not msgspec.UNSET and len(values) != expected:
                raise ModelError(f"{len(values)} {name} given, the slip rule expects {expected}")
        if self.features is not msgspec.UNSET and len(set(self.features)) < expected:
            raise ModelError("a feature of the slip rule is given twice")
        if self.squares is not msgspec.UNSET and self.features is msgspec.UNSET:
            raise ModelError("squares given without features; a slip rule with both expected")
        if self.speed is not msgspec.UNSET and self.speed.n_features != expected:
            raise ModelError(
                f"{self.speed.n_features} features of the slip speed given, the slip rule expects "
                f"{expected}"
            )
        with np.errstate(over="ignore", invalid="ignore"):
            is_finite = np.isfinite(self.square_weights()).all()
        if not is_finite:
            raise ModelError("a number of the squares is not finite")

    def used_features(self, others: tuple[FeatureSpec, ...]) -> tuple[FeatureSpec, ...]:
        """Return the features of the rule, which are the others without a list of its own."""
        return others if self.features is msgspec.UNSET else self.features

    def square_weights(self) -> Array:
        """Return (3, n_features) mean, 1 / scale and weight of the squares; zeros without them."""
        linear = self.classifier
        if self.squares is msgspec.UNSET:
            return np.zeros((3, linear.n_features))
        weights = linear.slope * np.array(self.squares)
        return np.array([linear.mean, 1.0 / np.array(linear.scale), weights])

    def gain(self, rate: float) -> float:
        """Return the share of a new sample in the smoothed log odds at a rate [Hz]."""
        return 1.0 if self.smoothing == 0 else -math.expm1(-1.0 / (rate * self.smoothing))


@joined_step
def add_squares(value: float, features: Array, squares: Array) -> float:
    """Return log odds with the squares of standardised features.

    Args:
        value: log odds without them.
        features: (n_features,) or more.
        squares: (3, n_features) as of `square_weights` of a rule.
    """
    # z + sum_j q_j min(|u_j|, 5)^2, u_j = (phi_j - mean_j) / scale_j.
    for j in range(squares.shape[1]):
        deviation = abs((features[j] - squares[0, j]) * squares[1, j])
        deviation = min(deviation, MAX_DEVIATION)
        value += squares[2, j] * (deviation * deviation)
    return value


@compiled_step
def smooth(smoothed: float, value: float, gain: float) -> float:
    """Return the smoothed value after a new one; the first value starts it."""
    return value if math.isnan(smoothed) else smoothed + gain * (value - smoothed)


@compiled_step
def probability_of(log_odds: float) -> float:
    """Return 1 / (1 + exp(-log odds))."""
    return 1.0 / (1.0 + math.exp(-log_odds))


@compiled_step
def speed_of(value: float, highest: float) -> float:
    """Return the speed of a slip from z, see `SpeedRule`, both up to the highest [mm/s]."""
    root = max(value, 0.0)
    return min(root * root, highest)


def raised_at(times: Array, probability: Array, threshold: float, hold: float) -> Flags:
    """Return where a slip is reported, from its probability: the rule of the detector.

    Args:
        times: (n,) [s].
        probability: (n,) smoothed; NaN and 0 end a slip at once.
        threshold: from which the finger slides.
        hold: time for which it is still reported [s].

    Returns:
        (n,) True where the finger is reported to slide.
    """
    return np.asarray(raised_at_each(times, probability, np.array([threshold]), hold)[0])


def raised_at_each(times: Array, probability: Array, thresholds: Array, hold: float) -> Flags:
    """Return where a slip is reported at each threshold, (n_thresholds, n), as `raised_at`."""
    with np.errstate(invalid="ignore"):
        ended = ~(probability > 0)
        over = probability >= thresholds[:, None]
    end = np.maximum.accumulate(np.where(ended, times, -np.inf))
    last = np.maximum.accumulate(np.where(over, times, -np.inf), axis=1)
    period = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    held = (times - last + 0.5 * period < hold) & (last > end)
    return np.asarray((over | held) & ~ended)
