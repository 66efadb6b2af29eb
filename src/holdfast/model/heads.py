"""Heads: the answers of a model about a finger, each from a rule over its features."""

import math
from typing import Literal

import msgspec

from holdfast.classifiers import Linear
from holdfast.contact import Cause
from holdfast.errors import ModelError
from holdfast.features import FeatureSpec
from holdfast.sensors.types import Array

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
