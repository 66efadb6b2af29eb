"""What a method is: features of a hand, and a way of fitting a classifier to them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from holdfast.classifiers import Parameters, Recipe
from holdfast.sensors.types import Array
from holdfast.study.methods.signals import HandSignal

HAND = "hand"
"""Key of the features of a method that judges the hand as a whole."""

Category = Literal["paper", "friction", "vibration", "differentiation", "learning", "holdfast"]


@dataclass(frozen=True)
class Method:
    """A way of judging contacts, as the study compares them: features, then a classifier.

    Attributes:
        name: as in tables and files.
        title: as in the report.
        category: as in the paper's review of methods.
        source: where it is from, and what was changed.
        features: from a hand to (n, n_features) of each finger, one row a sample, causal; NaN
            where there are none. A method that judges the hand as a whole gives one array
            under `HAND`, at the times of its first finger.
        recipe: how its classifier is fitted.
        parameters: of the recipe; None for its reference setting.
        whole_hand: whether it judges the hand as a whole.
    """

    name: str
    title: str
    category: Category
    source: str
    features: Callable[[HandSignal], Mapping[str, Array]]
    recipe: Recipe
    parameters: Parameters | None = None
    whole_hand: bool = False

    @property
    def reference(self) -> Parameters:
        """The parameters that it is fitted with."""
        return self.recipe.reference if self.parameters is None else self.parameters
