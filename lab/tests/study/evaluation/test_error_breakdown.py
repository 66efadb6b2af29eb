from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import Decisions, FingerDecisions
from holdfast.recordings import Truth
from holdfast_lab.study.evaluation.error_breakdown import break_down_errors, calibration_counts
from study.example_recordings import PUSH, truth_of

TIMES = np.arange(1725) / 150
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
    (push,) = found.disturbances
    assert (push.direction, push.n, push.n_wrong) == ("down", 358, 358)
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
    assert [p.direction for p in breakdown_of(np.full(1725, STABLE), turned).disturbances] == [
        direction
    ]


def test_a_whole_hand_method_has_phases_and_disturbances_but_no_grips():
    found = breakdown_of(np.full(1725, STABLE, dtype=np.int8), names=())
    assert found.phases["disturbed"] == (180, 180)
    assert found.disturbances[0].n == 179
    assert found.grips == []


def test_the_breakdown_is_empty_without_a_truth():
    found = break_down_errors(None, decided(np.full(1725, STABLE)))
    assert (found.phases, found.grips, found.disturbances) == ({}, [], [])


def test_calibration_counts_by_hand():
    labels, states = [STABLE, UNSTABLE, STABLE, STABLE], [STABLE, STABLE, UNSTABLE, UNKNOWN]
    finger = FingerDecisions(np.arange(4.0), labels, states, [0.95, 0.91, 0.05, np.nan])
    table = np.array(calibration_counts(Decisions("one", {"thumb": finger})))
    assert table[9] == pytest.approx([1.86, 1, 2])
    assert table[0] == pytest.approx([0.05, 1, 1])
    assert table[1:9].sum() == 0
    as_hand = replace(Decisions("one", {}), hand=finger)
    assert (np.array(calibration_counts(as_hand)) == table).all()
