"""Explanations of the faults of a grip loop, for the page and the documentation."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from holdfast_grip.documents import GripFault
from holdfast_grip.limits import Limits

ENDED = "ended"
"""Reason of a fault that ended the loop for good."""


class FaultMeaning(NamedTuple):
    """What one reason of a fault means.

    Attributes:
        happened: what happened.
        advice: what it means, or what to do.
        lasts: whether the fault lasts until a reset, also if the hand holds.
    """

    happened: str
    advice: str
    lasts: bool = False


GRIP_FAULTS: Mapping[str, FaultMeaning] = {
    "lost": FaultMeaning(
        "All fingers of the grip lost contact.",
        "The object slipped out or was taken away, or a hand that reports no joints let go.",
        lasts=True,
    ),
    "stale": FaultMeaning(
        "Samples of a finger came too late, or no samples arrive.",
        "The loop does not see the contact: check the sensor, its cable and the network.",
    ),
    "frozen": FaultMeaning(
        "The readings of a finger repeat exactly.",
        "Its sensor sends old readings: check the sensor and its cable.",
    ),
    "behind": FaultMeaning(
        "The loop was behind the samples.",
        "The hand takes too long for a command, or this computer is busy: check its load.",
    ),
    "finger_fault": FaultMeaning(
        "A finger of the grip has no estimate.",
        "Its sensor is faulty: the card of the finger shows the fault.",
    ),
    "not_finite": FaultMeaning(
        "A force or a probability is not a number.",
        "The readings cannot be used: check the sensor and its calibration.",
    ),
    "clock": FaultMeaning(
        "The clock of the source jumped.",
        "The age of the samples is not known: synchronise the clock of the device.",
    ),
    "overload": FaultMeaning(
        "A finger measures 1.5 times the highest force allowed.",
        "The hand presses too much, or something pushes the finger.",
    ),
    "limit": FaultMeaning(
        "The controller made a command beyond the limits.",
        "It was not sent. This is a defect of the controller or its law: please report it.",
        lasts=True,
    ),
    "stopped": FaultMeaning(
        "A person pressed the emergency stop.",
        "Check hand and object before you reset it.",
        lasts=True,
    ),
    "hand": FaultMeaning(
        "The hand sends no joint states.",
        "The driver of the hand is silent: check it and the network.",
    ),
    ENDED: FaultMeaning(
        "A command did not reach the hand.",
        "The hand refused it or is not connected, or the watchdog has taken over.",
        lasts=True,
    ),
    "watchdog": FaultMeaning(
        "The watchdog has taken over.",
        "The loop was killed, or sent nothing for 0.1 s: check the load of this computer.",
        lasts=True,
    ),
}
"""Meaning of every reason of a fault."""
UNKNOWN_FAULT = FaultMeaning("The loop is in FAULT.", "The events have the reason.")


def explain_fault(
    reason: str, limits: Limits, *, armed: bool, released: bool, failure: str = ""
) -> GripFault:
    """Return what a fault is, what is commanded now, and how it ends, in words.

    Args:
        reason: of the fault.
        limits: of the controller.
        armed: whether commands are sent.
        released: whether the hand is commanded to be open.
        failure: why the loop has ended for good; empty while it runs.
    """
    key = ENDED if failure else reason
    meaning = GRIP_FAULTS.get(key, UNKNOWN_FAULT)
    opens = limits.on_fault == "open"
    commanded = "Held: the last command stays, no force rises or falls."
    continues = (
        "Estimates go on. Control continues by itself "
        f"after {limits.recovery:g} s of valid samples."
    )
    reset = (
        "Reset continues with these forces if the grip still touches the object; else it waits "
        "for the next grip."
    )
    if released:
        commanded = "Released: the hand is commanded to open."
    if opens:
        reset = "Reset waits for the next grip; it never closes the hand."
    if meaning.lasts or opens or math.isinf(limits.recovery):
        continues = "Estimates go on. Control stays off, in later grasps too, until Reset."
    # The end of the loop outranks what the fault would be in a loop that runs.
    if failure:
        action = "opens the hand" if opens else "keeps the last command"
        commanded = f"Nothing is sent any more; the watchdog {action}."
        continues = "Control has ended; only the estimates go on."
        reset = "Reset has no effect: end this program, and start it again."
    if not armed:
        commanded = "Dry run: nothing is sent to the hand."
    happened = f"{meaning.happened} {meaning.advice}"
    return GripFault(
        reason=key, happened=happened, commanded=commanded, continues=continues, reset=reset
    )
