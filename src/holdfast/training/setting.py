"""Setting of a training: all options that a user can choose."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal, Self

from holdfast.detection import (
    ANY_FINGER,
    DEFAULT_WINDOW,
    DEPLOYED_FEATURES,
    Debounce,
    FeatureSpec,
    Model,
    Tare,
    parse_features,
)
from holdfast.detection.specs import SLIP_FEATURES, check_window
from holdfast.errors import ModelError
from holdfast.training.classifiers import recipe
from holdfast.training.classifiers.fitting import Recipe
from holdfast.training.classifiers.logreg import Adapted

Split = Literal["recording", "object", "time", "random"]
SPLITS: tuple[Split, ...] = ("recording", "object", "time", "random")

MAX_SAMPLES = 200_000
"""Maximum number of samples per finger that training keeps in memory.

Of larger data it uses every n-th sample. Neighbouring samples are nearly equal, so a linear rule
loses little."""
LOAD_TO_NOISE_OF_CONTACT = 10.0
"""Threshold of contact on the load for relative features, in multiples of its noise."""
DEFAULT_HOLD, DEFAULT_HYSTERESIS = 0.1, 0.1
"""Hold [s] and hysteresis of the models that `holdfast train` writes, see decision 12."""
SEARCH_SAMPLES = 10_000
"""Maximum number of samples per finger for the choice of parameters, at even steps."""


@dataclass(frozen=True)
class Setting:
    """Setting of a training.

    Attributes:
        classifier: `logreg` or `svm`.
        features: input of the classifier.
        window: N_w of the instability that is reported [samples].
        tare: how the baseline is found; None for `first` with relative features, which need no
            tare without contact, else 0.5 s.
        split: unit that cross-validation leaves out: one `recording`, one `object`, a block of
            `time` of every recording, or `random` samples. The random split repeats the paper's
            protocol. The metrics of the last two are too good.
        trials: 0 uses the reference parameters; None chooses them on a grid.
        seed: of all random numbers.
        shared: one classifier for all fingers instead of one for each; None for that of
            relative features alone, which are the same on every finger and sensor.
        contact_threshold: F_a below it is no contact [unit of the readings]; None for the mean +
            5 standard deviations over the tare intervals, if they are without contact.
        max_samples: maximum number of samples per finger that are kept in memory.
        hold: time for which UNSTABLE is still reported after the last unstable sample [s].
        hysteresis: distance past its threshold that a probability needs to change the state.
        own_slip_features: whether the slip rule has features of its own, and squares of them, so
            that it sees single taxels move; else it has `features`.
        init: model to adapt to the data, with its features and window; None for none.

    Raises:
        ValueError: a name is unknown, or a number is out of range.
        ModelError: `shared` is given, but the model to adapt has a classifier for each finger.
    """

    classifier: str = "logreg"
    features: tuple[FeatureSpec, ...] = field(
        default_factory=lambda: parse_features(DEPLOYED_FEATURES)
    )
    window: int = DEFAULT_WINDOW
    tare: Tare | None = None
    split: Split = "recording"
    trials: int | None = None
    seed: int = 0
    shared: bool | None = None
    contact_threshold: float | None = None
    max_samples: int = MAX_SAMPLES
    hold: float = 0.0
    hysteresis: float = 0.0
    own_slip_features: bool = False
    init: Model | None = None

    def __post_init__(self) -> None:
        recipe(self.classifier)
        check_window(self.window)
        if self.split not in SPLITS:
            raise ValueError(f"unknown split {self.split!r}; there are {', '.join(SPLITS)}")
        if self.trials:
            raise ValueError(
                f"{self.trials} trials given, 0 or none expected: a training chooses its "
                "parameters on a grid; holdfast study (holdfast-lab) has the search"
            )
        if self.max_samples < 1:
            raise ValueError(f"samples of at least 1 expected, {self.max_samples} given")
        if not 0 <= self.seed < 2**32:
            raise ValueError(f"a seed from 0 to 2^32 - 1 expected, {self.seed} given")
        threshold = self.contact_threshold
        if threshold is not None and not (math.isfinite(threshold) and threshold >= 0):
            raise ValueError(f"a contact threshold of at least 0 expected, {threshold} given")
        if not (math.isfinite(self.hold) and self.hold >= 0):
            raise ValueError(f"a hold of at least 0 s expected, {self.hold} given")
        if not 0 <= self.hysteresis < 1:
            raise ValueError(f"a hysteresis from 0 to 1 expected, {self.hysteresis} given")
        if self.shared and self.init is not None and ANY_FINGER not in self.init.fingers:
            raise ModelError(
                f"one classifier for all fingers (shared) cannot be adapted from "
                f"{_name(self.init)}, which has one for each of {', '.join(self.init.fingers)}"
            )

        if self.own_slip_features and self.init is not None:
            raise ValueError(
                "own slip features given with a model to adapt, which keeps its slip rule; leave "
                "one of them out"
            )

    @classmethod
    def adapting(cls, init: Model, **chosen: Any) -> Self:  # noqa: ANN401 (the fields above)
        """Return the setting that adapts a model, with its features, window, tare and hold.

        Args:
            init: the model to adapt.
            chosen: other fields; they outrank the model's.

        Raises:
            ModelError: the fingers of the model have different features; or as the class.
            ValueError: as the class.
        """
        features = {part.stable.features for part in init.fingers.values()}
        if len(features) > 1:
            raise ModelError(
                f"{_name(init)} has different features for its fingers; only a model with the same "
                "features for all fingers can be adapted"
            )
        defaults = {
            "features": features.pop(),
            "window": init.window,
            "tare": Tare.parse(init.tare),
        }
        defaults |= {"hold": init.debounce.hold, "hysteresis": init.debounce.hysteresis}
        return cls(**{**defaults, **chosen}, init=init)

    def recipe_of(self, finger: str) -> Recipe:
        """Return the way of fitting the classifier of a finger.

        Raises:
            ModelError: the model to adapt lacks the finger.
        """
        if self.init is not None:
            stable = self.init.finger(finger).stable
            return Adapted(stable.rule, stable.threshold)
        return recipe(self.classifier)

    @property
    def relative(self) -> bool:
        """Whether all features are relative: the model then fits any sensor, unit and rate."""
        return all(spec.seconds for spec in self.features)

    @property
    def slip_features(self) -> tuple[FeatureSpec, ...] | None:
        """Features of the slip rule alone; None if it has the features of stability.

        Beside relative features, it has only relative ones of its own.
        """
        if not self.own_slip_features:
            return None
        if not self.relative:
            return SLIP_FEATURES
        relative = (spec for spec in SLIP_FEATURES if spec.seconds)
        return tuple(dict.fromkeys((*self.features, *relative)))

    @property
    def used_tare(self) -> Tare:
        """The tare that is given, else the tare that fits the features."""
        if self.tare is not None:
            return self.tare
        return Tare.parse("first" if self.relative else 0.5)

    @property
    def is_shared(self) -> bool:
        """Whether one classifier is for all fingers."""
        if self.shared is None:
            return self.relative and (self.init is None or ANY_FINGER in self.init.fingers)
        return self.shared

    def contact_load_of(self, finger: str) -> float | None:
        """Return the threshold of contact on the load; None without relative features.

        Raises:
            ModelError: the model to adapt lacks the finger.
        """
        if self.init is not None:
            return self.init.finger(finger).contact_load
        return LOAD_TO_NOISE_OF_CONTACT if self.relative else None

    @property
    def debounce(self) -> Debounce:
        """Debouncing of the model; minimum duration and filter come from the adapted model."""
        adapted = Debounce() if self.init is None else self.init.debounce
        return Debounce(adapted.min_duration, self.hysteresis, self.hold, adapted.switching)

    @property
    def rate(self) -> float | None:
        """Rate for which the model's windows are meant [Hz]; None for the rate of the data."""
        return None if self.init is None else self.init.rate


def _name(model: Model) -> str:
    return model.name or "the model to adapt"
