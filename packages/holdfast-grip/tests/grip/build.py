"""Estimates of a hand that holds something, for tests of grip control."""

import math

from holdfast.contact import ContactEstimate, ContactState, HandEstimate, Reason
from holdfast_grip import GripController, Limits

RATE = 150.0
FINGERS = ("thumb", "index", "middle", "ring")
NORMAL = {"thumb": 3000.0, "index": 1000.0, "middle": 1000.0, "ring": 1000.0}
"""Normal force of each finger [count]; the thumb carries the others."""
TANGENTIAL = 0.3
"""Tangential force as a share of the normal force."""


def finger(name="index", time=0.0, state=ContactState.STABLE, **given):
    normal = given.get("normal", NORMAL[name])
    tangential = given.get("tangential", TANGENTIAL * normal)
    unknown = state is ContactState.UNKNOWN
    return ContactEstimate(
        given.get("time", time),
        state,
        given.get("reason", Reason.FAULT if unknown else Reason.NONE),
        given.get("probability", math.nan if unknown else 0.95),
        given.get("instability", 1.0),
        given.get("force", (normal, tangential, 0.0)),
        given.get("faults", ()),
        slip_probability=given.get("slip_probability"),
    )


def hand(time, state=ContactState.STABLE, fingers=FINGERS, **changes):
    """An estimate in which all fingers hold, except for the changes of some of them."""
    return HandEstimate(
        time, state, {name: finger(name, time, **changes.get(name, {})) for name in fingers}
    )


def holding(law="holdfast", fingers=FINGERS, changes=None, **limits):
    """A controller whose grip has begun, and the time of its last update."""
    controller = GripController(Limits(**limits), law, newtons_per_unit=1e-3)
    time = 0.0
    while controller.state == "IDLE":
        controller.update(hand(time, fingers=fingers, **(changes or {})), time)
        time += 1 / RATE
    controller.events()
    return controller, time - 1 / RATE


def run(controller, time, seconds, **changes):
    """Update with the same estimate for a time; the commands, and the time of the last."""
    commands = []
    for _ in range(round(seconds * RATE)):
        time += 1 / RATE
        commands.append(controller.update(hand(time, **changes), time))
    return commands, time


def scales(command):
    return {name: one.scale for name, one in command.fingers.items()}
