import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.labelling.review.confidence import doubtful
from holdfast.recordings import Label


def label(start, end, confidence):
    return Label(start, end, "STABLE", confidence=confidence)


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
    with pytest.raises(ValueError, match="80 given"):
        doubtful({}, below=80)
