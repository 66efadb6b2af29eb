from dataclasses import replace

import numpy as np
import pytest
from holdfast_lab.study.evaluation.error_breakdown import break_down_errors, count_glitches

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import Decisions, FingerDecisions
from holdfast.recordings import Truth
from holdfast_lab.study.methods import HAND
from study.example_recordings import GLITCH, PUSH, truth_of

TIMES = np.arange(1725) / 150
GROUND_TRUTH = truth_of(TIMES, ("thumb", "index"))
LABELS = np.where((TIMES >= 2.3) & (TIMES < 9.5), STABLE, UNSTABLE)
LABELS = np.where((TIMES >= 5.3 - 1e-9) & (TIMES < 6.5), UNSTABLE, LABELS).astype(np.int8)


def decided(states, names=("thumb", "index")):
    finger = FingerDecisions(TIMES, LABELS, states, np.full(len(TIMES), 0.5))
    return Decisions("one", dict.fromkeys(names, finger), finger)


def breakdown_of(states, truth=None, names=("thumb", "index")):
    truth = truth or truth_of(TIMES, ("thumb", "index"))
    return break_down_errors(truth, decided(states, names))


def test_everything_called_stable():
    found = breakdown_of(np.full(1725, STABLE, dtype=np.int8))
    assert found.phases["disturbed"] == (360, 360)
    assert found.phases["locked"] == (1800, 0)
    assert found.phases["free"][0] == found.phases["free"][1] == 2 * (225 + 225)
    assert found.disturbances == [("down", (358, 358))]
    assert [(grip.stable, grip.not_stable) for grip in found.grips] == [((900, 0), (180, 180))] * 2
    assert [grip.force for grip in found.grips] == pytest.approx([2.0, 2.0])


def test_samples_without_a_decision_do_not_count():
    states = np.where(TIMES < 6.0 - 1e-9, UNKNOWN, UNSTABLE).astype(np.int8)
    found = breakdown_of(states)
    assert found.phases["disturbed"] == (2 * 75, 0)
    assert found.phases["locked"] == (2 * 450, 2 * 450)
    assert (found.grips[0].stable, found.grips[0].not_stable) == ((450, 450), (75, 0))


@pytest.mark.parametrize(
    ("force", "direction"),
    [((0, 0, 1), "up"), ((0.2, -1, 0), "left"), ((1, 1, 0), "oblique"), ((3, 0, 1), "towards")],
)
def test_directions(force, direction):
    truth = truth_of(TIMES, ("thumb", "index"))
    outside = np.outer(np.linalg.norm(truth.hand["outside_force"], axis=1), force)
    turned = Truth(TIMES, {**truth.hand, "outside_force": outside}, truth.fingers)
    assert force != PUSH
    ((found, _),) = breakdown_of(np.full(1725, STABLE), turned).disturbances
    assert found == direction


def test_a_whole_hand_method_has_phases_and_disturbances_but_no_grips():
    found = breakdown_of(np.full(1725, STABLE, dtype=np.int8), names=(HAND,))
    assert found.phases["disturbed"] == (180, 180)
    assert found.disturbances == [("down", (179, 179))]
    assert found.grips == []


def test_the_breakdown_is_empty_without_a_truth():
    found = break_down_errors(None, decided(np.full(1725, STABLE)))
    assert (found.phases, found.grips, found.disturbances) == ({}, [], [])


def sliding(*spans, speed=0.01):
    """Return the truth with sliding on the index alone, at other times [s] and speeds [m/s]."""
    given = np.zeros(len(TIMES))
    for start, end in spans:
        given[(start - 1e-9 <= TIMES) & (end - 1e-9 > TIMES)] = speed
    fingers = {name: dict(arrays) for name, arrays in GROUND_TRUTH.fingers.items()}
    fingers["thumb"]["slip_speed"] = np.zeros(len(TIMES))
    fingers["index"]["slip_speed"] = given
    return replace(GROUND_TRUTH, fingers=fingers)


def test_nothing_slides_that_is_not_held_or_not_touched():
    """Sliding that began in the glitch counts until it is over, but not once it is released."""
    released = count_glitches(sliding((GLITCH + 0.05, 9.9)))
    assert released.distances == [pytest.approx(0.01 * (9.5 - GLITCH - 0.05), rel=0.01)]
    moved = sliding((GLITCH + 0.05, GLITCH + 0.25))
    fingers = {
        f: {**own, "contact_force": np.zeros((len(TIMES), 3))} for f, own in moved.fingers.items()
    }
    assert count_glitches(replace(moved, fingers=fingers)).distances == [0.0]


def test_glitches_are_counted_with_the_distance_that_the_object_slides():
    calm = count_glitches(sliding())
    assert calm.distances == [0.0]
    assert calm.grasped_seconds == pytest.approx(7.2, abs=0.01)
    moved = count_glitches(sliding((5.6, 5.9), (GLITCH + 0.05, GLITCH + 0.25)))
    assert moved.distances == [pytest.approx(2e-3, rel=0.01)]
    assert count_glitches(sliding((GLITCH + 0.2, GLITCH + 0.3))).distances == [0.0]
    assert count_glitches(None).distances == []
