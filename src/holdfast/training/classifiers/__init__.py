"""Classifiers, and the recipes that fit them, by name; one file for each."""

from holdfast.detection.heads import Linear
from holdfast.training.classifiers.fitting import (
    Classifier,
    Fitted,
    ModelRecipe,
    Parameters,
    Recipe,
    Samples,
)
from holdfast.training.classifiers.logreg import Adapted, LogisticRegression
from holdfast.training.classifiers.svm import LinearSVM

RECIPES: dict[str, ModelRecipe] = {"logreg": LogisticRegression(), "svm": LinearSVM()}

__all__ = [
    "RECIPES",
    "Adapted",
    "Classifier",
    "Fitted",
    "Linear",
    "ModelRecipe",
    "Parameters",
    "Recipe",
    "Samples",
    "recipe",
]


def recipe(name: str) -> ModelRecipe:
    """Return the recipe with a name, one of `RECIPES`.

    Raises:
        ValueError: the name is unknown.
    """
    if name not in RECIPES:
        raise ValueError(f"unknown classifier {name!r}; there are {', '.join(RECIPES)}")
    return RECIPES[name]
