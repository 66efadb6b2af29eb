import math
from dataclasses import replace

import pytest

from holdfast.detection import Detector
from holdfast.twin.hand import RATE
from holdfast.twin.loads import Load, LoadKind
from holdfast.twin.simulation import Grasp
from holdfast_lab.trial.reference_rows import REFERENCE_ROWS, KnownLoad
from holdfast_lab.trial.run import RunningTrial, least_force_at, run_trial
from holdfast_lab.trial.trials import Trial, draw_trial, least_force

pytestmark = pytest.mark.slow

CAN = Trial(0, Grasp("can", 1, 1, seed=0), 4, Load(LoadKind.WEIGHT, 1.5, 0.0, 0.4), 0.03)


class TestLeastForce:
    def test_without_a_load_it_is_the_weight_over_friction(self):
        assert least_force_at(CAN, 1.0) == pytest.approx(least_force(CAN.grasp.item))

    def test_each_load_raises_it_as_coulomb_says(self):
        item = CAN.grasp.item
        expected = {
            Load(LoadKind.WEIGHT, 0.0, 0.0, item.mass): 2.0,
            Load(LoadKind.FRICTION, 0.0, 0.0, 0.5): 2.0,
            Load(LoadKind.TRANSPORT, 0.0, 4.0, 9.81, (0.0, 0.0, 1.0)): 2.0,
            Load(LoadKind.PULL, 0.0, 2.0, item.mass * 9.81): 2.0,
            Load(LoadKind.PULL, 0.0, 2.0, item.mass * 9.81, (0.0, 0.0, 1.0)): 0.0,
        }
        for load, ratio in expected.items():
            least = least_force_at(replace(CAN, load=load), 1.0)
            assert least == pytest.approx(ratio * least_force(item), abs=1e-9)


@pytest.fixture(scope="module")
def fixed():
    return run_trial(CAN, "fixed")


def test_a_fixed_grip_drops_what_is_too_heavy(fixed):
    assert (fixed.held, fixed.dropped, fixed.slipped) == (True, True, True)
    assert fixed.slip == fixed.reaction == math.inf
    assert fixed.drop_reason == "slip" and fixed.feasible
    assert fixed.force_ratio < fixed.static_ratio < fixed.coulomb_ratio + 0.1
    assert fixed.n_false == 0
    assert 0.8 < fixed.force_ratio < 2.0


def test_the_same_trial_gives_the_same_result(fixed):
    assert run_trial(CAN, "fixed") == fixed


def test_trials_of_any_law_begin_alike(fixed):
    other = run_trial(CAN, "holdfast")
    assert (other.held, other.quiet_time) == (fixed.held, fixed.quiet_time)
    assert other.slip < math.inf or other.dropped
    assert draw_trial(0).number == 0


def test_samples_arrive_late_by_the_latency(monkeypatch):
    seen, update = {}, Detector.update
    for latency in (0, 4):
        log = seen[latency] = []

        def record(detector, samples, time, log=log):
            log.append((time, samples["thumb"].copy()))
            return update(detector, samples, time)

        monkeypatch.setattr(Detector, "update", record)
        running = RunningTrial(replace(CAN, latency=latency), "fixed", "builtin:noise-floor")
        for _ in range(20):
            running.step()
    assert len(seen[4]) == len(seen[0]) - 4
    for (time, sample), (late, same) in zip(seen[0], seen[4], strict=False):
        assert late - time == pytest.approx(4 / RATE)
        assert (sample == same).all()


def test_a_law_that_knows_the_load_presses_by_its_multiple(monkeypatch):
    monkeypatch.setitem(REFERENCE_ROWS, "weaker", lambda: KnownLoad(1.5))
    weak, strong = (run_trial(CAN, row) for row in ("weaker", "true-load-2"))
    assert 1.4 < weak.static_ratio < strong.static_ratio < 2.1
