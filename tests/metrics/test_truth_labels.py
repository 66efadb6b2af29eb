from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.contact import Cause, ContactState, Phase
from holdfast.metrics.truth_labels import (
    LabelRule,
    common_onsets,
    labels_by_rule,
    labels_from_truth,
    phases_from_touch,
    without_margin,
)
from holdfast.recordings import Label, Truth, label_states

RATE = 150
RULE = LabelRule()
N, U, S = ContactState.NO_CONTACT, ContactState.UNSTABLE, ContactState.STABLE


def truth(*spans, force=None, slip=None, outside=None, glitch=None):
    """Spans of (seconds, phase, touching); the forces and slip are [(start, end, value)]."""
    phases, loads = [], []
    for seconds, phase, touching in spans:
        n = round(seconds * RATE)
        phases += [phase] * n
        loads += [2.0 * touching] * n
    times = np.arange(len(phases)) / RATE
    forces, speeds, outside_forces = np.array(loads, dtype=float), *np.zeros((2, len(phases)))
    changed = ((forces, force or ()), (speeds, slip or ()), (outside_forces, outside or ()))
    for column, changes in changed:
        for start, end, value in changes:
            column[(times > start - 1e-9) & (times < end - 1e-9)] = value
    vectors = forces[:, None] * [0.0, 0.6, 0.8]
    errors = np.zeros(len(phases))
    for start, end in glitch or ():
        errors[(times > start - 1e-9) & (times < end - 1e-9)] = 0.08
    finger = {"contact_force": vectors, "slip_speed": speeds}
    hand = {
        "phase": np.array(phases, dtype=str),
        "outside_force": outside_forces[:, None] * [0.0, 0.0, -1.0],
        "set_point_error": errors,
    }
    return Truth(times, hand, {"thumb": finger})


GRASP = (
    (1.0, Phase.FREE, False),
    (0.5, Phase.CLOSING, False),
    (0.5, Phase.CLOSING, True),
    (3.0, Phase.LOCKED, True),
    (0.5, Phase.RELEASED, True),
    (0.2, Phase.RELEASED, False),
    (1.0, Phase.FREE, False),
)


def disturbed(*disturbances, phase=Phase.DISTURBED, hold=6.0):
    """Locked for so long with disturbances at (start, seconds) in it."""
    spans, at = [], 0.0
    for start, seconds in disturbances:
        spans += [(start - at, Phase.LOCKED, True), (seconds, phase, True)]
        at = start + seconds
    return (*spans, (hold - at, Phase.LOCKED, True))


def label_rows(data, rule=None):
    return [
        (round(label.start, 2), round(label.end, 2), label.state, label.cause)
        for label in labels_from_truth(data, "thumb", rule)
    ]


def joined(rows):
    """Return start, end and state of the rows, those of one state that touch as one."""
    parts = []
    for start, end, state, _ in rows:
        if parts and parts[-1][2] == state and parts[-1][1] == start:
            parts[-1] = (parts[-1][0], end, state)
        else:
            parts.append((start, end, state))
    return parts


def test_a_grasp_without_disturbance():
    assert label_rows(truth(*GRASP)) == [
        (0.0, 1.5, N, None),
        (1.5, 2.0, U, Cause.CLOSING),
        (2.0, 5.0, S, None),
        (5.0, 5.5, U, Cause.RELEASED),
        (5.5, 6.7, N, None),  # set down, not lost
    ]


def test_an_object_held_by_the_operator_is_not_stable():
    handed_over = truth(*GRASP, outside=[(0.0, 2.3, 3.0), (4.8, 6.7, 3.0)])
    assert label_rows(handed_over) == [
        (0.0, 1.5, N, None),
        (1.5, 2.0, U, Cause.CLOSING),
        (2.0, pytest.approx(2.4, abs=0.011), U, Cause.DISTURBANCE),
        (pytest.approx(2.4, abs=0.011), pytest.approx(4.7, abs=0.011), S, None),
        (pytest.approx(4.7, abs=0.011), 5.0, U, Cause.DISTURBANCE),
        (5.0, 5.5, U, Cause.RELEASED),
        (5.5, 6.7, N, None),
    ]


def test_a_force_too_small_to_be_contact_does_not_count():
    assert label_rows(truth(*GRASP, outside=[(2.5, 3.0, 0.04)])) == label_rows(truth(*GRASP))


def test_labels_have_author_and_evidence():
    for label in labels_from_truth(truth(*GRASP), "thumb"):
        assert (label.author, label.evidence, label.confidence) == ("twin", "truth", 1.0)


def test_a_disturbance_is_an_interval_with_margins():
    assert label_rows(truth(*disturbed((2.0, 1.0)))) == [
        (0.0, 1.9, S, None),
        (1.9, pytest.approx(3.1, abs=0.011), U, Cause.DISTURBANCE),
        (pytest.approx(3.1, abs=0.011), 6.0, S, None),
    ]


@pytest.mark.parametrize(("gap", "n_intervals"), [(0.3, 1), (0.5, 2)])
def test_disturbances_soon_after_each_other_are_one(gap, n_intervals):
    data = truth(*disturbed((1.0, 0.5), (1.5 + gap, 0.5)))
    assert [row[2] for row in label_rows(data)].count(U) == n_intervals


def slipped_after_the_lock(rest):
    """Return a grasp with a slip that long after closing, beyond the margin."""
    start = 2.0 + rest + RULE.margin
    return truth(*GRASP, slip=[(start, start + 0.05, 0.01)])


@pytest.mark.parametrize("rest", [0.0, 0.04, 0.15, 0.3])
def test_a_short_gap_between_closing_and_the_first_slip_is_not_stable(rest):
    rows = joined(label_rows(slipped_after_the_lock(rest)))
    assert rows[1:3] == [(1.5, pytest.approx(2.25 + rest, abs=0.02), U), (rows[1][1], 5.0, S)]


def test_a_longer_gap_between_closing_and_the_first_slip_is_stable():
    rows = joined(label_rows(slipped_after_the_lock(0.4)))
    assert [row[2] for row in rows] == [N, U, S, U, S, U, N]
    assert rows[2][1] - rows[2][0] == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize(
    ("push", "touched"),
    [
        ("......", "LLLLLL"),  # it never touches
        (".xx...", "LDDLLL"),
        (".x..x.", "LDDDDL"),  # off the object within a shake
        ("xxxxxx", "DDDDDD"),
    ],
)
def test_a_disturbance_lasts_from_its_first_touch_to_its_last(push, touched):
    meanings = {"L": Phase.LOCKED, "D": Phase.DISTURBED, ".": 0.04, "x": 0.06}
    plan = [Phase.LOCKED] * 2 + [Phase.DISTURBED] * 6 + [Phase.LOCKED]
    forces = np.array([1.0, 0.0, *(meanings[mark] for mark in push), 1.0])
    wanted = [Phase.LOCKED] * 2 + [meanings[mark] for mark in touched] + [Phase.LOCKED]
    assert phases_from_touch(np.array(plan, dtype=str), forces, 0.05).tolist() == wanted


def test_a_slip_in_a_disturbance_is_an_interval_of_its_own():
    data = truth(*disturbed((1.0, 1.0), (4.0, 1.0)), slip=[(1.4, 1.45, 0.02)])
    rows = [row for row in label_rows(data) if row[2] == U]
    assert [row[3] for row in rows] == [Cause.DISTURBANCE, Cause.SLIP, *[Cause.DISTURBANCE] * 2]
    assert rows[1][:2] == (1.4, 1.45)


def test_sliding_without_a_push_is_a_slip():
    data = truth(*disturbed(), slip=[(2.0, 2.1, 0.002)])
    assert label_rows(data)[1:4] == [
        (1.9, 2.0, U, None), (2.0, 2.1, U, Cause.SLIP), (2.1, 2.2, U, None),
    ]  # fmt: skip
    assert label_rows(truth(*disturbed(), slip=[(2.0, 2.1, 0.0009)])) == [(0.0, 6.0, S, None)]


def test_a_shake_does_not_flicker():
    """The pushing finger leaves the object again and again: still one interval."""
    disturbances = [(1.0 + 0.2 * k, 0.1) for k in range(10)]
    data = truth(*disturbed(*disturbances), slip=[(s, s + 0.02, 0.05) for s, _ in disturbances])
    assert [row[2] for row in joined(label_rows(data))] == [S, U, S]


def test_an_object_that_falls_is_lost():
    data = truth(
        (2.0, Phase.LOCKED, True),
        (0.5, Phase.FREE, True),
        (1.0, Phase.FREE, False),
        (1.0, Phase.RELEASED, False),
        (1.0, Phase.FREE, False),
    )
    assert label_rows(data) == [
        (0.0, 2.0, S, None),
        (2.0, 2.5, U, Cause.LOST),
        (2.5, 3.5, N, Cause.LOST),
        (3.5, 5.5, N, None),
    ]


def test_a_grasp_never_locked_is_never_stable():
    rows = label_rows(truth((2.0, Phase.CLOSING, True), (0.5, Phase.RELEASED, True)))
    assert rows == [(0.0, 2.0, U, Cause.CLOSING), (2.0, 2.5, U, Cause.RELEASED)]


def test_thresholds_can_be_chosen():
    rule = LabelRule(contact=3.0)
    assert {row[2] for row in label_rows(truth(*GRASP), rule)} == {N}
    wide = LabelRule(margin=0.3)
    assert label_rows(truth(*disturbed((2.0, 1.0))), wide)[0][1] == 1.7
    merged = LabelRule(merge=1.0)
    disturbances = disturbed((1.0, 0.5), (2.2, 0.5))
    assert len(label_rows(truth(*disturbances), merged)) < len(label_rows(truth(*disturbances)))


@st.composite
def grasps(draw):
    phases = [Phase.FREE, Phase.CLOSING, Phase.LOCKED, Phase.DISTURBED, Phase.SLIPPING]
    spans = draw(
        st.lists(
            st.tuples(
                st.floats(0.02, 1.0), st.sampled_from([*phases, Phase.RELEASED]), st.booleans()
            ),
            min_size=1,
            max_size=12,
        )
    )
    slips = draw(st.lists(st.tuples(st.floats(0, 6), st.floats(0.01, 0.5)), max_size=4))
    return truth(*spans, slip=[(start, start + long, 0.01) for start, long in slips])


@settings(max_examples=60)
@given(grasps())
def test_laws(data):
    labels = labels_from_truth(data, "thumb")
    times = data.times
    assert (label_states(labels, times) > 0).all()  # every sample has a label
    assert labels[0].start == times[0]
    assert all(a.end == b.start for a, b in pairwise(labels))
    whole = times[-1] - times[0] + 1 / RATE
    assert sum(label.end - label.start for label in labels) == pytest.approx(whole)
    assert all((a.state, a.cause) != (b.state, b.cause) for a, b in pairwise(labels))
    phase = data.hand["phase"]
    for before, label, after in zip(labels, labels[1:], labels[2:], strict=False):
        unstable = after.cause in (Cause.SLIP, Cause.DISTURBANCE)
        if before.cause == Cause.CLOSING and label.state == S and unstable:
            assert label.end - label.start >= RULE.merge - 1e-9
    for label in labels:
        inside = (times >= label.start) & (times < label.end)
        if label.state == S:
            assert (phase[inside] == Phase.LOCKED).all()
            assert (data.fingers["thumb"]["slip_speed"][inside] <= RULE.sliding).all()
            assert label.cause is None
        if label.cause == Cause.SLIP:
            assert (data.fingers["thumb"]["slip_speed"][inside] > RULE.sliding).all()
        if label.cause in (Cause.SLIP, Cause.DISTURBANCE):
            held = np.isin(phase[inside], [Phase.LOCKED, Phase.DISTURBED, Phase.SLIPPING])
            assert held.all()


class TestGlitch:
    def test_is_unstable_until_the_hand_has_stopped_ringing(self):
        rows = label_rows(truth(*disturbed(), glitch=[(2.0, 2.02)]))
        assert rows[1] == (2.0, pytest.approx(2.12, abs=0.011), U, Cause.GLITCH)
        assert [row[2] for row in rows] == [S, U, S]

    def test_a_slip_that_it_causes_is_part_of_it(self):
        rows = label_rows(truth(*disturbed(), glitch=[(2.0, 2.02)], slip=[(2.05, 2.3, 0.01)]))
        assert [row[3] for row in rows] == [None, Cause.GLITCH, None]
        assert rows[1][1] == pytest.approx(2.3, abs=0.011)

    def test_is_not_labelled_where_the_rule_leaves_it_out(self):
        rule = LabelRule(glitch=None)
        assert len(label_rows(truth(*disturbed(), glitch=[(2.0, 2.02)]), rule)) == 1

    def test_with_an_empty_hand_it_is_not_labelled(self):
        rows = label_rows(truth(*GRASP, glitch=[(0.2, 0.3)]))
        assert Cause.GLITCH not in [row[3] for row in rows]


@pytest.mark.parametrize(
    ("author", "push", "spans"),
    [
        ("rule:signal", (1.0, 1.5), [(0.0, 1.1), (1.1, 1.5)]),
        ("rule:tracking", (1.0, 1.2), [(0.0, 1.1), (1.1, 1.2)]),
        ("rule:signal", (1.0, 1.05), [(0.0, 1.05)]),
        ("rule:signal", (1.2, 1.5), [(0.0, 1.0), (1.2, 1.5)]),
        ("rule:command", (1.0, 1.5), [(0.0, 1.0), (1.0, 1.5)]),
        ("a person", (1.0, 1.5), [(0.0, 1.0), (1.0, 1.5)]),
    ],
)
def test_the_margin_of_a_rule_before_an_onset(author, push, spans):
    labels = [Label(0.0, 1.0, "STABLE", author=author), Label(*push, "UNSTABLE", author=author)]
    assert [(x.start, x.end) for x in without_margin(labels)] == [
        pytest.approx(span) for span in spans
    ]
    assert labels_by_rule(labels) == author.startswith("rule:")


def test_an_exact_slip_within_the_margin_is_the_onset():
    author = "rule:tracking"
    labels = [
        Label(0.0, 1.0, "STABLE", author=author),
        Label(1.0, 1.04, "UNSTABLE", "disturbance", author=author),
        Label(1.04, 1.5, "UNSTABLE", "slip", author=author),
    ]
    assert [(x.start, x.end) for x in without_margin(labels)] == [(0.0, 1.04), (1.04, 1.5)]


@pytest.mark.parametrize(
    ("parts", "common"),
    [
        ((), "labels"),
        (("truth",), "truth"),
        (("truth", "labels"), "mixed"),
        (("truth", "rule"), "rule"),
        (("labels", "rule"), "rule"),
    ],
)
def test_where_onsets_of_several_recordings_come_from(parts, common):
    assert common_onsets(set(parts)) == common
