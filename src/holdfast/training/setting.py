"""How a model is trained: everything that a user may choose, in one value."""

import math
from dataclasses import dataclass, field
from typing import Literal

from holdfast.classifiers import LinearRecipe, recipe
from holdfast.features import DEPLOYED, FeatureSpec, Tare, parse_features
from holdfast.features.haar import check_window

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

    Raises:
        ValueError: an unknown name or a number out of range.
    """

    classifier: str = "logreg"
    features: tuple[FeatureSpec, ...] = field(default_factory=lambda: parse_features(DEPLOYED))
    window: int = 14
    tare: Tare = field(default_factory=lambda: Tare.parse(0.5))
    split: Split = "recording"
    trials: int = 30
    seed: int = 0
    shared: bool = False
    contact_threshold: float | None = None
    max_samples: int = MAX_SAMPLES

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

    @property
    def recipe(self) -> LinearRecipe:
        """The way of fitting."""
        return recipe(self.classifier)
