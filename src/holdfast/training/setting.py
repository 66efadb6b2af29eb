"""How a model is trained: everything that a user may choose, in one value."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal, Self

from holdfast.classifiers import Adapted, LinearRecipe, recipe
from holdfast.errors import ModelError
from holdfast.features import DEFAULT_WINDOW, DEPLOYED_FEATURES, FeatureSpec, Tare, parse_features
from holdfast.features.haar import check_window
from holdfast.model import ANY_FINGER, Debounce, Model

Split = Literal["recording", "object", "random"]
SPLITS: tuple[Split, ...] = ("recording", "object", "random")

MAX_SAMPLES = 200_000
"""Samples a finger that training keeps in memory; of larger data it takes every n-th.

Neighbouring samples are nearly copies: a linear rule learns the same from every other one."""
SEARCH_SAMPLES = 10_000
"""Samples a finger that the search for hyper-parameters looks at, evenly spread."""


@dataclass(frozen=True)
class Setting:
    """How a model is trained.

    Attributes:
        classifier: name of the way of fitting.
        features: what it sees.
        window: N_w of the instability that is reported [samples].
        tare: how the baseline is found.
        split: how figures are cross-validated: leave one `recording` or one `object` out, or
            at `random` over samples, which repeats the paper's protocol and flatters.
        trials: of the search for hyper-parameters; 0 takes the reference setting.
        seed: of everything random.
        shared: one classifier for all fingers instead of one for each.
        contact_threshold: F_a below it is no contact [unit of the readings]; None for mean +
            5 standard deviations over the tare stretches, where they are without contact.
        max_samples: a finger that are kept in memory.
        hold: for how long the model goes on to tell UNSTABLE after its rule last said so [s].
        init: a model to begin from: its features, window and rule are adapted to the data.

    Raises:
        ValueError: an unknown name or a number out of range.
        ModelError: one classifier for all fingers is asked to begin from one for each.
    """

    classifier: str = "logreg"
    features: tuple[FeatureSpec, ...] = field(
        default_factory=lambda: parse_features(DEPLOYED_FEATURES)
    )
    window: int = DEFAULT_WINDOW
    tare: Tare = field(default_factory=lambda: Tare.parse(0.5))
    split: Split = "recording"
    trials: int = 30
    seed: int = 0
    shared: bool = False
    contact_threshold: float | None = None
    max_samples: int = MAX_SAMPLES
    hold: float = 0.0
    init: Model | None = None

    def __post_init__(self) -> None:
        recipe(self.classifier)
        check_window(self.window)
        if self.split not in SPLITS:
            raise ValueError(f"unknown split {self.split!r}; there are {', '.join(SPLITS)}")
        if self.trials < 0 or self.max_samples < 1:
            raise ValueError(
                f"trials of at least 0 and samples of at least 1 expected; "
                f"{self.trials} and {self.max_samples} given"
            )
        if not 0 <= self.seed < 2**32:
            raise ValueError(f"a seed from 0 to 2^32 - 1 expected, {self.seed} given")
        threshold = self.contact_threshold
        if threshold is not None and not (math.isfinite(threshold) and threshold >= 0):
            raise ValueError(f"a contact threshold of at least 0 expected, {threshold} given")
        if not (math.isfinite(self.hold) and self.hold >= 0):
            raise ValueError(f"a hold of at least 0 s expected, {self.hold} given")
        if self.shared and self.init is not None and ANY_FINGER not in self.init.fingers:
            raise ModelError(
                f"one classifier for all fingers (shared) cannot begin from {_name(self.init)}, "
                f"which has one for each of {', '.join(self.init.fingers)}"
            )

    @classmethod
    def adapting(cls, init: Model, **chosen: Any) -> Self:  # noqa: ANN401 (the fields above)
        """The setting that adapts a model, with its features, window, tare and hold.

        Args:
            init: the model.
            chosen: fields that win over what the model has.

        Raises:
            ModelError: its fingers have different features; or as above.
            ValueError: as above.
        """
        features = {part.features for part in init.fingers.values()}
        if len(features) > 1:
            raise ModelError(
                f"{_name(init)} has different features for its fingers; one list for all "
                "expected to begin from"
            )
        own = {"features": features.pop(), "window": init.window, "tare": Tare.parse(init.tare)}
        own["hold"] = init.debounce.hold
        return cls(**{**own, **chosen}, init=init)

    def recipe_of(self, finger: str) -> LinearRecipe:
        """The way of fitting a finger's classifier.

        Raises:
            ModelError: the model to begin from has no such finger.
        """
        if self.init is not None:
            return Adapted(self.init.finger(finger).classifier)
        return recipe(self.classifier)

    @property
    def debounce(self) -> Debounce:
        """How the model holds back changes of state: as the one it began from, but for the hold."""
        known = Debounce() if self.init is None else self.init.debounce
        return Debounce(known.min_duration, known.hysteresis, self.hold)

    @property
    def rate(self) -> float | None:
        """The rate that the model's windows are meant for [Hz]; None for that of the data."""
        return None if self.init is None else self.init.rate


def _name(model: Model) -> str:
    return model.name or "the model to begin from"
