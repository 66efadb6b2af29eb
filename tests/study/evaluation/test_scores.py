import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.study.evaluation.scores import HandScores


def score(least, known=None, alone=None, rate=100.0):
    least = np.array(least, dtype=float)
    n = len(least)
    return HandScores(
        times=np.arange(n) / rate,
        least=least,
        known=np.ones(n, dtype=bool) if known is None else np.array(known, dtype=bool),
        alone=np.zeros(n, dtype=bool) if alone is None else np.array(alone, dtype=bool),
        probability=np.full(n, 0.5),
    )


def test_one_bad_sample_is_held():
    found = score([1, 1, -1, 1, 1, 1, 1, 1]).held(0.03).states()
    assert found.tolist() == [STABLE] * 2 + [UNSTABLE] * 3 + [STABLE] * 3


def test_nothing_is_held_where_too_few_touch_or_a_finger_is_unknown():
    alone, known = [0, 0, 0, 1, 0, 0], [1, 1, 1, 1, 0, 1]
    found = score([1, 1, -1, np.inf, 1, 1], known, alone).held(0.04).states()
    assert found.tolist() == [STABLE, STABLE, UNSTABLE, NO_CONTACT, UNKNOWN, UNSTABLE]


def test_no_time_holds_nothing():
    bare = score([1, -1, 1, -1, 1])
    assert bare.held(0.0).states().tolist() == bare.states().tolist()


@pytest.mark.parametrize("shift", [-0.5, 0.0, 0.5])
def test_to_hold_the_score_is_to_hold_the_states(shift):
    rng = np.random.default_rng(0)
    bare = score(rng.normal(1.0, 1.0, size=300))
    states, expected = bare.states(shift), []
    for k in range(len(states)):
        recent = states[max(0, k - 4) : k + 1]
        expected.append(UNSTABLE if (recent == UNSTABLE).any() else states[k])
    assert bare.held(0.05).states(shift).tolist() == expected
