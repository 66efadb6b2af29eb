"""Classifiers, and the recipes that fit them, by name; one file for each."""

from holdfast.training.classifiers.fitting import Parameters, Recipe, Samples
from holdfast.training.classifiers.logreg import LogisticRegression
from holdfast.training.classifiers.svm import LinearSVM

RECIPES: dict[str, Recipe] = {"logreg": LogisticRegression(), "svm": LinearSVM()}

__all__ = ["RECIPES", "Parameters", "Recipe", "Samples", "recipe"]


def recipe(name: str) -> Recipe:
    """Return the recipe with a name, one of `RECIPES`.

    Raises:
        ValueError: the name is unknown.
    """
    if name not in RECIPES:
        raise ValueError(f"unknown classifier {name!r}; there are {', '.join(RECIPES)}")
    return RECIPES[name]
