import numpy as np
import pytest

from holdfast.contact import Phase
from holdfast.metrics.slip_truth import slip_truth
from holdfast.twin import scripted
from holdfast.twin.scripted import perform
from holdfast.twin.simulation import Grasp

CAN = Grasp("can", 2, 1, seed=5)


def n_slips(recording):
    truths = [slip_truth(recording, name, x.times) for name, x in recording.modules.items()]
    return sum(len(truth.slips) for truth in truths)


def test_an_open_hand_touches_nothing():
    recording = perform(CAN, "open", 0, 2.0)
    assert recording.duration == pytest.approx(2.0, abs=0.02)
    assert {*recording.truth.hand["phase"]} == {Phase.FREE}


@pytest.fixture(scope="module")
def pulled():
    return perform(CAN, "pull", 3, 9.0)


def test_a_pull_slides_and_a_touch_slides_less(pulled):
    touched = perform(CAN, "touch", 4, 9.0)
    assert [x["kind"] for x in pulled.metadata["slip_events"]][:2] == ["creep", "twist"]
    assert n_slips(pulled) > n_slips(touched)
    assert Phase.DISTURBED in touched.truth.hand["phase"]


def test_a_script_keeps_to_its_time(pulled):
    assert len(pulled.metadata["slip_events"]) == 3
    last = max(x["end"] for x in pulled.metadata["slip_events"])
    assert last <= pulled.metadata["locked_at"] + 9.0 - scripted.LAST_ACTION + 0.01
    open_at_end = pulled.truth.hand["phase"][-round(4 * pulled.rate) :]
    assert {*open_at_end} == {Phase.FREE}


def test_an_arm_that_carries_changes_the_force():
    held, carried = perform(CAN, "touch", 0, 8.0), perform(CAN, "carry", 2, 8.0)
    assert held.metadata["slip_events"] == carried.metadata["slip_events"] == []
    spread = []
    for recording in (held, carried):
        start = round((recording.metadata["locked_at"] + 2.5) * recording.rate)
        force = recording.truth.fingers["index"]["contact_force"][start : start + 400]
        spread.append(np.ptp(force, axis=0).max())
    assert spread[1] > 2 * spread[0]
