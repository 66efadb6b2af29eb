from dataclasses import replace

import numpy as np
import pytest

from holdfast.features import Tare
from holdfast_lab.study.methods import hand_signal
from holdfast_lab.study.paper import claims
from holdfast_lab.study.paper.claims import (
    GRIP,
    SETTLES,
    ClaimData,
    claim_effect,
    settling_fall,
    sliding_samples,
    verdict,
    window_mean,
)
from holdfast_lab.study.plan import StudyPlan, scan_corpus
from study.example_recordings import recording_with_truth, save_all


def test_verdicts_follow_from_value_and_interval():
    assert verdict(GRIP, 1.2, (0.4, 2.0)) == "supported"
    assert verdict(GRIP, 0.6, (0.4, 0.8)) == "right direction, too small"
    assert verdict(GRIP, 0.6, (-0.1, 2.0)) == "undecided"
    assert verdict(GRIP, -0.6, (-0.9, -0.1)) == "refuted"
    assert verdict(SETTLES, 1.6, (1.2, 2.0)) == "supported"
    assert verdict(SETTLES, 0.9, (0.8, 0.95)) == "refuted"
    assert verdict(SETTLES, 1.6, None) == verdict(SETTLES, None, None) == "undecided"


def regression_data(exponent, n=50, seed=0):
    """Recordings whose log energy is 2 + exponent log force + 0.5 log speed."""
    generator = np.random.default_rng(seed)
    found = []
    for _ in range(4):
        table = np.column_stack([np.ones(n), generator.normal(size=(n, 2))])
        log_energy = table @ (2.0, exponent, 0.5)
        found.append(
            ClaimData(n, (table.T @ table).ravel().tolist(), (table.T @ log_energy).tolist(), [])
        )
    return found


def test_the_exponent_is_that_of_the_force_at_equal_speed():
    effect, interval, n = claim_effect(GRIP, regression_data(1.7), 0)
    assert effect == pytest.approx(1.7) and n == 4
    assert interval == (pytest.approx(1.7), pytest.approx(1.7))


def test_recordings_without_slips_are_left_out():
    none = ClaimData(0, [0.0] * 9, [0.0] * 3, [])
    assert claim_effect(GRIP, [none], 0) == (None, None, 0)
    assert claim_effect(GRIP, [none, *regression_data(1.0)], 0)[2] == 4


def test_the_ratio_of_sigma_is_geometric():
    data = [ClaimData(0, [0.0] * 9, [0.0] * 3, np.log(each).tolist()) for each in ([2, 8], [4])]
    effect, _, n = claim_effect(SETTLES, data, 0)
    assert effect == pytest.approx(4.0) and n == 2


def test_the_mean_of_a_window():
    assert window_mean(np.array([1.0, 3.0, 5.0, 1.0]), 2)[1:].tolist() == [2, 4, 3]
    assert np.isnan(window_mean(np.ones(3), 4)).all()


RECORDING = recording_with_truth("grasp", 3)
SIGNAL = hand_signal(RECORDING, Tare.parse("0.5"), ("thumb", "index")).fingers


def test_only_windows_that_slide_count():
    """The thumb slides at 10 mm/s for 0.3 and 0.2 s; a window with 2 samples of it is at 1.4."""
    table, log_energy = sliding_samples(SIGNAL["thumb"], RECORDING.truth, "thumb")
    assert len(table) == len(log_energy) == (45 + 11) + (30 + 11)
    assert table[:, 1] == pytest.approx(np.log(2.0))
    assert np.exp(table[:, 2]).max() == pytest.approx(0.01)
    assert len(sliding_samples(SIGNAL["index"], RECORDING.truth, "index")[0]) == 0


def test_sigma_that_falls_after_a_second_gives_the_logarithm_of_its_ratio():
    signal = SIGNAL["thumb"]
    generator = np.random.default_rng(0)
    early = (signal.times < 3.3)[:, None]
    force = generator.normal(size=signal.force.shape) * np.where(early, 4.0, 1.0) + (1000, 0, 0)
    fall = settling_fall(replace(signal, force=force), RECORDING.truth)
    assert fall == pytest.approx(np.log(4.0), abs=0.15)


def test_the_table_has_both_claims(tmp_path):
    made = [recording_with_truth(f"grasp-{s}", s) for s in range(2)]
    plan = StudyPlan({"main": scan_corpus("main", save_all(tmp_path / "main", made))})
    results = {task.name: task.function(*task.arguments) for task in claims.tasks(plan)}
    (table,) = claims.tables(plan, results)
    assert {row.keys["claim"] for row in table.rows} == {GRIP.claim, SETTLES.claim}
    expected = {r.ours for r in table.rows if r.keys["figure"] == "expected, at least"}
    assert expected == {1.0, 1.5}
    assert GRIP.reason in table.note and SETTLES.reason in table.note
