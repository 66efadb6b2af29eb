"""Heads: the answers of a model about a finger, each from a rule over its features."""

import math
from typing import Literal, Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import Cause
from holdfast.detection.specs import FeatureSpec
from holdfast.errors import ModelError
from holdfast.kernel import _extension
from holdfast.sensors.types import Array


class Linear(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="linear"):
    """Linear function of standardised features, with one value for each output.

    With the standardised features u_j = (phi_j - mean_j) / scale_j, output k has the value

        z_k = slope (intercept_k + sum_j weight_kj u_j + sum_j square_kj min(|u_j|, 5)^2) + offset

    A moderate jolt of the taxels is a slip, a huge one a glitch: so the squares are bounded.

    Attributes:
        mean: of each feature in training.
        scale: standard deviation of each feature in training.
        weights: of the standardised features, one row for each output.
        intercepts: one for each output.
        squares: weights of the squares, one row for each output; empty for none.
        slope: of the calibration of z.
        offset: of the calibration of z.

    Raises:
        ModelError: lengths differ, a number is not finite, a scale or the slope is not above 0, or
            the weights overflow.
    """

    mean: tuple[float, ...]
    scale: tuple[float, ...]
    weights: tuple[tuple[float, ...], ...]
    intercepts: tuple[float, ...]
    squares: tuple[tuple[float, ...], ...] = ()
    slope: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        rows = (self.mean, self.scale, *self.weights, *self.squares)
        if len(set(map(len, rows))) != 1:
            widths = ", ".join(str(len(row)) for row in rows)
            raise ModelError(
                f"means, scales and rows of weights and squares of {widths} features given; the "
                "same number of each expected"
            )
        heights = {len(self.weights), len(self.intercepts), len(self.squares or self.weights)}
        if len(heights) != 1 or 0 in heights:
            raise ModelError(
                f"{len(self.weights)} rows of weights, {len(self.intercepts)} intercepts and "
                f"{len(self.squares)} rows of squares given; one of each for every output expected"
            )
        if min((*self.scale, self.slope)) <= 0:
            raise ModelError("scales and slope above 0 expected")
        with np.errstate(over="ignore", invalid="ignore"):
            numbers = (*self.mean, *self.raw_weights().ravel(), *self.raw_squares().ravel())
        if not np.isfinite(numbers).all():
            raise ModelError("a number of the weights is not finite, or a scale is too small")

    @classmethod
    def of(
        cls,
        mean: Array,
        scale: Array,
        weights: Array,
        intercepts: npt.ArrayLike,
        squares: Array | None = None,
        **calibration: float,
    ) -> Self:
        """Return the function of arrays; `weights` and `squares` of one output may be (n,)."""
        rows = () if squares is None else np.atleast_2d(squares).tolist()
        return cls(
            tuple(mean.tolist()),
            tuple(scale.tolist()),
            tuple(map(tuple, np.atleast_2d(weights).tolist())),
            tuple(np.atleast_1d(intercepts).tolist()),
            tuple(map(tuple, rows)),
            **calibration,
        )

    @property
    def n_features(self) -> int:
        """Number of features of its input."""
        return len(self.mean)

    @property
    def n_outputs(self) -> int:
        """Number of values that it returns."""
        return len(self.intercepts)

    @property
    def moments(self) -> tuple[Array, Array]:
        """Mean and scale of each feature, (n_features,) each."""
        return np.array(self.mean), np.array(self.scale)

    def raw_weights(self) -> Array:
        """Return (n_outputs, n_features + 1) the offset, then the weights of the raw features.

        They contain the scale and the calibration: z = w_0 + sum_j w_j phi_j, without squares.
        """
        folded = np.array(self.weights) / np.array(self.scale)
        shifts = [float(row @ np.array(self.mean)) for row in folded]
        offsets = self.slope * (np.array(self.intercepts) - shifts) + self.offset
        return np.column_stack([offsets, self.slope * folded])

    def raw_squares(self) -> Array:
        """Return (3, n_features) mean, 1 / scale and weight of the squares of the first output."""
        squares = np.array(self.squares[0]) if self.squares else np.zeros(self.n_features)
        return np.array([self.mean, 1.0 / np.array(self.scale), self.slope * squares])

    def decision(self, features: npt.ArrayLike) -> Array:
        """Return the first output of each row before calibration, without squares.

        Raises:
            ValueError: the number of features is not `n_features`.
        """
        rows = feature_rows(features, self.n_features)
        standardised = (rows - np.array(self.mean)) / np.array(self.scale)
        return np.asarray(standardised @ np.array(self.weights[0]) + self.intercepts[0])

    def probability(self, features: npt.ArrayLike) -> Array:
        """Return 1 / (1 + exp(-z)) of each row of (n, n_features), without squares.

        It is NaN if the row has NaN.

        Raises:
            ValueError: the number of features is not `n_features`.
        """
        rows, (offset, *weights) = feature_rows(features, self.n_features), self.raw_weights()[0]
        z = np.full(len(rows), offset)
        for weight, column in zip(weights, rows.T, strict=True):
            z += weight * column  # one feature after the other: the bits of the detector
        _extension.logistic(z)
        return z


def feature_rows(features: npt.ArrayLike, n_features: int) -> Array:
    """Return the features as contiguous (n, n_features) float64.

    Raises:
        ValueError: the number of features is not `n_features`.
    """
    rows = np.ascontiguousarray(features, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != n_features:
        raise ValueError(f"features of shape (n, {n_features}) expected, {rows.shape} given")
    return rows


HeadName = Literal["stable", "slip", "slip_speed", "cause"]
Link = Literal["logit", "square", "softmax"]
LINKS: dict[HeadName, Link] = {
    "stable": "logit",
    "slip": "logit",
    "slip_speed": "square",
    "cause": "softmax",
}
"""Link of each head, in the order of the heads of a finger."""
HEAD_NAMES = tuple(LINKS)
MAX_HEAD_DURATION = 10.0
"""Maximum smoothing and hold time of a head [s]."""


class ThresholdPoint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Errors at one threshold.

    Attributes:
        threshold: of the probability.
        false_alarms_per_minute: of the time that counts.
        missed: share of the events without an alarm in time [%]; None without events.
    """

    threshold: float
    false_alarms_per_minute: float
    missed: float | None


class Choice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the threshold of a head was chosen, and what it gave where it was counted.

    Attributes:
        requested: maximum number of false alarms per minute of the time that counts: for `stable`,
            that in which the hand is labelled stable; for `slip`, all held time of one finger.
        false_alarms_per_minute: that the threshold gave.
        found: share of the events (onsets of instability of the hand, or slips of the fingers) with
            an alarm in time [%]: within 0.2 s for `stable`, 0.1 s for `slip`; None without events.
        n: number of events.
        minutes: duration of the time that counts [min].
        recordings: content digest of each recording, by name; empty if they are those of the
            training, out of fold.
        points: errors at the thresholds that were tried, lowest first.
    """

    requested: float
    false_alarms_per_minute: float
    found: float | None
    n: int
    minutes: float
    recordings: dict[str, str] = {}
    points: tuple[ThresholdPoint, ...] = ()


class Head(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One answer about a finger.

    The link makes the answer from the values z of the rule:

    - `logit`: the probability p = 1 / (1 + exp(-z)); the answer is yes from the threshold on. With
      a smoothing time, z is first smoothed over samples of the period T:
      s(k) = s(k-1) + (1 - exp(-T / smoothing)) (z(k) - s(k-1)).
    - `square`: the value min(max(z, 0)^2, highest), here the speed of a slip [mm/s].
    - `softmax`: the class with the largest sum of z since the contact became unstable.

    The probability of a slip is not calibrated where the head was trained on some of the samples:
    compare it with the threshold only.

    Attributes:
        name: what it answers: `stable`, `slip` (the finger slides), `slip_speed` or `cause`.
        link: `logit`, `square` or `softmax`.
        features: input of the rule, in its order.
        rule: maps features to z.
        threshold: of the probability, for the link `logit`. One of 1 never reports a slip: the
            probability is only a ranking then.
        smoothing: time constant of z [s]; 0 for none.
        hold: time for which a slip is still reported [s].
        classes: causes of the outputs of the rule, for the link `softmax`.
        highest: largest value, for the link `square` alone: that of the training.
        choice: how the threshold was chosen; None if it was given.

    Raises:
        ModelError: a field is out of range, or the fields contradict each other.
    """

    name: HeadName
    link: Link
    features: tuple[FeatureSpec, ...]
    rule: Linear
    threshold: float = 0.5
    smoothing: float = 0.0
    hold: float = 0.0
    classes: tuple[Cause, ...] = ()
    highest: float | None = None
    choice: Choice | None = None

    def __post_init__(self) -> None:
        if self.name not in LINKS:
            raise ModelError(f"a head of {', '.join(LINKS)} expected, {self.name} given")
        # It follows from the name: a file that says otherwise was made for something else.
        if self.link != LINKS[self.name]:
            raise ModelError(
                f"{self.name}: the link {LINKS[self.name]} expected, {self.link} given"
            )
        if len(self.features) != self.rule.n_features:
            raise ModelError(
                f"{self.name}: {len(self.features)} features given, the rule expects "
                f"{self.rule.n_features}"
            )
        if len(set(self.features)) < len(self.features):
            raise ModelError(f"{self.name}: a feature is given twice")
        self._check_rule()
        if not 0 <= self.threshold <= 1:
            raise ModelError(
                f"{self.name}: a threshold from 0 to 1 expected, {self.threshold} given"
            )
        if self.link != "square":
            if self.highest is not None:
                raise ModelError(f"{self.name}: no highest value expected, {self.highest} given")
        elif self.highest is None or not 0 < self.highest < math.inf:
            raise ModelError(
                f"{self.name}: a finite highest value above 0 expected, {self.highest} given"
            )
        for field in ("smoothing", "hold"):
            seconds = getattr(self, field)
            # Only slips have them: stability has its own filter and debouncing.
            most = MAX_HEAD_DURATION if self.name == "slip" else 0.0
            if not 0 <= seconds <= most:
                raise ModelError(
                    f"{self.name}: a {field} from 0 to {most:g} s expected, {seconds} given"
                )

    def _check_rule(self) -> None:
        n_classes = len(self.classes)
        if self.link == "softmax":
            if len(set(self.classes)) < max(n_classes, 2):
                raise ModelError(
                    f"{self.name}: two or more different causes expected, "
                    f"{', '.join(self.classes) or 'none'} given"
                )
        elif self.classes:
            raise ModelError(f"{self.name}: no classes expected, {n_classes} given")
        n_outputs = max(n_classes, 1)
        if self.rule.n_outputs != n_outputs:
            raise ModelError(
                f"{self.name}: a rule of {n_outputs} output{'s' * (n_outputs > 1)} expected, "
                f"{self.rule.n_outputs} given"
            )
        if self.rule.squares and self.name not in ("slip", "slip_speed"):
            raise ModelError(f"{self.name}: a rule without squares expected")

    def gain(self, rate: float) -> float:
        """Return the share of a new sample in the smoothed z at a rate [Hz]."""
        return 1.0 if self.smoothing == 0 else -math.expm1(-1.0 / (rate * self.smoothing))

    def at(self, threshold: float, choice: Choice | None = None) -> "Head":
        """Return the head with another threshold."""
        return msgspec.structs.replace(self, threshold=threshold, choice=choice)

    def normalised_by(self, location: Array, scale: Array) -> "Head":
        """Return the head with another location and scale of each feature in its rule."""
        rule = msgspec.structs.replace(
            self.rule, mean=tuple(location.tolist()), scale=tuple(scale.tolist())
        )
        return msgspec.structs.replace(self, rule=rule)
