import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE, Cause
from holdfast.labelling.rules.base import Drawing, Pen, certainty

TIMES = np.arange(10.0)
PEN = Pen("rule:test", lambda state, cause, ratio: f"{state} {cause} {ratio:g}", note="made up")


def part(start, stop):
    return (start <= TIMES) & (stop > TIMES)


def test_what_is_painted_is_drawn():
    drawing = Drawing.blank(TIMES)
    drawing.paint(part(1, 8), STABLE, None, 4.0)
    drawing.paint(part(4, 6), UNSTABLE, Cause.SLIP, np.arange(10.0))
    found = PEN.labels(drawing, (0.0, 10.0))
    assert [(x.start, x.end, x.state, x.cause) for x in found] == [
        (1, 4, "STABLE", None),
        (4, 6, "UNSTABLE", "slip"),
        (6, 8, "STABLE", None),
    ]
    assert found[1].evidence == "UNSTABLE slip 4.25; made up"
    assert found[0].author == "rule:test"


def test_labels_are_cut_to_the_module():
    drawing = Drawing.blank(TIMES)
    drawing.paint(part(0, 5), NO_CONTACT)
    drawing.paint(part(5, 10), STABLE)
    found = PEN.labels(drawing, (6.5, 9.25))
    assert [(x.start, x.end) for x in found] == [(6.5, 9.25)]


def test_another_cause_is_another_label():
    drawing = Drawing.blank(TIMES)
    drawing.paint(part(0, 6), UNSTABLE, Cause.SLIP)
    drawing.recause(part(3, 6), Cause.RELEASED)
    causes = [label.cause for label in PEN.labels(drawing, (0, 10))]
    assert causes == [Cause.SLIP, Cause.RELEASED]


def test_nothing_painted_nothing_drawn():
    assert PEN.labels(Drawing.blank(TIMES), (0, 10)) == ()


def test_a_pen_that_is_not_trusted_draws_doubtful_labels():
    drawing = Drawing.blank(TIMES)
    drawing.paint(part(0, 6), STABLE, None, 100.0)
    (sure,) = PEN.labels(drawing, (0, 10))
    (unsure,) = Pen("a", PEN.evidence, trust=0.5).labels(drawing, (0, 10))
    assert unsure.confidence == pytest.approx(sure.confidence / 2, abs=0.001)


@given(st.floats(1, 1e9), st.floats(1, 1e9), st.floats(1e-3, 1e4), st.floats(1e-3, 1e4))
def test_more_evidence_and_more_time_are_never_less_sure(ratio, other, duration, longer):
    low, high = sorted((ratio, other))
    short, long = sorted((duration, longer))
    assert 0 <= certainty(low, short) <= certainty(high, short) <= certainty(high, long) <= 1
