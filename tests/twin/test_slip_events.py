import math
from itertools import pairwise

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from holdfast.twin.objects import object_named
from holdfast.twin.operator import draw_tremor
from holdfast.twin.profile import profile
from holdfast.twin.protocol import THUMB_SHARE, Plan
from holdfast.twin.simulation import Grasp, Simulation
from holdfast.twin.slip_events import (
    RATE_FIELDS,
    SlipEvent,
    SlipEvents,
    SlipKind,
    draw_course,
)
from holdfast.twin.steps import guide_wrench

PERIOD = 1 / 150
GRAVITY = 9.81
CHOSEN = profile("slips")
ALONE = (SlipKind.WEIGHT, SlipKind.GRIP, SlipKind.FRICTION)
RATE = {
    "weight": 0.2, "grip": 0.4, "friction": 0.8, "creep": 0.002, "twist": 0.15, "turn": 0.1,
    "roll": 0.3,
}  # fmt: skip
SIZE = {"friction": 0.3, "creep": math.pi, "roll": 0.25}


def event(kind, start=1.0, duration=4.0, distance=0.001):
    return SlipEvent(
        SlipKind(kind), start, duration, distance, RATE[kind], SIZE.get(kind, 0.0), 1.0, 0.1,
        3000.0, 12.0, 5e-6,
    )  # fmt: skip


def body(position=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    rotation = Rotation.from_rotvec(turn).as_matrix().ravel()
    return np.concatenate([position, rotation, np.zeros(6)])


def run(events, slip=lambda _: 0.0, seconds=7.0, pose=None):
    """States of a table on which the slip is given, by the time after the lock."""
    runner = SlipEvents(events, object_named("can"), PERIOD)
    states = {}
    for k in range(round(seconds / PERIOD)):
        at = body() if pose is None or k == 0 else pose
        state = runner.step(k * PERIOD, slip(k * PERIOD), at)
        guide = state.load.guide.copy()
        states[k * PERIOD] = state._replace(load=state.load._replace(guide=guide))
    return runner, states


def at(states, time):
    return states[min(states, key=lambda key: abs(key - time))]


class TestCourse:
    @pytest.mark.parametrize("seed", range(10))
    def test_events_and_disturbances_do_not_overlap(self, seed):
        disturbances, events = draw_course(np.random.default_rng(seed), CHOSEN, CHOSEN.slips)
        spans = [(d.start, d.start + d.duration) for d in disturbances]
        spans = sorted(spans + [(e.start, e.end) for e in events])
        assert spans[0][0] >= 1.0 and spans[-1][1] <= CHOSEN.hold - 1.0
        rests = [b[0] - a[1] for a, b in pairwise(spans)]
        assert min(rests) >= CHOSEN.rest[0] - 1e-9
        assert max(rests) <= CHOSEN.rest[1] + 1e-9

    def test_all_kinds_come_in_turn_with_numbers_of_the_profile(self):
        ranges = CHOSEN.slips
        for seed in range(30):
            _, events = draw_course(np.random.default_rng(seed), CHOSEN, ranges)
            first = [e.kind for e in events[: len(SlipKind)]]
            assert len(set(first)) == len(first)
            for e in events:
                low, high = getattr(ranges, RATE_FIELDS[e.kind])
                assert low <= e.rate <= high
                assert ranges.distance[0] <= e.distance <= ranges.distance[1]
                assert 0 < e.duration <= ranges.longest


class TestRunner:
    def test_nothing_acts_before_and_after(self):
        runner, states = run([event("weight", duration=2.0)])
        for state in (state for time, state in states.items() if time < 0.99 or time > 3.2):
            assert state.load.added_mass == 0.0 and not state.touching
            assert (state.grip_scale, state.load.friction) == (1.0, 1.0)
            assert not state.load.guide.any() and not state.load.torque.any()
        (record,) = runner.records
        assert record["kind"] == "weight" and record["slid"] == 0.0
        assert record["end"] == pytest.approx(3.1, abs=2 * PERIOD)

    @pytest.mark.parametrize(
        ("kind", "change"),
        [
            ("weight", lambda state: state.load.added_mass),
            ("grip", lambda state: 1.0 - state.grip_scale),
            ("friction", lambda state: 1.0 - state.load.friction),
            ("twist", lambda state: np.linalg.norm(state.load.torque)),
        ],
    )
    def test_a_change_grows_at_its_rate_and_goes_away_after_a_slip(self, kind, change):
        slip = lambda time: 0.02 if time >= 1.5 else 0.0  # noqa: E731
        runner, states = run([event(kind)], slip)
        assert change(at(states, 1.25)) == pytest.approx(0.25 * RATE[kind], rel=0.05)
        ended = 1.5 + 0.001 / 0.02
        assert change(at(states, ended)) == pytest.approx((ended - 1.0) * RATE[kind], rel=0.05)
        assert change(at(states, ended + 0.12)) == 0.0
        assert runner.records[0]["end"] == pytest.approx(ended + 0.1, abs=3 * PERIOD)
        assert runner.records[0]["slid"] > 0.001

    def test_a_hand_pulls_until_it_slides_and_then_goes_steadily(self):
        slip = lambda time: 0.002 if time >= 1.6 else 0.0  # noqa: E731
        _, states = run([event("creep", distance=0.004)], slip)
        guides = {time: state.load.guide for time, state in states.items()}
        speeds = [guides[time][14] for time in sorted(guides)]
        assert at(states, 1.1).load.guide[14] == 0.0  # it closes first
        assert at(states, 1.4).load.guide[14] == pytest.approx(-12.0 / 3000.0)
        assert at(states, 2.0).load.guide[14] == pytest.approx(-RATE["creep"])
        lasting = at(states, 2.0).load.guide[2] - at(states, 1.8).load.guide[2]
        assert lasting == pytest.approx(-0.2 * RATE["creep"], rel=0.05)
        assert min(speeds) < 0 == max(speeds)


class TestGuide:
    def wrench(self, pose, guide, ahead=0.0):
        tremor = draw_tremor(np.random.default_rng(0))
        return np.array(guide_wrench(pose, guide, ahead, tremor, 0.3))

    def guide(self, velocity=(0, 0, 0), spin=(0, 0, 0)):
        return np.array([*body()[:12], *velocity, *spin, 800.0, 9.0, 0.7, 0.006, 0.0])

    def test_does_nothing_to_an_object_that_follows_it(self):
        pose = body((0.001, 0.0, 0.0), (0.0, 0.002, 0.0))
        pose[12:] = [0.1, 0.0, 0.0, 0.0, 0.2, 0.0]
        follows = self.wrench(pose, self.guide((0.1, 0, 0), (0, 0.2, 0)), ahead=0.01)
        np.testing.assert_allclose(follows, 0.0, atol=1e-6)

    def test_is_a_spring_that_resists_displacement_and_turning(self):
        pulled = self.wrench(body((0.001, 0.0, -0.002), (0.0, 0.0, 0.01)), self.guide())
        np.testing.assert_allclose(pulled, [-0.8, 0, 1.6, 0, 0, -0.007], atol=1e-5)


def held(kind, name="can", **words):
    """Recording of one event of a grasp without glitches, with all else at rest."""
    chosen = msgspec.structs.replace(CHOSEN, hold=7.0, glitch_rate=0.0)
    grips = 2.0 * np.array([3 * THUMB_SHARE, 1.0, 1.0, 1.0])
    plan = Plan(chosen, grips, 0.03, 0.5, 0.3, (), [event(kind, **words)])
    simulation = Simulation(Grasp(name, 2, 1, "slips", glitch_rate=0.0), plan=plan)
    while not simulation.is_over:
        simulation.step()
    return simulation.recording()


@pytest.fixture(scope="module")
def recordings():
    return {kind: held(kind) for kind in SlipKind}


def sliding(recording):
    speeds = [finger["slip_speed"] for finger in recording.truth.fingers.values()]
    return np.max(speeds, axis=0) > 0.001


def since_lock(recording):
    return recording.truth.times - recording.metadata["locked_at"]


@pytest.mark.slow
class TestSimulated:
    @pytest.mark.parametrize("kind", list(SlipKind))
    def test_the_object_slides_recovers_and_the_event_is_named(self, recordings, kind):
        recording = recordings[kind]
        (record,) = recording.metadata["slip_events"]
        assert record["kind"] == kind
        times = recording.truth.times
        inside = (times >= record["start"]) & (times < record["end"])
        assert (sliding(recording) & inside).any()
        assert recording.metadata["lost_at"] is None
        rested = (times > record["end"] + 0.5) & (since_lock(recording) < 6.7)
        assert rested.sum() > 50
        assert not sliding(recording)[rested].any()
        for scale in ("grip_scale", "friction_scale"):
            np.testing.assert_array_equal(recording.truth.hand[scale][rested], 1.0)
        total = sum(
            f["contact_force"][rested].mean(axis=0) for f in recording.truth.fingers.values()
        )
        np.testing.assert_allclose(total, [0, 0, 0.24 * GRAVITY], atol=0.02 * 0.24 * GRAVITY)

    @pytest.mark.parametrize("kind", [k for k in SlipKind if k not in ALONE])
    def test_an_operator_who_touches_disturbs(self, recordings, kind):
        recording = recordings[kind]
        (record,) = recording.metadata["slip_events"]
        times, phase = recording.truth.times, recording.truth.hand["phase"]
        touched = np.isin(phase, ("disturbed", "slipping"))
        inside = (times >= record["start"] - 2 * PERIOD) & (times < record["end"] + 2 * PERIOD)
        assert touched[inside].mean() > 0.6
        assert not touched[~inside].any()
        assert (phase[inside] == "slipping").any()
