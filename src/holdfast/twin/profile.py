"""Profiles: how a grasp is done and disturbed, as small files of numbers, fixed and named.

`reference`, `gentle` and `vigorous` follow the paper: a hand grips the object and moves it, and
a finger pushes it. `finger-reference`, `finger-gentle` and `finger-vigorous` are the profiles
of holdfast 0.1, in which only a finger pushes; they repeat its recordings and labels exactly.
"""

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
        move_share: probability that a disturbance is a hand that grips and moves the object;
            the others are a pushing finger.
        move_depth: amplitude of the hand's motion [m].
        move_stiffness: of that hand [N/m].
        move_rate: of its motion there and back [Hz].
        move_duration: of such a disturbance [s].
        glitch_rate: glitches of the hand's controller per second [1/s].
        label_margin: time by which disturbances are labelled longer at both ends [s].
        label_glitches: whether glitches are labelled, as unstable with their own cause.
        drawn_as: name under which random numbers are drawn; by default that of the profile.
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
    move_share: float = 0.0
    move_depth: Span = (0.0, 0.0)
    move_stiffness: Span = (0.0, 0.0)
    move_rate: Span = (0.0, 0.0)
    move_duration: Span = (0.0, 0.0)
    glitch_rate: float = 0.12
    label_margin: float = 0.0
    label_glitches: bool = True
    drawn_as: str = ""


def profiles() -> tuple[str, ...]:
    """Names of the profiles that come with holdfast."""
    files = resources.files("holdfast.twin").joinpath("profiles").iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml")))


def profile(name: str) -> Profile:
    """The profile of that name.

    Raises:
        ValueError: there is none.

    Example:
        >>> profile("finger-reference").hold
        12.0
    """
    if name not in profiles():
        raise ValueError(f"unknown profile {name!r}; there are {', '.join(profiles())}")
    path = resources.files("holdfast.twin").joinpath("profiles", f"{name}.toml")
    fields: dict[str, Any] = tomllib.loads(path.read_text("utf-8"))
    return msgspec.convert({**fields, "name": name}, Profile)
