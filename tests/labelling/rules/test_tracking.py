import re
from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import Cause
from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.labelling.rules import tracking
from holdfast.labelling.rules.poses import Poses, PoseTrack, in_sight
from holdfast.labelling.rules.tracking import TrackingRule
from holdfast.recordings import Recording, Truth, label_states

from .build import (
    CLOSING,
    LOCKED,
    PUSH,
    PUSHED,
    RELEASE,
    check,
    clock,
    grasp,
    module,
    poses,
    slide,
    tracked,
)

EDGE = 0.25  # margin, smoothing, and a sample
MOVES = ((CLOSING, LOCKED), (PUSH, PUSHED), (RELEASE, 9.5))


def sliding(jitter=0.0, **more):
    times = clock()
    return tracked(poses(times, slide(times, MOVES), jitter=jitter), **more)


def test_a_grasp_is_labelled_by_motion():
    for labels in tracking.propose(sliding()).values():
        check(labels, EDGE)
        causes = [label.cause for label in labels]
        push = [Cause.DISTURBANCE, Cause.SLIP, Cause.DISTURBANCE]
        assert causes == [None, Cause.CLOSING, None, *push, None, Cause.RELEASED, None]


def slips_of(labels):
    return [(label.start, label.end) for label in labels if label.cause is Cause.SLIP]


def test_a_slip_is_an_interval_of_its_own_within_the_disturbance():
    labels = tracking.propose(sliding())["thumb"]
    ((start, end),) = slips_of(labels)
    assert start == pytest.approx(PUSH, abs=0.02)
    assert end == pytest.approx(PUSHED, abs=0.02)
    index = next(k for k, label in enumerate(labels) if label.cause is Cause.SLIP)
    before, slip, after = labels[index - 1 : index + 2]
    assert (before.end, after.start) == (slip.start, slip.end)
    assert {label.state.value for label in (before, slip, after)} == {"UNSTABLE"}
    assert {label.author for label in labels} == {"rule:tracking"}
    assert all("poses: truth" in label.evidence for label in labels)


def test_displacement_has_a_slip_only_while_the_object_moves():
    times = clock()
    away = slide(times, ((PUSH, PUSH + 0.3),), speed=0.03)
    away -= slide(times, ((PUSH + 1.3, PUSH + 1.6),), speed=0.03)
    labels = tracking.propose(tracked(poses(times, away)), rule=TrackingRule("displacement"))
    (start, end), (back, _) = slips_of(labels["thumb"])
    assert PUSH < start < end
    assert (end, back) == (pytest.approx(PUSH + 0.3, abs=0.02), pytest.approx(PUSH + 1.3, abs=0.02))
    still = next(label for label in labels["thumb"] if label.start == end)
    assert (still.state.value, still.cause) == ("UNSTABLE", None)


def carried():
    times = clock()
    way = 0.5 * np.sin(times)[:, None] * [1.0, 0.2, 0.0]
    thing, tip = poses(times, slide(times, MOVES)), poses(times, 0 * times)
    thing[:, :3] += way
    tip[:, :3] += way
    return tracked(thing, tip)


def turning():
    times = clock()
    return tracked(poses(times, 0 * times, slide(times, MOVES, speed=0.5)))


GRASPS = {
    "carried by the hand": carried,
    "turning on the spot": turning,
    "jitter": lambda: sliding(jitter=0.0003),
}


@pytest.mark.parametrize("made", GRASPS.values(), ids=GRASPS)
def test_motion_against_the_finger_is_what_counts(made):
    check(tracking.propose(made())["thumb"], EDGE)


def test_another_start_of_the_clock_moves_the_labels():
    check(tracking.propose(sliding(start=1e5))["thumb"], EDGE, start=1e5)


def test_a_gap_in_the_poses_is_bridged_or_has_no_label():
    times = clock()
    thing = poses(times, slide(times, MOVES))
    thing[420:428] = np.nan
    thing[750:800] = np.nan
    codes = label_states(tracking.propose(tracked(thing))["thumb"], times)
    assert (codes[415:435] == 3).all()
    assert (codes[752:798] == 0).all()
    assert (codes[740:749] == 3).all()


def test_a_lost_object_is_out_of_sight_while_the_force_ends():
    times = clock()
    thing = poses(times, slide(times, ((CLOSING, LOCKED),)))
    thing[times > RELEASE + 0.2] = np.nan
    *_, last, gone = tracking.propose(tracked(thing))["thumb"]
    assert (last.state, last.cause) == ("UNSTABLE", Cause.LOST)
    assert (gone.state, gone.cause) == ("NO_CONTACT", Cause.LOST)


def test_a_frozen_marker_is_neither_motion_nor_rest():
    times = clock()
    pose = poses(times, slide(times, MOVES), jitter=1e-5)
    pose[400:600] = pose[400]
    recording = grasp(truth=Truth(times, {"marker_pose": pose}))
    codes = label_states(tracking.propose(recording)["thumb"], times)
    assert (codes[405:595] == 0).all()
    assert (codes[320:395] == 3).all()


@pytest.mark.parametrize("offset", [-0.3, 0.0, 0.22])
def test_another_clock_is_found(offset):
    times = clock()
    # A push moves the object as it shows in the force: forth and back.
    way = 0.01 * np.where((times > PUSH) & (times < PUSHED), np.sin(5 * np.pi * (times - PUSH)), 0)
    way = way + slide(times, ((CLOSING, LOCKED), (RELEASE, 9.5)))
    pose = poses(times, way, jitter=1e-5)
    other = Poses("file", PoseTrack(times - offset, pose[:, :3], pose[:, 3:]), same_clock=False)
    labels = tracking.propose(grasp(), tracking=other)["thumb"]
    check(labels, EDGE)
    found = re.search("later by (.*) s", labels[0].evidence)
    assert (float(found[1]) if found else 0.0) == pytest.approx(offset, abs=0.05)
    given = tracking.propose(grasp(), tracking=other, offset=offset)["thumb"]
    assert [x.start for x in given] == pytest.approx([x.start for x in labels], abs=0.05)


def test_unreliable_clocks_halve_the_confidence():
    times = clock()
    pose = poses(times, 0 * times, jitter=1e-4)
    other = Poses("file", PoseTrack(times, pose[:, :3], pose[:, 3:]), same_clock=False)
    free = {n: module(times, np.zeros((len(times), 3)), k) for k, n in enumerate(["thumb"])}
    (label,) = tracking.propose(Recording("nothing", free), tracking=other)["thumb"]
    assert label.confidence <= 0.5


def test_a_finger_without_poses_has_no_labels():
    recording = sliding(fingers=("thumb", "index", "ring"))
    assert set(tracking.propose(recording)) == {"thumb", "index"}


def at_another_time():
    truth = sliding().truth
    return replace(sliding(), truth=Truth(truth.times + 5000.0, truth.hand, truth.fingers))


BAD = {
    "no poses": (grasp, "'made-up'"),
    "another time": (at_another_time, r"5000 to 5011\.99 s"),
    "never in sight": (lambda: tracked(np.full((len(clock()), 7), np.nan)), "0 found"),
}


@pytest.mark.parametrize(("made", "text"), BAD.values(), ids=BAD)
def test_poses_that_cannot_be_used(made, text):
    with pytest.raises(RecordingError, match=text):
        tracking.propose(made())


def test_an_unknown_measure():
    with pytest.raises(ValueError, match="'way'"):
        TrackingRule(measure="way")


def test_real_marker_is_never_in_sight_at_the_sentinel(data_folder):
    (lost,) = [
        recording
        for recording in import_recordings(data_folder / "uskin_pick_move")
        if recording.name.endswith("08-10-01")
    ]
    labels = tracking.propose(lost, tare="first")["finger1"]
    assert (labels[-1].state, labels[-1].cause) == ("NO_CONTACT", Cause.LOST)
    own = next(x for x in lost.modules["finger1"].labels if x.cause is Cause.LOST)
    assert labels[-1].start == pytest.approx(own.start, abs=0.1)


def test_exact_poses_of_the_twin_are_not_checked_for_repeats():
    still = np.tile([0, 0, 0, 1.0, 0, 0, 0], (100, 1))
    track = PoseTrack(clock()[:100], still[:, :3], still[:, 3:])
    assert track.seen.all()
    assert not in_sight(track).seen.any()
