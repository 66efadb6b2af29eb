"""Profiles: named sets of numbers that describe a grasp and its disturbances, one file each.

`reference`, `gentle` and `vigorous` follow the paper: a hand grips the object and moves it, and
a finger disturbs it. `finger-reference`, `finger-gentle` and `finger-vigorous` are the profiles
of holdfast 0.1, in which only a finger disturbs; they repeat its recordings and labels exactly.
In `slips` the object also slides by other things than pushes. `long-hold` is a calm hold of
minutes, for rates of false alarms. In `coupled`
the nodes of the skin are coupled, and the rests of `reference` have impacts. In `handling` the arm
moves, too, and nothing slides.
"""

import math
import tomllib
from importlib import resources
from typing import Any

import msgspec
import numpy as np

GRASP_ATTEMPTS = 4
"""Maximum number of attempts of a grasp; later ones are disturbed less."""

Span = tuple[float, float]
"""Minimum and maximum of a number that is drawn for each grasp."""


class SlipRanges(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Numbers that describe the slips that no push causes; see `slip_events.SlipKind`.

    Attributes:
        share: probability that an event of the hold is one of these and no disturbance.
        distance: sliding distance after which everything recovers (log-uniform) [m].
        longest: longest time after which everything recovers [s].
        recovery: time that this takes [s].
        weight_rate: rate at which mass is added (log-uniform) [kg/s].
        grip_rate: rate at which the grip relaxes, in shares of its force (log-uniform) [1/s].
        friction_rate: rate at which friction falls, in shares of it (log-uniform) [1/s].
        friction_factor: factor to which it falls.
        creep_speed: speed of a hand that draws the object (log-uniform) [m/s].
        twist_rate: rate at which a torque about the grasp line grows (log-uniform) [N m/s].
        turn_speed: spin of a hand that turns the object about that line (log-uniform) [rad/s].
        roll_speed: spin of a hand that rolls the object between the fingers (log-uniform)
            [rad/s].
        roll_angle: angle by which it rolls the object, and back [rad].
        hand_stiffness: stiffness of these hands (log-uniform) [N/m].
        hand_tremor: rms tremor of these hands [m].
        pull_rate: rate at which their force rises until the object slides (log-uniform) [N/s].
    """

    share: float
    distance: Span
    longest: float
    recovery: Span
    weight_rate: Span
    grip_rate: Span
    friction_rate: Span
    friction_factor: Span
    creep_speed: Span
    twist_rate: Span
    turn_speed: Span
    roll_speed: Span
    roll_angle: Span
    hand_stiffness: Span
    hand_tremor: float
    pull_rate: Span


class ImpactRanges(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Numbers that describe impacts; see `impacts.ImpactKind`.

    Attributes:
        share: share of the rests between two disturbances that have one.
        momentum: momentum of a knock or tap (log-uniform) [N s].
        knock_time: duration of the blow of a knock (log-uniform) [s].
        tap_time: duration of that of a tap (log-uniform) [s].
        bump_speed: speed that the hand gets by a bump (log-uniform) [m/s].
        bump_time: time in which it gets it (log-uniform) [s].
        ring_rate: rate at which the arm rings then [Hz].
        ring_decay: time constant with which that stops [s].
    """

    share: float
    momentum: Span
    knock_time: Span
    tap_time: Span
    bump_speed: Span
    bump_time: Span
    ring_rate: Span
    ring_decay: Span


class ArmRanges(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Numbers that describe motions of the arm; see `loads.draw_arm_motions`.

    Attributes:
        share: share of the rests between two disturbances in which the arm moves.
        acceleration: largest acceleration of a lift or a way [m/s^2].
        duration: duration of a motion [s].
        angle: largest angle of a turn there and back [rad].
    """

    share: float
    acceleration: Span
    duration: Span
    angle: Span


class Profile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Numbers that describe a grasp and its disturbances.

    Attributes:
        name: name of the profile.
        grip: normal force at which index, middle and ring stop closing [N].
        closing_speed: speed of the fingertips along their closing path [m/s].
        tremor: rms tremor of the operator's hand [m].
        push_depth: depth to which a pushing finger goes [m].
        push_stiffness: stiffness of the pushing finger [N/m].
        push_duration: duration of a push [s].
        rest: time between two disturbances [s].
        shake_rate: rate of the pushes that shake [Hz].
        idle: time with an open hand before and after the grasp [s].
        hold: time for which the object is locked [s].
        move_share: probability that a disturbance is a hand that grips and moves the object;
            the others are a pushing finger.
        move_depth: amplitude of the hand's motion [m].
        move_stiffness: stiffness of that hand [N/m].
        move_rate: rate of its motion to and fro [Hz].
        move_duration: duration of such a disturbance [s].
        glitch_rate: glitches of the hand's controller per second [1/s].
        label_margin: time by which disturbances are labelled longer at both ends [s].
        label_glitches: whether glitches are labelled, as unstable with the cause glitch.
        arm_tremor: rms acceleration of the hand by the tremor of its arm [m/s^2].
        slips: ranges of slips that no push causes; None: there are none.
        impacts: ranges of the impacts in case 2; None: there are none.
        arm: ranges of the motions of the arm in case 2; None: it is at rest.
        without_slips: whether a grasp in which something slides is made again, more gently.
        coupled: whether the nodes of the skin are coupled (`skin.COUPLED`).
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
    arm_tremor: float = 0.0
    slips: SlipRanges | None = None
    impacts: ImpactRanges | None = None
    arm: ArmRanges | None = None
    without_slips: bool = False
    coupled: bool = False
    drawn_as: str = ""


def profiles() -> tuple[str, ...]:
    """Return the names of the profiles that come with holdfast."""
    files = resources.files("holdfast.twin").joinpath("profiles").iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml")))


def profile(name: str) -> Profile:
    """Load the profile of that name.

    Raises:
        ValueError: there is no such profile; the message lists the names.

    Example:
        >>> profile("finger-reference").hold
        12.0
    """
    if name not in profiles():
        raise ValueError(f"unknown profile {name!r}; there are {', '.join(profiles())}")
    path = resources.files("holdfast.twin").joinpath("profiles", f"{name}.toml")
    fields: dict[str, Any] = tomllib.loads(path.read_text("utf-8"))
    return msgspec.convert({**fields, "name": name}, Profile)


def log_uniform(generator: np.random.Generator, span: Span) -> float:
    """Draw a number whose logarithm is uniform."""
    low, high = span
    return low * math.exp(math.log(high / low) * float(generator.random()))
