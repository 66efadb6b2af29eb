import pytest

from holdfast.contact import Cause
from holdfast.errors import RecordingError
from holdfast.labelling.rules import command

from .build import CLOSING, FREE, LOCKED, PUSH, PUSHED, RELEASE, check, grasp

MARKERS = (
    (CLOSING - 0.5, "closing"),
    (LOCKED, "locked"),
    (PUSH, "disturbance"),
    (PUSHED, "locked"),
    (RELEASE, "released"),
)
EDGE = 0.1


def test_markers_of_the_protocol():
    for labels in command.propose(grasp(markers=MARKERS)).values():
        check(labels, EDGE)
        causes = [label.cause for label in labels]
        expected = [None, Cause.CLOSING, None, Cause.DISTURBANCE, None, Cause.RELEASED, None]
        assert causes == expected
        assert {label.author for label in labels} == {"rule:command"}
        assert [label.evidence for label in labels][2:4] == [
            "marker: locked",
            "marker: disturbance",
        ]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("c", None),
        ("mark", None),
        ("", None),
        ("no contact", "free"),
        ("slip", "slip"),
        ("slip over", "locked"),
        ("disturbance stopped", "locked"),
        ("released", "released"),
        ("object lost", "lost"),
        ("Grasp", "closing"),
    ],
)
def test_the_command_of_a_marker(text, word):
    assert command.command_word(text) == word


def test_a_disturbance_without_an_end_has_less_confidence():
    ended = command.propose(grasp(markers=MARKERS))["thumb"][3]
    again = [*MARKERS[:3], (PUSH + 0.4, "disturbance"), *MARKERS[3:]]
    open_end = command.propose(grasp(markers=again))["thumb"][3]
    assert (ended.start, ended.end) == (open_end.start, open_end.end)
    assert open_end.confidence < ended.confidence


def test_nothing_is_labelled_before_a_first_marker_that_is_not_closing():
    labels = command.propose(grasp(markers=((LOCKED, "locked"), (RELEASE, "released"))))["thumb"]
    assert labels[0].state == "STABLE"
    assert labels[0].start == pytest.approx(LOCKED, abs=0.02)


def test_a_lost_object():
    labels = command.propose(grasp(markers=(*MARKERS[:4], (FREE, "lost"))))["thumb"]
    assert (labels[-1].state, labels[-1].cause) == ("NO_CONTACT", Cause.LOST)


@pytest.mark.parametrize(
    ("markers", "shown"),
    [
        ((), "it has none"),
        (((1.0, "mark"), (2.0, "mark 1"), (3.0, "mark")), "'mark', 'mark 1'"),
    ],
)
def test_no_marker_with_a_known_word(markers, shown):
    with pytest.raises(RecordingError, match=shown):
        command.propose(grasp(markers=markers))
