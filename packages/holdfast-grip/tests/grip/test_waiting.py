"""What the loop waits for before a grip begins, in words."""

import math

import pytest

from grip.build import hand
from holdfast.contact import ContactState
from holdfast_grip import GripController, Limits
from holdfast_grip.waiting import MUST_LAST, NO_SAMPLES, NO_TOUCH

UNSTABLE, UNKNOWN = ContactState.UNSTABLE, ContactState.UNKNOWN
FREE = {"state": ContactState.NO_CONTACT}


@pytest.fixture
def controller():
    return GripController(Limits())


def waits(controller, time, state=UNSTABLE, **changes):
    controller.update(hand(time, state, **changes), time)
    return controller.waits_for


def test_without_samples_it_says_so(controller):
    assert controller.waits_for == NO_SAMPLES


def test_a_finger_that_is_not_stable_is_named_with_its_time(controller):
    ring = {"state": UNSTABLE, "normal": 9000.0}
    assert waits(controller, 5.0, ring=ring) == "the ring finger is not stable"
    assert waits(controller, 17.4, ring=ring) == "the ring finger is not stable: 12 s"


def test_the_condition_that_lasts_longest_is_first(controller):
    thumb, ring = {"state": UNKNOWN}, {"state": UNSTABLE}
    waits(controller, 0.0, UNKNOWN, thumb=thumb)
    assert waits(controller, 3.0, UNKNOWN, thumb=thumb, ring=ring) == (
        "the thumb has no estimate: 3 s; the ring finger is not stable"
    )
    assert waits(controller, 5.0, UNKNOWN, ring=ring) == "the ring finger is not stable: 2 s"


def test_a_condition_that_ended_begins_anew(controller):
    ring = {"state": UNSTABLE, "normal": 9000.0}
    waits(controller, 0.0, ring=ring)
    assert waits(controller, 8.0, ContactState.STABLE) == MUST_LAST
    assert waits(controller, 8.1, ring=ring) == "the ring finger is not stable"


def test_a_hand_without_an_object_and_a_single_finger(controller):
    free = dict.fromkeys(("thumb", "index", "middle", "ring"), FREE)
    assert waits(controller, 0.0, ContactState.NO_CONTACT, **free) == NO_TOUCH
    del free["index"]
    text = waits(controller, 1.0, ContactState.STABLE, **free)
    assert text == "only the index finger touches an object"


def test_a_grip_waits_for_nothing_and_a_reset_starts_anew(controller):
    for k in range(3):
        assert controller.state == "IDLE"
        waits(controller, 0.1 * k, ContactState.STABLE)
    assert (controller.state, controller.waits_for) == ("HOLD", "")
    controller.reset()
    assert controller.waits_for == NO_SAMPLES


@pytest.mark.parametrize("time", [math.nan, math.inf])
def test_a_time_that_is_no_number_changes_nothing(controller, time):
    waits(controller, 0.0, ring={"state": UNSTABLE})
    controller.update(hand(1.0, UNSTABLE), time)
    assert controller.waits_for == "the ring finger is not stable"


def test_a_clock_that_goes_back_gives_no_negative_time(controller):
    ring = {"state": UNSTABLE, "normal": 9000.0}
    waits(controller, 9.0, ring=ring)
    assert waits(controller, 2.0, ring=ring) == "the ring finger is not stable"
    assert waits(controller, 4.0, ring=ring) == "the ring finger is not stable: 2 s"
