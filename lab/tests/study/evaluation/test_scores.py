import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast_lab.study.evaluation.scores import Scores


def hand_scores(margin, known=None, grasped=None, rate=100.0):
    margin = np.array(margin, dtype=float)
    n = len(margin)
    return Scores(
        times=np.arange(n) / rate,
        margin=margin,
        known=np.ones(n, dtype=bool) if known is None else np.array(known, dtype=bool),
        grasped=np.ones(n, dtype=bool) if grasped is None else np.array(grasped, dtype=bool),
        probability=np.full(n, 0.5),
    )


def test_an_unstable_sample_is_held():
    found = hand_scores([1, 1, -1, 1, 1, 1, 1, 1]).hold(0.03).states()
    assert found.tolist() == [STABLE] * 2 + [UNSTABLE] * 3 + [STABLE] * 3


def test_no_state_is_held_without_a_grasped_object_or_with_an_unknown_finger():
    grasped, known = [1, 1, 1, 0, 1, 1], [1, 1, 1, 1, 0, 1]
    found = hand_scores([1, 1, -1, np.inf, 1, 1], known, grasped).hold(0.04).states()
    assert found.tolist() == [STABLE, STABLE, UNSTABLE, NO_CONTACT, UNKNOWN, UNSTABLE]


def test_a_hold_time_of_zero_changes_nothing():
    bare = hand_scores([1, -1, 1, -1, 1])
    assert bare.hold(0.0).states().tolist() == bare.states().tolist()


@pytest.mark.parametrize("shift", [-0.5, 0.0, 0.5])
def test_holding_the_scores_equals_holding_the_states(shift):
    rng = np.random.default_rng(0)
    bare = hand_scores(rng.normal(1.0, 1.0, size=300))
    states, expected = bare.states(shift), []
    for k in range(len(states)):
        recent = states[max(0, k - 4) : k + 1]
        expected.append(UNSTABLE if (recent == UNSTABLE).any() else states[k])
    assert bare.hold(0.05).states(shift).tolist() == expected
