import itertools
import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import (
    NO_CONTACT,
    STABLE,
    UNKNOWN,
    UNSTABLE,
    Cause,
    ContactEstimate,
    ContactState,
    Fault,
    HandEstimate,
    Reason,
    StateChanges,
    enough_contacts,
    faults_of,
    hand_state,
    hand_states,
    taxels_of,
    with_faults,
)
from holdfast.kernel.structs import n_mask_words

NAMES = {"-": NO_CONTACT, "S": STABLE, "U": UNSTABLE, "?": UNKNOWN}


def test_codes_are_positions_in_the_list():
    assert [state.code for state in ContactState] == [0, 1, 2, 3]
    assert [
        ContactState(name).code for name in ("UNKNOWN", "NO_CONTACT", "UNSTABLE", "STABLE")
    ] == [
        UNKNOWN,
        NO_CONTACT,
        UNSTABLE,
        STABLE,
    ]


@pytest.mark.parametrize(
    ("kind", "first"), [(ContactState, 0), (Reason, 0), (Fault, 0), (Cause, 1)]
)
def test_a_code_becomes_its_word(kind, first):
    codes = range(first, first + len(kind))
    assert [kind(code) for code in codes] == list(kind)
    assert [kind(np.int8(code)) for code in codes] == list(kind)
    for wrong in (first - 1, codes.stop, 1.5, "other"):
        with pytest.raises(ValueError, match=f"{wrong!r}"):
            kind(wrong)


@pytest.mark.parametrize(
    ("fingers", "n_model_fingers", "expected"),
    [  # x: dead
        ("Sx", 2, STABLE),
        ("-xx", 4, NO_CONTACT),
        ("S-x", 4, NO_CONTACT),
        ("SSx", 4, STABLE),
        ("?x", 4, UNKNOWN),
        ("Ux", 4, UNSTABLE),
        ("xx", 4, UNKNOWN),
        ("x", 1, UNKNOWN),
        ("S", 1, STABLE),
        ("-", 1, NO_CONTACT),
        ("U", 1, UNSTABLE),
        ("?", 1, UNKNOWN),
        ("S", 2, NO_CONTACT),
        ("S-", 2, NO_CONTACT),
        ("SS", 2, STABLE),
        ("SS--", 4, STABLE),
        ("SSSS", 4, STABLE),
        ("----", 4, NO_CONTACT),
        ("SSS?", 4, UNKNOWN),
        ("---?", 4, UNKNOWN),
        ("SU-?", 4, UNSTABLE),
        ("?U", 2, UNSTABLE),
        ("U?", 2, UNSTABLE),
        ("", 4, NO_CONTACT),
    ],
)
def test_state_of_a_hand(fingers, n_model_fingers, expected):
    codes = np.array([NAMES[name] for name in fingers if name != "x"], dtype=np.int8)
    assert hand_state(codes, n_model_fingers, fingers.count("x")) == expected


@given(st.lists(st.sampled_from(list(NAMES.values())), max_size=5), st.integers(1, 4))
def test_the_state_of_a_hand_at_many_instants_is_by_the_same_rule(codes, n_model_fingers):
    fingers = np.array(codes, dtype=np.int8)
    held = enough_contacts(np.array([(fingers == STABLE).sum()]), n_model_fingers)
    (found,) = hand_states(np.array([UNSTABLE in codes]), np.array([UNKNOWN in codes]), held)
    assert found == hand_state(fingers, n_model_fingers)


@given(st.lists(st.sampled_from(list(NAMES.values())), min_size=2, max_size=5))
def test_the_order_of_fingers_does_not_matter(codes):
    states = {
        hand_state(np.array(order, dtype=np.int8), len(codes))
        for order in itertools.permutations(codes)
    }
    assert len(states) == 1


def test_estimates_can_be_written_as_json():
    finger = ContactEstimate(1.0, ContactState.STABLE, Reason.NONE, 0.9, 2.0, (1.0, 0.0, 0.0))
    hand = HandEstimate(1.0, ContactState.STABLE, {"thumb": finger})
    assert msgspec.json.decode(msgspec.json.encode(hand))["fingers"]["thumb"] == {
        "time": 1.0,
        "state": "STABLE",
        "reason": "",
        "stable_probability": 0.9,
        "instability": 2.0,
        "force": [1.0, 0.0, 0.0],
        "faults": [],
        "faulty_taxels": [],
        "cause": None,
        "slip_probability": None,
        "slip_speed": None,
        "slip_distance": None,
    }
    with pytest.raises(AttributeError):
        finger.state = ContactState.UNSTABLE


@given(st.sets(st.integers(0, 511)), st.integers(512, 600))
def test_bits_are_taxels(taxels, n_taxels):
    mask = sum(1 << taxel for taxel in taxels)
    words = [mask >> 64 * k & (1 << 64) - 1 for k in range(n_mask_words(n_taxels))]
    assert taxels_of(np.array(words, np.uint64)) == tuple(sorted(taxels))


@given(st.sets(st.sampled_from(Fault)))
def test_bits_are_faults(faults):
    order = list(Fault)
    found = faults_of(sum(1 << order.index(fault) for fault in faults))
    assert found == tuple(fault for fault in Fault if fault in faults)


def hand(states, faults=()):
    fingers = {
        name: ContactEstimate(3.0, state, Reason.NONE, 0.5, 2.0, (1.0, 2.0, 3.0), faults, (7,))
        for name, state in states.items()
    }
    codes = np.array([state.code for state in states.values()], dtype=np.int64)
    return HandEstimate(3.5, tuple(ContactState)[hand_state(codes, len(states))], fingers)


HELD = hand({"thumb": ContactState.STABLE, "index": ContactState.STABLE})


class TestWithFaults:
    def test_the_named_finger_is_unknown_and_the_hand_with_it(self):
        found = with_faults(HELD, {"index": (Fault.LATE,)}, 2)
        index = found.fingers["index"]
        assert (index.state, index.reason, index.faults) == (
            ContactState.UNKNOWN, Reason.FAULT, (Fault.LATE,),
        )  # fmt: skip
        assert np.isnan(index.stable_probability)
        assert (index.time, index.instability, index.force) == (3.0, 2.0, (1.0, 2.0, 3.0))
        assert index.faulty_taxels == (7,)
        assert found.fingers["thumb"] is HELD.fingers["thumb"]
        assert (found.time, found.state) == (3.5, ContactState.UNKNOWN)
        assert HELD.fingers["index"].state is ContactState.STABLE

    def test_an_unstable_finger_still_makes_the_hand_unstable(self):
        shaken = hand({"thumb": ContactState.UNSTABLE, "index": ContactState.STABLE})
        assert with_faults(shaken, {"index": (Fault.LATE,)}, 2).state is ContactState.UNSTABLE

    @pytest.mark.parametrize("named", [{}, {"ring": (Fault.LATE,)}])
    def test_unknown_fingers_change_nothing(self, named):
        assert with_faults(HELD, named, 2) is HELD

    @given(
        before=st.lists(st.sampled_from(Fault), unique=True),
        more=st.lists(st.sampled_from(Fault)),
    )
    def test_faults_are_in_order_and_once(self, before, more):
        one = hand({"thumb": ContactState.STABLE}, tuple(before))
        found = with_faults(one, {"thumb": tuple(more)}, 1).fingers["thumb"].faults
        assert list(found) == [fault for fault in Fault if fault in before or fault in more]


STATES_OF_A_FINGER = st.lists(st.sampled_from(list(ContactState)), min_size=1, max_size=60)
PERIOD = 0.01


def reported(states, min_duration):
    changes = StateChanges(min_duration)
    pairs = enumerate(states)
    return [e for k, state in pairs for e in changes.update({"thumb": state}, k * PERIOD)]


@given(STATES_OF_A_FINGER)
def test_a_duration_below_the_tolerance_reports_every_change(states):
    assert reported(states, 1e-9) == reported(states, 0.0)


@given(STATES_OF_A_FINGER, st.integers(1, 10))
def test_a_reported_state_lasted_and_the_chain_has_no_gap(states, n):
    previous = ContactState.UNKNOWN
    for change in reported(states, n * PERIOD):
        begin = round(change.time / PERIOD)
        assert set(states[begin : begin + n + 1]) == {change.state}
        assert len(states) > begin + n
        assert change.previous is previous is not change.state
        previous = change.state


@pytest.mark.parametrize("duration", [-0.1, math.nan, math.inf])
def test_a_wrong_duration(duration):
    with pytest.raises(ValueError, match=f"{duration} given"):
        StateChanges(duration)
