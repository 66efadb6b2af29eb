import itertools

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
    ContactEstimate,
    ContactState,
    HandEstimate,
    Reason,
    hand_state,
)

NAMES = {"-": NO_CONTACT, "S": STABLE, "U": UNSTABLE, "?": UNKNOWN}


def test_codes_are_places_in_the_list():
    assert [state.code for state in ContactState] == [0, 1, 2, 3]
    assert [
        ContactState(name).code for name in ("UNKNOWN", "NO_CONTACT", "UNSTABLE", "STABLE")
    ] == [
        UNKNOWN,
        NO_CONTACT,
        UNSTABLE,
        STABLE,
    ]


def test_no_label_is_unknown():
    assert ContactState.UNKNOWN.code == 0


@pytest.mark.parametrize(
    ("fingers", "n_model_fingers", "expected"),
    [
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
    codes = np.array([NAMES[name] for name in fingers], dtype=np.int8)
    assert hand_state(codes, n_model_fingers) == expected


@given(st.lists(st.sampled_from(list(NAMES.values())), min_size=2, max_size=5))
def test_the_order_of_fingers_does_not_matter(codes):
    states = {
        hand_state(np.array(order, dtype=np.int8), len(codes))
        for order in itertools.permutations(codes)
    }
    assert len(states) == 1


def test_estimates_are_values_that_json_takes():
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
    }
    with pytest.raises(AttributeError):
        finger.state = ContactState.UNSTABLE
