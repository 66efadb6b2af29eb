import itertools

import numpy as np
import pytest

from holdfast.errors import SourceError
from holdfast.live.teaching.protocol import GraspResult, GuidedProtocol, Stage
from holdfast.live.teaching.steps import STEPS, Check
from live.teaching.build import FREE, HEALTH, HOLD, MOVED, PULL, SENSORS, STILL, Feeder, step

LIGHT = (5.0, 0.0, 0.0)


def test_the_steps_are_what_the_twin_has_scripts_for():
    from holdfast.twin.scripted import SCRIPTS

    assert [x.name for x in STEPS] == list(SCRIPTS)
    assert sum(x.n_grasps * x.n_actions for x in STEPS if x.slides) >= 24
    assert sum(x.n_grasps * x.seconds for x in STEPS) < 240
    assert all(len(x.words) <= 24 for x in STEPS)


def test_a_grasp_goes_through_its_stages():
    hand = Feeder(HOLD)
    protocol, seen = hand.protocol, []
    states = {Stage.GRASP: STILL, Stage.ACT: STILL}
    while protocol.stage is not Stage.CHECK:
        seen.append((protocol.stage, protocol.recording))
        hand.feed(30.0, states.get(protocol.stage, FREE))
    assert seen == [
        (Stage.OPEN, False), (Stage.TARE, True), (Stage.GRASP, True), (Stage.ACT, True),
        (Stage.RELEASE, True),
    ]  # fmt: skip
    assert not protocol.recording
    assert hand.markers == ["teach: hold begins", "teach: hold ends"]
    protocol.checked("001-hold", 9.0)
    assert (protocol.stage, protocol.passed) == (Stage.DECIDE, True)
    assert protocol.press("next") == []
    assert protocol.stage is Stage.OVER
    (result,) = protocol.results
    assert (result.name, result.number, result.kept, result.recording) == (
        "hold", 1, True, "001-hold"
    )  # fmt: skip


@pytest.mark.parametrize("at_once", [2, 7, 10_000])
def test_pieces_of_any_size_give_the_same_stages_and_markers(at_once):
    def stages(pieces):
        hand = Feeder(HOLD, at_once=pieces)
        parts = [(2.0, FREE), (3.0, STILL), (4.0, MOVED), (2.0, STILL), (4.0, FREE)]
        for seconds, state in parts:
            end = hand.time + seconds
            while hand.time < end - 1e-9:
                hand.feed(end - hand.time, state)
        hand.protocol.checked("x", 1.0)
        return hand.markers, hand.protocol.stage, hand.protocol.message

    assert stages(at_once) == stages(1)


def test_a_touch_while_the_zero_is_taken_begins_again():
    hand = Feeder(HOLD)
    hand.until(Stage.TARE)
    assert hand.feed(1.0, STILL) is Stage.OPEN
    assert hand.protocol.view().message == "in contact: thumb, index"


def test_a_lost_object_ends_a_grasp_early():
    hand = Feeder(HOLD)
    hand.grasp((0.5, STILL, (100.0, 0, 0)), (30.0, FREE, (0.0, 0, 0)))
    hand.protocol.checked("x", 1.0)
    assert not hand.protocol.passed
    assert hand.protocol.message == "held for 0 s only, 4 s expected"


def test_skin_that_creeps_back_counts_as_open_after_a_while():
    hand = Feeder(HOLD)
    hand.until(Stage.GRASP)
    hand.until(Stage.ACT, STILL)
    hand.until(Stage.RELEASE, STILL)
    began = hand.time
    assert hand.feed(60.0, STILL, (15.0, 0.0, 0.0)) is Stage.CHECK
    assert hand.time - began == pytest.approx(3.0, abs=0.05)


@pytest.mark.parametrize("stage", [Stage.OPEN, Stage.GRASP, Stage.RELEASE])
def test_a_hand_that_never_does_it_is_an_error(stage):
    hand = Feeder(HOLD)
    if stage is not Stage.OPEN:
        hand.until(Stage.GRASP)
    if stage is Stage.RELEASE:
        hand.until(Stage.ACT, STILL)
        hand.until(Stage.RELEASE, STILL)
    touching = "no finger" if stage is Stage.GRASP else "thumb, index"
    with pytest.raises(SourceError, match=f"60 s in step hold .*{touching} in contact"):
        hand.feed(61.0, FREE if stage is Stage.GRASP else STILL)


def moved(n):
    return list(itertools.chain(*[((0.4, MOVED, (100.0, 0, 0)), (0.5, STILL, (100.0, 0, 0)))] * n))


CHECKS = {
    "carried": (step(Check.CARRIED, "carry"),
                [(0.5, STILL, (100.0, 0, 0)), (0.5, STILL, (120.0, 0, 0))], None, True,
                "held for 4 s, the force changed by 18 %"),
    "not carried": (step(Check.CARRIED, "carry"), [(1.0, STILL, (100.0, 0, 0))], None, False,
                    "the force changed by 0 % only: carry it faster"),
    "tapped": (step(Check.FELT, "tap", n_actions=4), moved(4), 0, True, "5 movements felt"),
    "a tap that slides": (step(Check.FELT, "tap", n_actions=4), moved(4), 1, True,
                          "5 movements felt; 1 slid, and teach as slips"),
    "not tapped": (step(Check.FELT, "tap", n_actions=4), [(9.0, STILL, (100.0, 0, 0))], 0, False,
                   "0 of 4 felt: tap a little harder"),
    "slid": (PULL, moved(4), 3, True, "3 slides seen"),
    "slid once": (PULL, moved(4), 1, False, "one slide seen: pull a little farther"),
    "no slide": (PULL, moved(4), 0, False, "no slide seen: pull a little farther"),
    "no camera": (PULL, moved(4), None, False, "no camera saw whether it slid"),
}  # fmt: skip


@pytest.mark.parametrize("case", CHECKS)
def test_each_check_can_pass_and_fail(case):
    asked, parts, n_slides, passed, message = CHECKS[case]
    protocol = Feeder(asked).grasp(*parts)
    protocol.checked("x", 9.0, n_slides)
    assert (protocol.passed, protocol.message) == (passed, message)
    view = protocol.view()
    assert (view.words, view.message) == ("GOOD" if passed else "NOT YET", message)


def test_an_open_hand_is_checked_by_its_health():
    hand = Feeder(HEALTH)
    hand.until(Stage.CHECK)
    assert hand.markers == ["teach: open begins", "teach: open ends"]
    hand.protocol.checked("001-open", 4.0)
    assert hand.protocol.passed
    assert hand.protocol.message == "is this your hand: 2 modules, anyskin (5 taxels, 100 Hz)?"


def test_dead_taxels_are_named_and_a_short_check_fails():
    for asked, passed, words in (
        (HEALTH, True, "taxel 4 of index is dead"),
        (step(Check.HEALTH, "open", seconds=0.1), False, "at least 20 expected"),
    ):
        hand = Feeder(asked)
        hand.until(Stage.ACT)
        hand.until(Stage.CHECK, noise=0.0)
        hand.protocol.checked("x", 4.0)
        assert hand.protocol.passed is passed
        assert words in hand.protocol.message


def decided(*keys, steps=(HOLD, PULL)):
    """Stage, step, number and results after grasps that are decided by these keys."""
    hand = Feeder(*steps)
    for key in keys:
        hand.grasp(*moved(9))
        hand.protocol.checked(f"{len(hand.protocol.results):03d}", 9.0, 3)
        hand.protocol.press(key)
    protocol = hand.protocol
    kept = [(x.name, x.number, x.kept) for x in protocol.results]
    return protocol.step.name, protocol.number, kept


def test_keys_repeat_go_on_and_skip():
    assert decided("next") == ("pull", 1, [("hold", 1, True)])
    assert decided("repeat") == ("hold", 1, [("hold", 1, False)])
    assert decided("next", "next", "repeat") == (
        "pull", 2, [("hold", 1, True), ("pull", 1, True), ("pull", 2, False)]
    )  # fmt: skip
    name, _, kept = decided("next", "skip")
    assert (name, kept) == (
        "pull", [("hold", 1, True), ("pull", 1, False), ("pull", 1, False), ("pull", 2, False)]
    )  # fmt: skip


@pytest.mark.parametrize("n_slides", [0, 3])
def test_a_grasp_that_has_passed_is_kept_when_the_protocol_is_stopped(n_slides):
    protocol = Feeder(PULL).grasp(*moved(4))
    protocol.checked("001-pull", 9.0, n_slides)
    protocol.press("quit")
    assert [(x.recording, x.kept) for x in protocol.results] == [("001-pull", n_slides == 3)]


def test_a_robot_begins_and_ends_a_step_by_its_markers():
    hand = Feeder(HOLD)
    hand.until(Stage.GRASP)
    assert hand.protocol.press("next") == ["teach: hold begins"]
    hand.feed(0.5, STILL)
    assert hand.protocol.press("next") == ["teach: hold ends"]
    assert hand.protocol.stage is Stage.RELEASE
    assert hand.protocol.press("next") == []


def test_a_grasp_can_be_repeated_while_it_runs_and_the_protocol_be_stopped():
    hand = Feeder(HOLD)
    hand.until(Stage.GRASP)
    hand.protocol.press("repeat")
    assert (hand.protocol.stage, hand.protocol.results, hand.protocol.n_begun) == (
        Stage.OPEN, [], 2
    )  # fmt: skip
    hand.protocol.press("quit")
    assert (hand.protocol.stage, hand.protocol.stopped) == (Stage.OVER, True)
    assert hand.protocol.press("next") == []


def test_a_protocol_goes_on_at_its_step():
    done = [
        GraspResult("hold", 1, 9.0, True, "001-hold"),
        GraspResult("pull", 1, 9.0, False, "002-pull"),  # repeated
        GraspResult("pull", 2, 0.0, False),  # skipped
    ]
    protocol = GuidedProtocol(SENSORS, done, (HOLD, PULL))
    assert (protocol.step.name, protocol.number, protocol.n_grasps) == ("pull", 1, 3)
    all_done = [*done, GraspResult("pull", 1, 9.0, True, "003-pull")]
    assert GuidedProtocol(SENSORS, all_done, (HOLD, PULL)).stage is Stage.OVER


def test_views_have_words_and_the_time_that_is_left():
    hand = Feeder(PULL)
    assert hand.protocol.view()[:3] == (
        "step 1 of 1: pull, grasp 1 of 2", "OPEN THE HAND", "Nothing may touch it."
    )  # fmt: skip
    hand.until(Stage.GRASP)
    assert hand.protocol.view().hint == "Then: pull it."
    hand.until(Stage.ACT, STILL)
    hand.feed(1.0, MOVED)
    view = hand.protocol.view()
    assert (view.words, view.message) == ("PULL IT", "1 felt")
    np.testing.assert_allclose((view.left, view.share), (3.0, 0.25), atol=0.02)
