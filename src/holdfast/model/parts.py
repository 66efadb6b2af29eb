"""Parts of a model: finger, own handling, debouncing and provenance, as plain validated data."""

import math

import msgspec
import numpy as np

from holdfast.errors import ModelError
from holdfast.features import FeatureSpec
from holdfast.model.heads import HEAD_NAMES, Head, HeadName
from holdfast.sensors.types import Array, Integers

MAX_WINDOW = 1 << 16
"""Maximum length of a window [samples]."""
MAX_FEATURES = 1024
"""Maximum number of features of a finger."""
MAX_FINGERS = 256
"""Maximum number of fingers, and of sensors, in a model."""


class Handling(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Own handling: what the features of a sensor are while its user holds objects, without slip.

    Attributes:
        location: of each feature of `FingerModel.features`.
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
        normalised: `stable` and `slip` work on features that are normalised by own handling. Their
            means and scales are then those of default handling; `for_sensor` replaces them.
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
        # The load is that of relative features, which the six of the paper do not have.
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
        n_features = len(self.features)
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
        """Features of all heads: those of `stable` in their order, then others of the rest."""
        # By the name of the head: a model file may list them in any order.
        ordered = sorted(self.heads, key=lambda head: HEAD_NAMES.index(head.name))
        return tuple(dict.fromkeys(spec for head in ordered for spec in head.features))

    def indices(self, head: Head) -> Integers:
        """Return the indices of the features of a head in those of the finger."""
        features = self.features
        return np.array([features.index(spec) for spec in head.features], dtype=np.int64)

    def with_heads(self, *heads: Head) -> "FingerModel":
        """Return the model with some heads in place of those of the same names, or beside them."""
        by_name = {head.name: head for head in (*self.heads, *heads)}
        return msgspec.structs.replace(self, heads=tuple(by_name.values()))

    def without_heads(self, *names: HeadName) -> "FingerModel":
        """Return the model without some heads."""
        heads = tuple(head for head in self.heads if head.name not in names)
        return msgspec.structs.replace(self, heads=heads)

    @property
    def default_handling(self) -> tuple[Array, Array]:
        """Location and scale of `features` without own handling: those of `stable`, else `slip`."""
        location, scale = np.zeros(len(self.features)), np.ones(len(self.features))
        # `stable` last: where both use a feature, its moments count.
        for head in (self.slip, self.stable):
            if head is not None:
                location[self.indices(head)], scale[self.indices(head)] = head.rule.moments
        return location, scale

    def for_sensor(self, sensor_name: str) -> "FingerModel":
        """Return the model with the own handling of a sensor, if it has any, in its heads."""
        handling = self.handling.get(sensor_name)
        return self if handling is None else self.with_handling(handling)

    def with_handling(self, handling: Handling) -> "FingerModel":
        """Return the model with own handling in its heads.

        With location l_j and scale s_j of the sensor, u_j = (phi_j - l_j) / s_j takes the place of
        (phi_j - mean_j) / scale_j in `stable` and `slip`. Means and scales of the other heads are
        of unstable or sliding samples, so they move as the default handling does.
        """
        before = self.default_handling
        after = np.array(handling.location), np.array(handling.scale)
        heads = []
        for head in self.heads:
            columns = self.indices(head)
            location, scale = after[0][columns], after[1][columns]
            if head.name not in ("stable", "slip"):  # the shift and stretch of the handling
                mean, own_scale = head.rule.moments
                ratio = scale / before[1][columns]
                location = location + ratio * (mean - before[0][columns])
                scale = ratio * own_scale
            threshold = handling.thresholds.get(head.name, head.threshold)
            heads.append(head.normalised_by(location, scale).at(threshold, head.choice))
        return msgspec.structs.replace(self, heads=tuple(heads), handling={})

    def without_thresholds(self, name: HeadName) -> "FingerModel":
        """Return the model whose own handling does not set the threshold of a head."""
        replace = msgspec.structs.replace
        handling = {
            sensor: replace(own, thresholds={k: t for k, t in own.thresholds.items() if k != name})
            for sensor, own in self.handling.items()
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


def check_limit(what: str, given: float, most: float) -> None:
    """Refuse a number of things above a limit.

    Raises:
        ModelError: it is above the limit.
    """
    if given > most:
        raise ModelError(f"at most {most:.7g} {what} expected, {given} given")
