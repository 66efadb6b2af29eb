from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE, ContactState
from holdfast.labelling.review.spans import Span, doubtful, spans_of, state_name
from holdfast.recordings import Label, label_states, labels_from_samples

LETTERS = {"n": ContactState.NO_CONTACT, "u": ContactState.UNSTABLE, "s": ContactState.STABLE}


@given(st.text("nus ", min_size=1, max_size=12), st.randoms())
def test_spans_have_the_intervals_of_the_labels(text, random):
    times = np.arange(float(len(text)))
    each = [
        label
        for k, c in enumerate(text)
        if c != " "
        for label in labels_from_samples(times[k : k + 1], [(LETTERS[c], None)], period=1.0)
    ]
    expected = label_states(each, times).tolist()
    random.shuffle(each)
    codes = [0] * len(text)
    spans = spans_of(each)
    for span in spans:
        codes[int(span.start) : int(span.end)] = [span.code] * int(span.end - span.start)
    assert codes == expected
    assert all(a.end < b.start or a.state != b.state for a, b in pairwise(spans))


def test_a_gap_separates_labels_of_one_state():
    labels = [Label(0.0, 1.0, ContactState.STABLE), Label(1.01, 2.0, ContactState.STABLE)]
    assert len(spans_of(labels)) == 2


def test_states_have_names_and_codes():
    names = [state_name(state) for state in list(ContactState)[1:]]
    assert names == ["no_contact", "unstable", "stable"]
    codes = [Span(0.0, 1.0, name).code for name in names]
    assert codes == [NO_CONTACT, UNSTABLE, STABLE]


def test_overlap_is_the_common_duration():
    span = Span(1.0, 3.0, "stable")
    assert span.overlap(Span(2.5, 9.0, "stable")) == 0.5
    assert span.overlap(Span(3.0, 9.0, "stable")) == 0.0
    assert span.overlap(Span(0.0, 0.5, "stable")) == pytest.approx(-0.5)


def label(start, end, confidence):
    return Label(start, end, "STABLE", confidence=confidence)


def test_the_most_doubtful_comes_first():
    labels = {
        "thumb": (label(0, 1, 0.9), label(1, 2, 0.5), label(2, 3, 0.79)),
        "index": (label(0, 1, 0.1), label(1, 2, 0.8)),
    }
    found = [(finger, each.confidence) for finger, each in doubtful(labels)]
    assert found == [("index", 0.1), ("thumb", 0.5), ("thumb", 0.79)]


def test_of_equal_confidence_the_longest_comes_first_and_then_the_earliest():
    labels = {"b": [label(5, 6, 0.3), label(0, 2, 0.3)], "a": [label(0, 1, 0.3)]}
    found = [(finger, each.start) for finger, each in doubtful(labels)]
    assert found == [("b", 0), ("a", 0), ("b", 5)]


@given(st.dictionaries(st.text(max_size=3), st.lists(st.floats(0, 1)), max_size=3), st.floats(0, 1))
def test_only_labels_below_the_limit(confidences, below):
    labels = {
        finger: [label(k, k + 1, each) for k, each in enumerate(given)]
        for finger, given in confidences.items()
    }
    found = [(finger, each.confidence) for finger, each in doubtful(labels, below)]
    every = [(finger, c) for finger, given in confidences.items() for c in given if c < below]
    assert sorted(found) == sorted(every)
    assert [c for _, c in found] == sorted(c for _, c in found)


def test_invalid_confidence():
    with pytest.raises(ValueError, match="a confidence from 0 to 1 expected, 80 given"):
        doubtful({}, below=80)
