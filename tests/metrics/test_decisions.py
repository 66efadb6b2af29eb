import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import FingerDecisions, hand_decisions

from . import naive


def finger(times, states, labels=None):
    nothing = np.full(len(times), np.nan)
    return FingerDecisions(times, states if labels is None else labels, states, nothing)


def test_a_finger_holds_its_code_and_is_unknown_before_its_first_sample():
    thumb = finger([0.0, 1.0], [STABLE, NO_CONTACT])
    index = finger([0.5, 1.0, 2.0], [STABLE, STABLE, UNSTABLE])
    hand = hand_decisions({"thumb": thumb, "index": index}, 2)
    assert hand.times.tolist() == [0.0, 0.5, 1.0, 2.0]
    assert hand.states.tolist() == [UNKNOWN, STABLE, NO_CONTACT, UNSTABLE]
    assert np.isnan(hand.stable_probability).all()


def test_one_finger_holds_where_the_model_has_one():
    thumb = finger([0.0], [STABLE])
    assert hand_decisions({"thumb": thumb}, 1).states.tolist() == [STABLE]
    assert hand_decisions({"thumb": thumb}, 4).states.tolist() == [NO_CONTACT]


def test_no_fingers_make_an_empty_hand():
    assert hand_decisions({}, 4).times.shape == (0,)


def test_a_finger_without_samples_is_unknown():
    hand = hand_decisions({"thumb": finger([0.0], [STABLE]), "index": finger([], [])}, 1)
    assert hand.states.tolist() == [UNKNOWN]


tracks = st.lists(
    st.lists(st.tuples(st.integers(0, 30), st.integers(0, 3)), unique_by=lambda pair: pair[0]),
    min_size=1,
    max_size=4,
)


@given(tracks, st.integers(1, 4))
def test_the_hand_without_its_dead_fingers_equals_one_instant_after_another(raw, n_model_fingers):
    """Two in three UNKNOWN samples are dead."""
    pairs = [sorted(track) for track in raw]
    each = [([t for t, _ in track], [c or 4 * (t % 3 > 0) for t, c in track]) for track in pairs]
    fingers = {
        str(i): replace(finger(times, np.array(codes, dtype=int) % 4), dead=np.array(codes) == 4)
        for i, (times, codes) in enumerate(each)
    }
    hand = hand_decisions(fingers, n_model_fingers)
    assert hand.states.tolist() == naive.hand(each, hand.times, n_model_fingers)


@given(tracks, st.integers(1, 4))
def test_the_hand_equals_one_instant_after_another(raw, n_model_fingers):
    pairs = [sorted(track) for track in raw]
    each = [([t for t, _ in track], [c for _, c in track]) for track in pairs]
    fingers = {str(i): finger(times, codes) for i, (times, codes) in enumerate(each)}
    hand = hand_decisions(fingers, n_model_fingers)
    assert hand.states.tolist() == naive.hand(each, hand.times, n_model_fingers)
    assert hand.labels.tolist() == hand.states.tolist()


def test_values_are_read_only_and_leave_the_input_alone():
    times = np.array([0.0, 1.0])
    decisions = finger(times, [STABLE, STABLE])
    with pytest.raises(ValueError, match="read-only"):
        decisions.times[0] = 5.0
    times[0] = 0.5


def test_lengths_that_differ_are_refused():
    message = "arrays of one shape (n,) expected; given times (2,), labels (1,), states (2,), "
    with pytest.raises(ValueError, match=re.escape(message)):
        finger([0.0, 1.0], [STABLE, STABLE], labels=[STABLE])


@pytest.mark.parametrize("times", [[1.0, 0.0], [0.0, 0.0], [0.0, np.nan]])
def test_times_that_do_not_increase_are_refused(times):
    with pytest.raises(ValueError, match="times"):
        finger(times, [STABLE, STABLE])
