import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import ContactState, StateChanges
from holdfast.live.lasting_changes import LastingChanges

STATES = st.lists(st.sampled_from(list(ContactState)), min_size=1, max_size=60)
PERIOD = 0.01


def reported(states, min_duration):
    changes = LastingChanges(["thumb"], min_duration)
    return [e for k, state in enumerate(states) for e in changes.update([state], k * PERIOD)]


@given(STATES)
def test_without_a_duration_every_change_is_reported(states):
    every = StateChanges(["thumb"])
    expected = [e for k, state in enumerate(states) for e in every.update([state], k * PERIOD)]
    assert reported(states, 0.0) == expected


@given(STATES, st.integers(1, 10))
def test_a_reported_state_lasted_and_the_chain_has_no_gap(states, n):
    previous = ContactState.UNKNOWN
    for change in reported(states, n * PERIOD):
        begin = round(change.time / PERIOD)
        assert set(states[begin : begin + n + 1]) == {change.state}
        assert len(states) > begin + n
        assert change.previous is previous is not change.state
        previous = change.state


def test_a_flicker_is_no_change():
    s, u = ContactState.STABLE, ContactState.UNSTABLE
    (change,) = reported([s] * 20 + [u] * 3 + [s] * 20 + [u] * 3, 0.05)
    assert (change.state, change.time) == (s, 0.0)


def test_each_name_has_its_own_states():
    s, u = ContactState.STABLE, ContactState.UNSTABLE
    changes = LastingChanges(["thumb", "hand"], 0.0)
    assert [e.finger for e in changes.update([s, u], 0.0)] == ["thumb", "hand"]
    assert [e.finger for e in changes.update([s, s], 0.1)] == ["hand"]


@pytest.mark.parametrize("duration", [-0.1, math.nan, math.inf])
def test_a_wrong_duration(duration):
    with pytest.raises(ValueError, match=f"at least 0 s expected, {duration} given"):
        LastingChanges(["thumb"], duration)
