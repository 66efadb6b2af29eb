"""The model of a finger: heads, each an answer from a rule over features, contact, debouncing."""

import math
from typing import Literal, Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import Cause
from holdfast.detection.specs import FeatureSpec
from holdfast.errors import ModelError
from holdfast.kernel import _extension
from holdfast.sensors.types import Array, Integers


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


HeadName = Literal["stable", "slip", "slip_speed", "cause", "slip_changes"]
Link = Literal["logit", "square", "softmax"]
LINKS: dict[HeadName, Link] = {
    "stable": "logit",
    "slip": "logit",
    "slip_speed": "square",
    "cause": "softmax",
    "slip_changes": "logit",
}
"""Link of each head, in the order of the heads of a finger."""
HEAD_NAMES = tuple(LINKS)
KERNEL_HEADS = HEAD_NAMES[:4]
"""Heads that decide about a finger; `slip_changes` takes the place of `slip`, or nothing."""
MAX_WINDOW = 1 << 16
"""Maximum length of a window [samples]."""
MAX_FEATURES = 1024
"""Maximum number of features of a finger."""
MAX_FINGERS = 256
"""Maximum number of fingers, and of sensors, in a model."""
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
        name: what it answers: `stable`, `slip` (the finger slides), `slip_speed`, `cause`; or
            `slip_changes`, the head `slip` of a stream that begins in contact.
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
        slip_scores: quantiles, evenly spaced from 0 to 1, over slips of the training that were left
            out of it, of the highest smoothed z of each before it slid 1 mm.

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
    slip_scores: tuple[float, ...] | msgspec.UnsetType = msgspec.UNSET

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
            most = MAX_HEAD_DURATION if self.name in ("slip", "slip_changes") else 0.0
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

    def share_found(self, threshold: float) -> float | None:
        """Return the share of the training's slips that a threshold finds; None if not known."""
        if self.slip_scores is msgspec.UNSET or not self.slip_scores:
            return None
        limit = math.log(threshold / (1 - threshold)) if 0 < threshold < 1 else math.inf
        return sum(score >= limit for score in self.slip_scores) / len(self.slip_scores)

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


class Handling(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Own handling: what the features of a sensor are while its user holds objects, without slip.

    Attributes:
        location: of each feature of the head `stable`.
        scale: of each of them, above 0.
        seconds: held time of one finger on which it rests [s].
        thresholds: by the name of the head; other heads keep that of the model.
        recordings: content digest of each recording, by name.

    Raises:
        ModelError: lengths differ, a number is not finite, a scale or the time is not above 0, or
            a threshold is not from 0 to 1.
    """

    location: tuple[float, ...]
    scale: tuple[float, ...]
    seconds: float
    thresholds: dict[HeadName, float] = {}
    recordings: dict[str, str] = {}

    def __post_init__(self) -> None:
        if len(self.location) != len(self.scale):
            raise ModelError(
                f"{len(self.location)} locations and {len(self.scale)} scales of own handling "
                "given; the same number of both expected"
            )
        # Finite first: a comparison with NaN is False, so that the next check would pass it.
        if not all(math.isfinite(x) for x in (*self.location, *self.scale, self.seconds)):
            raise ModelError("a number of the own handling is not finite")
        if min((*self.scale, self.seconds)) <= 0:
            raise ModelError("scales and held time above 0 expected for own handling")
        for threshold in self.thresholds.values():
            if not 0 <= threshold <= 1:
                raise ModelError(f"a threshold from 0 to 1 expected, {threshold} given")


class FingerModel(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Model of one finger: its heads, its rule of contact, and own handling.

    Attributes:
        heads: at most one of each name; `stable` is required, and `slip` for `slip_speed`.
        sensor: name of the sensor of the training; None for any sensor.
        contact_threshold: F_a below it is no contact [unit of the readings]; None for none.
        contact_noise: the same as a multiple of the noise during the tare, used if
            `contact_threshold` is None.
        contact_load: threshold of contact on the load, as a multiple of the noise of the stream,
            for relative features; used instead of the others if it is given.
        normalised: `stable` works on features that are normalised by own handling. Its means and
            scales are then those of default handling; `for_sensor` replaces them.
        handling: own handling by the name of the sensor, of a model that is normalised.

    Raises:
        ModelError: the fields contradict each other.
    """

    heads: tuple[Head, ...]
    sensor: str | None = None
    contact_threshold: float | None = None
    contact_noise: float | None = None
    contact_load: float | None = None
    normalised: bool = False
    handling: dict[str, Handling] = {}

    def __post_init__(self) -> None:
        names = [head.name for head in self.heads]
        if len(set(names)) < len(names):
            raise ModelError(f"one head of each name expected, {', '.join(names)} given")
        if "stable" not in names or ("slip_speed" in names and "slip" not in names):
            raise ModelError(
                f"a head stable, and slip for slip_speed, expected; {', '.join(names)} given"
            )
        features = self.features
        check_limit("features of a finger", len(features), MAX_FEATURES)
        check_limit("samples in a window", max((x.window for x in features), default=0), MAX_WINDOW)
        # Only relative features have a load; the six features of the paper are not relative.
        if self.contact_load is not None and not any(x.seconds for x in self.stable.features):
            raise ModelError("contact_load given; it needs at least one relative feature")
        for value in (self.contact_threshold, self.contact_noise, self.contact_load):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise ModelError(f"a contact threshold of at least 0 expected, {value} given")
        self._check_handling()

    def _check_handling(self) -> None:
        if self.handling and not self.normalised:
            raise ModelError("own handling given; it needs a model with normalised features")
        check_limit("sensors with own handling", len(self.handling), MAX_FINGERS)
        n_features = len(self.stable.features)
        for name, handling in self.handling.items():
            if len(handling.location) != n_features:
                raise ModelError(
                    f"own handling of {len(handling.location)} features given for {name!r}, "
                    f"{n_features} expected"
                )
            for head in handling.thresholds:
                if self.head(head) is None:
                    raise ModelError(f"a threshold of {head} given for {name!r}; no such head")

    def head(self, name: HeadName) -> Head | None:
        """Return the head with a name; None if there is none."""
        return next((head for head in self.heads if head.name == name), None)

    @property
    def stable(self) -> Head:
        """The head of stability."""
        return next(head for head in self.heads if head.name == "stable")

    @property
    def slip(self) -> Head | None:
        """The head that decides whether the finger slides; None if there is none."""
        return self.head("slip")

    @property
    def features(self) -> tuple[FeatureSpec, ...]:
        """Features of all heads: first those of `stable`, then further ones of other heads."""
        # By the name of the head: a model file may list them in any order.
        ordered = sorted(self.heads, key=lambda head: HEAD_NAMES.index(head.name))
        return tuple(dict.fromkeys(spec for head in ordered for spec in head.features))

    def indices(self, head: Head) -> Integers:
        """Return the index of each feature of a head in the list of the finger's features."""
        features = self.features
        return np.array([features.index(spec) for spec in head.features], dtype=np.int64)

    def with_heads(self, *heads: Head) -> "FingerModel":
        """Return the model with heads added; they replace heads of the same names."""
        by_name = {head.name: head for head in (*self.heads, *heads)}
        return msgspec.structs.replace(self, heads=tuple(by_name.values()))

    def without_heads(self, *names: HeadName) -> "FingerModel":
        """Return the model without some heads."""
        heads = tuple(head for head in self.heads if head.name not in names)
        return msgspec.structs.replace(self, heads=heads)

    def deciding(self, name: HeadName, *, zero_unknown: bool) -> Head | None:
        """Return the head that answers a question; None if there is none.

        Where the readings without contact are not known, `slip_changes` takes the place of `slip`.
        """
        changes = self.head("slip_changes") if zero_unknown and name == "slip" else None
        return self.head(name) if changes is None else changes

    @property
    def default_handling(self) -> tuple[Array, Array]:
        """Location and scale of the features of `stable` without own handling."""
        return self.stable.rule.moments

    def for_sensor(self, sensor_name: str) -> "FingerModel":
        """Return the model with the own handling of a sensor, if it has any, in its heads."""
        handling = self.handling.get(sensor_name)
        return self if handling is None else self.with_handling(handling)

    def with_handling(self, handling: Handling) -> "FingerModel":
        """Return the model with own handling in its heads.

        With location l_j and scale s_j of the sensor, u_j = (phi_j - l_j) / s_j takes the place of
        (phi_j - mean_j) / scale_j in `stable`. Means and scales of `cause` are of unstable samples,
        so they move as the default handling does. Heads of slips read the features as they are:
        own handling sets their thresholds alone.
        """
        before, after = self.default_handling, np.array((handling.location, handling.scale))
        heads = []
        for head in self.heads:
            moments = head.rule.moments
            if head.name == "stable":
                moments = after[0], after[1]
            elif head.name == "cause":  # the shift and stretch of the handling
                moments = self._moved(head, before, after)
            threshold = handling.thresholds.get(head.name, head.threshold)
            heads.append(head.normalised_by(*moments).at(threshold, head.choice))
        return msgspec.structs.replace(self, heads=tuple(heads), handling={})

    def _moved(self, head: Head, before: tuple[Array, Array], after: Array) -> tuple[Array, Array]:
        """Return mean and scale of a head, moved with those features that `stable` has, too."""
        mean, scale = head.rule.moments
        columns, n = self.indices(head), len(before[0])
        is_stable = columns < n  # the features of `stable` are the first
        ratio = after[1][columns[is_stable]] / before[1][columns[is_stable]]
        mean[is_stable] = after[0][columns[is_stable]] + ratio * (
            mean[is_stable] - before[0][columns[is_stable]]
        )
        scale[is_stable] *= ratio
        return mean, scale

    def without_thresholds(self, name: HeadName) -> "FingerModel":
        """Return the model whose own handling does not set the threshold of a head."""
        replace = msgspec.structs.replace
        handling = {
            sensor: replace(x, thresholds={k: t for k, t in x.thresholds.items() if k != name})
            for sensor, x in self.handling.items()
        }
        return replace(self, handling=handling)


class Debounce(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Debouncing of state changes. By default, and for the paper's figures, there is none.

    Attributes:
        min_duration: time that a new state must last before it is reported [s].
        hysteresis: distance past its threshold that a probability needs to change the state.
        hold: time for which UNSTABLE is still reported after the last unstable sample, while
            the finger is in contact, so that one disturbance is one alarm [s].
        switching: of the forward filter of the probability: how often a contact turns from stable
            to unstable, or back [1/s]; 0 or unset for no filter. 15.3 is a probability of 0.8 to
            stay as it is for 1/60 s.

    Raises:
        ModelError: a value is out of range.

    Example:
        >>> round(Debounce(switching=15.3).stay(1 / 60), 2)
        0.8
    """

    min_duration: float = 0.0
    hysteresis: float = 0.0
    hold: float = 0.0
    # Unset, not 0: models without a filter keep the digest that they had before there was one.
    switching: float | msgspec.UnsetType = msgspec.UNSET

    def __post_init__(self) -> None:
        # Finite and not below 0: NaN passes no comparison.
        rate = self.switching_rate
        if not (math.isfinite(rate) and rate >= 0):
            raise ModelError(f"a switching of at least 0 per second expected, {rate} given")
        for seconds in (self.min_duration, self.hold):
            if not (math.isfinite(seconds) and seconds >= 0):
                raise ModelError(f"a duration of at least 0 s expected, {seconds} given")
        if not 0 <= self.hysteresis < 1:
            raise ModelError(f"a hysteresis from 0 to 1 expected, {self.hysteresis} given")

    @property
    def switching_rate(self) -> float:
        """The rate of switching [1/s]; 0 if there is no filter."""
        return 0.0 if self.switching is msgspec.UNSET else float(self.switching)

    def stay(self, seconds: float) -> float:
        """Return the probability that a contact is in the same state after some time [s]."""
        return 0.5 * (1.0 + math.exp(-2.0 * self.switching_rate * seconds))


def check_limit(what: str, value: float, most: float) -> None:
    """Refuse a number of things above a limit.

    Raises:
        ModelError: it is above the limit.
    """
    if value > most:
        raise ModelError(f"at most {most:.7g} {what} expected, {value} given")
