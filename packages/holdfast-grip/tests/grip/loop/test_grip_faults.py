import math
import re
from pathlib import Path

import pytest

from holdfast_grip import GripReason, Limits
from holdfast_grip.loop.grip_faults import ENDED, GRIP_FAULTS, explain_fault

RISES = {"", "unstable", "slip", "load", "margin", "balance", "relax", "released"}
"""Reasons of a change of force, or of the end of a grip, which are no faults."""
GUIDE = Path(__file__).parents[5] / "docs" / "details" / "grip.md"


def limits(**fields):
    defaults = {
        "min_scale": 1.0, "max_scale": 2.0, "rise": 30.0, "fall": 3.0, "cooldown": 0.1,
        "max_force": None, "stale_after": 0.05, "fault_after": 0.03, "recovery": 0.5,
        "on_fault": "hold", "max_rate": 400.0,
    }  # fmt: skip
    return Limits(**(defaults | fields))


def explained(reason, *, armed=True, released=False, failure="", **fields):
    return explain_fault(reason, limits(**fields), armed=armed, released=released, failure=failure)


def test_every_reason_of_a_fault_has_an_explanation():
    assert set(GRIP_FAULTS) == {str(one) for one in GripReason} - RISES | {ENDED}


def test_the_guide_has_each_reason_and_what_ends_it():
    table = GUIDE.read_text("utf-8").split("## Times of faults")[1].split("\n\n")[1]
    rows = [line.split(" | ") for line in table.splitlines()[2:]]
    ends = {
        reason: "a reset" if row[3].strip(" |") != "itself" else "itself"
        for row in rows
        for reason in re.findall(r"`(\w+)`", row[1])
    }
    assert ends == {
        reason: "a reset" if fault.lasts else "itself"
        for reason, fault in GRIP_FAULTS.items()
        if reason != ENDED
    }
    assert f"`{ENDED}`" in GUIDE.read_text("utf-8")


@pytest.mark.parametrize("reason", ["lost", "limit", "stopped"])
def test_some_faults_last_until_a_reset(reason):
    fault = explained(reason)
    assert fault.commanded == "Held: the last command stays, no force rises or falls."
    assert fault.continues.endswith("Control stays off, in later grasps too, until Reset.")
    assert fault.reset.startswith("Reset continues with these forces if the grip still touches")


def test_others_end_by_themselves_if_the_hand_holds():
    ends = "Control continues by itself after 0.5 s of valid samples."
    assert explained("stale").continues.endswith(ends)
    for fields in ({"on_fault": "open"}, {"recovery": math.inf}):
        assert explained("stale", **fields).continues.endswith("until Reset.")


def test_an_open_hand():
    fault = explained("stale", released=True, on_fault="open")
    assert fault.commanded == "Released: the hand is commanded to open."
    assert fault.reset == "Reset waits for the next grip; it never closes the hand."


def test_a_dry_run():
    assert explained("lost", armed=False).commanded == "Dry run: nothing is sent to the hand."


@pytest.mark.parametrize(("on_fault", "action"), [("hold", "keeps the last"), ("open", "opens")])
def test_a_loop_that_has_ended(on_fault, action):
    fault = explained("lost", failure="no answer", on_fault=on_fault)
    assert fault.reason == ENDED
    assert action in fault.commanded
    assert fault.reset == "Reset has no effect: end this program, and start it again."


def test_a_reason_without_an_explanation():
    assert explained("new").happened == "The loop is in FAULT. The events have the reason."
