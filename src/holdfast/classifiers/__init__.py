"""Classifiers, and the recipes that fit them, by name; one file for each."""

from typing import Any

from holdfast.classifiers.fitting import (
    Classifier,
    Fitted,
    ModelRecipe,
    Parameters,
    Recipe,
    Samples,
)
from holdfast.classifiers.linear import Linear
from holdfast.classifiers.logreg import Adapted, LogisticRegression
from holdfast.classifiers.svm import LinearSVM
from holdfast.plugins import PluginGroup

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
    "recipe_names",
]


def recipe(name: str) -> ModelRecipe:
    """Return the recipe with a name, one of `RECIPES` or of a plug-in.

    Raises:
        ValueError: the name is unknown.
    """
    if name in RECIPES:
        return RECIPES[name]
    way = CLASSIFIER_PLUGINS.load(name)
    if way is None:
        raise ValueError(
            f"unknown classifier {name!r}; there are {', '.join(RECIPES)}"
            f"{CLASSIFIER_PLUGINS.text()}"
        )
    return way


def recipe_names() -> tuple[str, ...]:
    """Return the names of all recipes: our own, then those of plug-ins."""
    return (*RECIPES, *CLASSIFIER_PLUGINS.names())


def _plugin_recipe(name: str, loaded: Any) -> ModelRecipe:  # noqa: ANN401
    """Return the recipe of a plug-in: an object, or a class without arguments."""
    way: ModelRecipe = loaded() if isinstance(loaded, type) else loaded
    if missing := [part for part in _PARTS_OF_A_RECIPE if not hasattr(way, part)]:
        raise TypeError(f"a recipe expected, {loaded!r} has no {', '.join(missing)}")
    if way.name != name:
        raise ValueError(f"a recipe with the name {name} expected, {way.name} given")
    return way


_PARTS_OF_A_RECIPE = ("name", "reference", "suggest", "fit")
CLASSIFIER_PLUGINS = PluginGroup("classifiers", RECIPES, _plugin_recipe)
"""Recipes of other packages."""
