"""Parts of a model: finger, debouncing, provenance and tuning, as plain validated data."""

import math

import msgspec

from holdfast.classifiers import ModelClassifier
from holdfast.classifiers.cause import CauseClassifier
from holdfast.classifiers.slip import SlipRule
from holdfast.errors import ModelError
from holdfast.features import FeatureSpec

MAX_WINDOW = 1 << 16
"""Maximum length of a window [samples]."""
MAX_FEATURES = 1024
"""Maximum number of features of a finger."""
MAX_FINGERS = 256
"""Maximum number of fingers, and of sensors, in a model."""
MAX_TAXELS = 4096
"""Maximum number of taxels of a sensor in a model."""


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

    @property
    def all_features(self) -> tuple[FeatureSpec, ...]:
        """Features of the classifier in their order, and then those of the slip rule alone."""
        slip = () if self.slip is None else self.slip.used_features(self.features)
        return (*self.features, *(spec for spec in slip if spec not in self.features))


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
