"""Parts of a model: finger, debouncing, provenance and tuning, as plain validated data."""

import math
from collections.abc import Mapping
from typing import Literal

import msgspec
import numpy as np

from holdfast.classifiers import LinearClassifier, ModelClassifier
from holdfast.classifiers.cause import CauseClassifier
from holdfast.classifiers.slip import SlipRule
from holdfast.errors import ModelError
from holdfast.features import FeatureSpec
from holdfast.sensors.types import Array

MAX_WINDOW = 1 << 16
"""Maximum length of a window [samples]."""
MAX_FEATURES = 1024
"""Maximum number of features of a finger."""
MAX_FINGERS = 256
"""Maximum number of fingers, and of sensors, in a model."""
MAX_TAXELS = 4096
"""Maximum number of taxels of a sensor in a model."""


class Handling(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Own handling: what the features of a sensor are while its user holds objects, without slip.

    Attributes:
        location: of each feature of `FingerModel.all_features`.
        scale: of each of them, above 0.
        seconds: held time of one finger on which it rests [s].
        threshold: probability of stability from which a contact is stable; None for the model's.
        slip_threshold: probability from which a finger slides; None for the model's.
        recordings: content digest of each recording, by name.

    Raises:
        ModelError: lengths differ, a number is not finite, a scale or the time is not above 0, or
            a threshold is not from 0 to 1.
    """

    location: tuple[float, ...]
    scale: tuple[float, ...]
    seconds: float
    threshold: float | None = None
    slip_threshold: float | None = None
    recordings: dict[str, str] = {}

    def __post_init__(self) -> None:
        if len(self.location) != len(self.scale):
            raise ModelError(
                f"{len(self.location)} locations and {len(self.scale)} scales of own handling "
                "given; the same number of both expected"
            )
        if not all(math.isfinite(x) for x in (*self.location, *self.scale, self.seconds)):
            raise ModelError("a number of the own handling is not finite")
        if min((*self.scale, self.seconds)) <= 0:
            raise ModelError("scales and held time above 0 expected for own handling")
        for threshold in (self.threshold, self.slip_threshold):
            if threshold is not None and not 0 <= threshold <= 1:
                raise ModelError(f"a threshold from 0 to 1 expected, {threshold} given")


class FingerModel(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Model of one finger.

    Attributes:
        features: input of the classifier, in its order.
        classifier: maps features to a probability of stability.
        sensor: name of the sensor of the training; None for any sensor.
        contact_threshold: F_a below it is no contact [unit of the readings]; None for none.
        contact_noise: the same as a multiple of the noise during the tare, used if
            `contact_threshold` is None.
        contact_load: threshold of contact on the load, as a multiple of the noise of the stream,
            for relative features; used instead of the others if it is given.
        causes: tells the causes of an unstable contact apart; None for none.
        slip: decides whether the finger slides, from the same features or its own; None for none.
        normalised: the classifiers work on features that are normalised by own handling. Mean and
            scale of `classifier`, and of the features that only `slip` has, are then those of
            default handling; `for_sensor` replaces them.
        handling: own handling by the name of the sensor, of a model that is normalised.

    Raises:
        ModelError: the fields contradict each other.
    """

    features: tuple[FeatureSpec, ...]
    classifier: ModelClassifier
    sensor: str | None = None
    contact_threshold: float | None = None
    contact_noise: float | None = None
    contact_load: float | None = None
    causes: CauseClassifier | None = None
    slip: SlipRule | None = None
    normalised: bool | msgspec.UnsetType = msgspec.UNSET
    handling: dict[str, Handling] | msgspec.UnsetType = msgspec.UNSET

    def __post_init__(self) -> None:
        if self.causes is not None and self.causes.n_features != len(self.features):
            raise ModelError(
                f"{len(self.features)} features given, the causes expect {self.causes.n_features}"
            )
        n_slip = 0 if self.slip is None else len(self.slip.used_features(self.features))
        if self.slip is not None and self.slip.classifier.n_features != n_slip:
            raise ModelError(
                f"{n_slip} features given, the slip rule expects {self.slip.classifier.n_features}"
            )
        features = self.all_features
        check_limit("features of a finger", len(features), MAX_FEATURES)
        longest = max((spec.window for spec in features), default=0)
        check_limit("samples in a window", longest, MAX_WINDOW)
        if self.contact_load is not None and not any(spec.seconds for spec in self.features):
            raise ModelError("contact_load given; it needs at least one relative feature")
        if len(self.features) != self.classifier.n_features:
            raise ModelError(
                f"{len(self.features)} features given, the classifier expects "
                f"{self.classifier.n_features}"
            )
        for value in (self.contact_threshold, self.contact_noise, self.contact_load):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise ModelError(f"a contact threshold of at least 0 expected, {value} given")
        self._check_handling()

    def _check_handling(self) -> None:
        if self.normalised and not isinstance(self.classifier, LinearClassifier):
            raise ModelError("a linear classifier expected where features are normalised")
        if self.own_handling and not self.normalised:
            raise ModelError("own handling given; it needs a model with normalised features")
        check_limit("sensors with own handling", len(self.own_handling), MAX_FINGERS)
        n_features = len(self.all_features)
        for name, handling in self.own_handling.items():
            if len(handling.location) != n_features:
                raise ModelError(
                    f"own handling of {len(handling.location)} features given for {name!r}, "
                    f"{n_features} expected"
                )
            if handling.slip_threshold is not None and self.slip is None:
                raise ModelError(f"a slip threshold given for {name!r}; there is no slip rule")

    @property
    def own_handling(self) -> Mapping[str, Handling]:
        """Own handling by the name of the sensor; empty if there is none."""
        return {} if self.handling is msgspec.UNSET else self.handling

    @property
    def default_handling(self) -> tuple[Array, Array]:
        """Location and scale of `all_features` without own handling, of a linear classifier."""
        values: dict[FeatureSpec, tuple[float, float]] = {}
        if self.slip is not None:
            rule, features = self.slip.classifier, self.slip.used_features(self.features)
            values.update(_moments(features, rule))
        if isinstance(self.classifier, LinearClassifier):
            values.update(_moments(self.features, self.classifier))
        location, scale = np.array([values[spec] for spec in self.all_features]).T
        return location, scale

    def for_sensor(self, sensor_name: str) -> "FingerModel":
        """Return the model with the own handling of a sensor, if it has any, in its classifiers."""
        handling = self.own_handling.get(sensor_name)
        return self if handling is None else self.with_handling(handling)

    def with_handling(self, handling: Handling) -> "FingerModel":
        """Return the model with own handling in its classifiers.

        With location l_j and scale s_j of the sensor, u_j = (phi_j - l_j) / s_j takes the place of
        (phi_j - mean_j) / scale_j. All is linear, so the weights of the features change, and
        nothing else.
        """
        replace = msgspec.structs.replace
        values = zip(handling.location, handling.scale, strict=True)
        moments = dict(zip(self.all_features, values, strict=True))
        slip = self.slip
        if slip is not None:
            features, threshold = slip.used_features(self.features), handling.slip_threshold
            linear = _normalised_by(slip.classifier, features, moments, threshold)
            slip = replace(slip, classifier=linear)
        classifier = self.classifier
        if isinstance(classifier, LinearClassifier):
            classifier = _normalised_by(classifier, self.features, moments, handling.threshold)
        return replace(
            self, classifier=classifier, slip=slip, causes=self._causes_for(handling),
            handling=msgspec.UNSET,
        )  # fmt: skip

    def without_thresholds(self, field: Literal["threshold", "slip_threshold"]) -> "FingerModel":
        """Return the model whose own handling does not set a threshold."""
        if self.handling is msgspec.UNSET:
            return self
        replace = msgspec.structs.replace
        handling = {name: replace(known, **{field: None}) for name, known in self.handling.items()}
        return replace(self, handling=handling)

    def _causes_for(self, handling: Handling) -> CauseClassifier | None:
        """Return the causes with own handling.

        Their mean and scale are of unstable samples, so they move as the default handling does.
        """
        if self.causes is None:
            return None
        n = len(self.features)
        location, scale = (values[:n] for values in self.default_handling)
        ratio = np.array(handling.scale[:n]) / scale
        mean = handling.location[:n] + ratio * (np.array(self.causes.mean) - location)
        return msgspec.structs.replace(
            self.causes,
            mean=tuple(mean.tolist()),
            scale=tuple((ratio * self.causes.scale).tolist()),
        )

    @property
    def all_features(self) -> tuple[FeatureSpec, ...]:
        """Features of the classifier in their order, and then those of the slip rule alone."""
        slip = () if self.slip is None else self.slip.used_features(self.features)
        return (*self.features, *(spec for spec in slip if spec not in self.features))


def _moments(
    features: tuple[FeatureSpec, ...], linear: LinearClassifier
) -> dict[FeatureSpec, tuple[float, float]]:
    """Return mean and scale of each feature of a classifier."""
    return dict(zip(features, zip(linear.mean, linear.scale, strict=True), strict=True))


def _normalised_by(
    linear: LinearClassifier,
    features: tuple[FeatureSpec, ...],
    moments: Mapping[FeatureSpec, tuple[float, float]],
    threshold: float | None,
) -> LinearClassifier:
    """Return a classifier with another location and scale of each feature, and a threshold."""
    return msgspec.structs.replace(
        linear,
        mean=tuple(moments[spec][0] for spec in features),
        scale=tuple(moments[spec][1] for spec in features),
        threshold=linear.threshold if threshold is None else threshold,
    )


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
    switching: float | msgspec.UnsetType = msgspec.UNSET

    def __post_init__(self) -> None:
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


class Training(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Provenance of a model.

    Attributes:
        recordings: content digest of each training recording, by name.
        split: split of the cross-validation.
        parameters: hyper-parameters of each finger's classifier.
        figures: pooled metrics out of fold.
        seed: seed of all random numbers.
        versions: versions of the packages that fitted it.
        samples: number of used and of all labelled samples of each finger of which only every
            n-th was used.
        sliding_samples: number of sliding samples that each slip rule was trained on.
    """

    recordings: dict[str, str]
    split: str
    parameters: dict[str, dict[str, float | str | None]]
    figures: dict[str, float | None] = {}
    seed: int = 0
    versions: dict[str, str] = {}
    samples: dict[str, tuple[int, int]] | msgspec.UnsetType = msgspec.UNSET
    sliding_samples: dict[str, int] | msgspec.UnsetType = msgspec.UNSET


class ThresholdPoint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Errors of the hand at one threshold.

    Attributes:
        threshold: probability from which a contact is stable.
        false_alarms_per_minute: per minute of stable label.
        missed: share of the events without an alarm within 0.2 s [%]; None without events.
    """

    threshold: float
    false_alarms_per_minute: float
    missed: float | None


class Tuning(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the threshold of a model was chosen, and the metrics of the hand that it gave.

    Attributes:
        recordings: content digest of each recording, by name.
        requested: maximum number of false alarms per minute of stable label.
        threshold: that was chosen.
        false_alarms_per_minute: on the recordings.
        missed: by `post` [s], share of the events without an alarm until then [%].
        delay_median: of the alarms [s]; None if it is infinite, or without events.
        n_events: number of events in the recordings.
        stable_minutes: duration of stable labels [min].
        points: errors at the thresholds that were tried, lowest first.
    """

    recordings: dict[str, str]
    requested: float
    threshold: float
    false_alarms_per_minute: float
    missed: dict[str, float | None]
    delay_median: float | None
    n_events: int
    stable_minutes: float
    points: tuple[ThresholdPoint, ...] = ()


def check_limit(what: str, given: float, most: float) -> None:
    """Refuse a number of things above a limit.

    Raises:
        ModelError: it is above the limit.
    """
    if given > most:
        raise ModelError(f"at most {most:.7g} {what} expected, {given} given")
