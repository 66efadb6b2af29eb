"""Impacts: their momentum, their truth and their labels."""

import msgspec
import numpy as np
import pytest

from holdfast.io import load_recording, save_recording
from holdfast.twin import simulation
from holdfast.twin.impacts import (
    NO_IMPACT,
    REST_MARGIN,
    Impact,
    ImpactKind,
    draw_impacts,
    impact_state,
)
from holdfast.twin.profile import profile
from holdfast.twin.simulation import Grasp, Simulation

PERIOD = 1 / 150
CHOSEN = profile("coupled")
SHORT = msgspec.structs.replace(CHOSEN, idle=(0.7, 0.8), hold=6.0, grip=3.0)
UP = np.array([0.0, 0.0, 1.0])


def impact(kind, start=1.0, size=0.01, rise=0.004):
    decay = 0.1 if kind == "bump" else 0.0
    return Impact(
        ImpactKind(kind), start, start + rise + 3 * decay, rise, size, UP,
        np.array([0.01, 0.0, 0.0]), 8.0, decay,
    )  # fmt: skip


def states(event, seconds=3.0, shift=0.0):
    return [
        impact_state([event], shift + k * PERIOD, PERIOD) for k in range(round(seconds / PERIOD))
    ]


@pytest.mark.parametrize("kind", ["knock", "tap"])
@pytest.mark.parametrize("rise", [0.002, 0.008, 0.03])
@pytest.mark.parametrize("shift", [0.0, 0.0031])
def test_a_blow_gives_its_momentum_whatever_the_samples(kind, rise, shift):
    found = states(impact(kind, rise=rise), shift=shift)
    force, torque = (np.array([getattr(s, name) for s in found]) for name in ("force", "torque"))
    np.testing.assert_allclose(force.sum(axis=0) * PERIOD, 0.01 * UP, atol=1e-12)
    np.testing.assert_allclose(torque.sum(axis=0) * PERIOD, [0.0, -1e-4, 0.0], atol=1e-12)
    assert all(state.kind == kind for state in found if state.force.any())
    assert sum(state.kind == kind for state in found) <= 2 + rise / PERIOD
    assert not np.array([state.acceleration for state in found]).any()


def test_after_a_bump_the_hand_is_at_rest_again():
    found = states(impact("bump", size=0.05, rise=0.02))
    speed = np.cumsum([state.acceleration[2] for state in found]) * PERIOD
    assert 0.02 < speed.max() < 0.05
    assert speed.min() < -0.005  # it rings
    assert abs(speed[-1]) < 0.05 * np.exp(-3)
    assert not np.array([state.force for state in found]).any()


def test_at_most_one_is_drawn_in_a_rest_and_away_from_disturbances():
    rests = [(0.0, 1.2), (2.0, 2.5), (3.0, 5.0), (7.0, 8.0)] * 50
    drawn = draw_impacts(np.random.default_rng(3), CHOSEN.impacts, rests)
    assert 0.7 * 150 < len(drawn) < 0.9 * 150  # a rest of 0.5 s is too short
    assert {event.kind for event in drawn} == set(ImpactKind)
    for event in drawn:
        assert any(a + REST_MARGIN <= event.start <= b - REST_MARGIN for a, b in rests)
        assert abs(np.linalg.norm(event.direction) - 1) < 1e-12
        assert abs(event.arm @ event.direction) < 1e-12
    assert draw_impacts(np.random.default_rng(3), CHOSEN.impacts, []) == []
    assert impact_state(drawn, -1.0, PERIOD) is NO_IMPACT


@pytest.fixture(scope="module")
def recording():
    """A grasp with one impact of each kind and no other disturbance."""
    blows = [impact("knock", 2.0), impact("tap", 3.0), impact("bump", 4.0, 0.04, 0.02)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation, "profile", lambda _: SHORT)
        grasp = Grasp("can", 1, 1, profile="coupled", seed=2, glitch_rate=0.0)
        plan = simulation.draw_plan(grasp, SHORT)._replace(impacts=blows)
        run = Simulation(grasp, plan=plan)
        while not run.is_over:
            run.step()
    return run.recording()


@pytest.mark.slow
class TestTruth:
    def test_kinds_and_times(self, recording):
        truth, lock = recording.truth, recording.metadata["locked_at"]
        for kind, start, end in (("knock", 2, 2.004), ("tap", 3, 3.004), ("bump", 4, 4.32)):
            times = truth.times[truth.hand["impact"] == kind]
            assert times[0] == pytest.approx(lock + start, abs=1.01 * PERIOD)
            assert times[-1] == pytest.approx(lock + end, abs=1.01 * PERIOD)
            assert set(truth.hand["phase"][truth.hand["impact"] == kind]) <= {
                "disturbed",
                "slipping",
            }

    def test_they_shake_the_object_and_the_file_keeps_them(self, recording, tmp_path):
        save_recording(recording, tmp_path / "one.parquet")
        again = load_recording(tmp_path / "one.parquet")
        assert again.truth.hand["impact"].tolist() == recording.truth.hand["impact"].tolist()
        force = np.linalg.norm(again.truth.fingers["index"]["contact_force"], axis=1)
        times, lock = again.truth.times, again.metadata["locked_at"]
        quiet = np.ptp(force[(times > lock + 1.5) & (times < lock + 1.95)])
        for start in (2, 3, 4):
            around = (times > lock + start - 0.02) & (times < lock + start + 0.2)
            assert np.ptp(force[around]) > 2 * quiet
