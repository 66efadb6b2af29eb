import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE, Cause
from holdfast.labelling.rules.base import (
    MAX_RATIO,
    LabelWriter,
    StateTimeline,
    evidence_ratio,
    label_confidence,
)

TIMES = np.arange(10.0)
WRITER = LabelWriter(
    "rule:test", lambda state, cause, ratio: f"{state} {cause} {ratio:g}", note="made up"
)


def part(start, stop):
    return (start <= TIMES) & (stop > TIMES)


def test_later_states_replace_earlier_ones():
    timeline = StateTimeline.unknown(TIMES)
    timeline.set_state(part(1, 8), STABLE, None, 4.0)
    timeline.set_state(part(4, 6), UNSTABLE, Cause.SLIP, np.arange(10.0))
    found = WRITER.labels(timeline, (0.0, 10.0))
    assert [(x.start, x.end, x.state, x.cause) for x in found] == [
        (1, 4, "STABLE", None),
        (4, 6, "UNSTABLE", "slip"),
        (6, 8, "STABLE", None),
    ]
    assert found[1].evidence == "UNSTABLE slip 4.25; made up"
    assert found[0].author == "rule:test"


def test_labels_are_cut_to_the_module():
    timeline = StateTimeline.unknown(TIMES)
    timeline.set_state(part(0, 5), NO_CONTACT)
    timeline.set_state(part(5, 10), STABLE)
    found = WRITER.labels(timeline, (6.5, 9.25))
    assert [(x.start, x.end) for x in found] == [(6.5, 9.25)]


def test_a_writer_with_less_trust_makes_labels_of_less_confidence():
    timeline = StateTimeline.unknown(TIMES)
    timeline.set_state(part(0, 6), STABLE, None, 100.0)
    (sure,) = WRITER.labels(timeline, (0, 10))
    (unsure,) = LabelWriter("a", WRITER.evidence, trust=0.5).labels(timeline, (0, 10))
    assert unsure.confidence == pytest.approx(sure.confidence / 2, abs=0.001)


@given(st.floats(1, 1e9), st.floats(1, 1e9), st.floats(1e-3, 1e4), st.floats(1e-3, 1e4))
def test_confidence_grows_with_evidence_and_duration(ratio, other, duration, longer):
    low, high = sorted((ratio, other))
    short, long = sorted((duration, longer))
    assert (
        0
        <= label_confidence(low, short)
        <= label_confidence(high, short)
        <= label_confidence(high, long)
        <= 1
    )


@given(quantity=st.floats(0, 1e300), threshold=st.floats(0, 1e300))
def test_an_evidence_ratio_is_finite_and_positive_whatever_the_threshold(quantity, threshold):
    (ratio,) = evidence_ratio([quantity], threshold)
    assert 1 / MAX_RATIO <= ratio <= MAX_RATIO
    assert (ratio > 1) == (quantity > threshold) or abs(ratio - 1) < 1e-12
