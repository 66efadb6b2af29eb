"""How a grasp is done and disturbed: small files of numbers, fixed and named."""

import tomllib
from importlib import resources
from typing import Any

import msgspec

ATTEMPTS = 4
"""A grasp that fails is tried again, a little calmer, so often at the most."""

Span = tuple[float, float]
"""Smallest and largest of what is drawn for each grasp."""


class Profile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How a grasp is done and disturbed.

    Attributes:
        name: of the profile.
        grip: normal force at which index, middle and ring stop closing [N].
        closing_speed: of the fingertips along their closing path [m/s].
        tremor: of the operator's hand, rms [m].
        push_depth: how far a pushing finger goes [m].
        push_stiffness: of the pushing finger [N/m].
        push_duration: of a disturbance [s].
        rest: between two disturbances [s].
        shake_rate: of those disturbances that shake [Hz].
        idle: how long the hand is open before and after [s].
        hold: how long the object is locked [s].
    """

    name: str
    grip: float
    closing_speed: Span
    tremor: float
    push_depth: Span
    push_stiffness: Span
    push_duration: Span
    rest: Span
    shake_rate: Span
    idle: Span
    hold: float


def profiles() -> tuple[str, ...]:
    """Names of the profiles that come with holdfast."""
    files = resources.files("holdfast.twin").joinpath("profiles").iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml")))


def profile(name: str) -> Profile:
    """The profile of that name.

    Raises:
        ValueError: there is none.

    Example:
        >>> profile("reference").hold
        12.0
    """
    if name not in profiles():
        raise ValueError(f"unknown profile {name!r}; there are {', '.join(profiles())}")
    path = resources.files("holdfast.twin").joinpath("profiles", f"{name}.toml")
    fields: dict[str, Any] = tomllib.loads(path.read_text("utf-8"))
    return msgspec.convert({**fields, "name": name}, Profile)
