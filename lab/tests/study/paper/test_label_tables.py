from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import Cause, ContactState
from holdfast.recordings import Label
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.paper import label_tables
from holdfast_lab.study.paper.label_tables import (
    ALL_SAMPLES,
    CEILING,
    HELD_LABELS,
    HIDDEN,
    ceiling_rows,
)
from holdfast_lab.study.paper.visible_changes import (
    HiddenCounts,
    count_hidden,
    label_kinds,
    noise_limits,
    window_changes,
)
from holdfast_lab.study.plan import StudyPlan, scan_corpus
from study.example_recordings import recording_with_truth, save_all, save_synthetic


def module(readings):
    made = synthetic_recording("a", 0, ("thumb",)).modules["thumb"]
    n = len(readings)
    return replace(made, times=np.arange(n) / 150, readings=readings, labels=())


class TestWindowChanges:
    def test_one_taxel_by_hand(self):
        readings = np.zeros((6, 30, 3))
        readings[3, 4] = (0, 0, 8)  # one reading, at one sample
        found = window_changes(module(readings + 32768), 4)
        assert np.isnan(found[:3]).all()
        # at samples 3 to 5 the window of four samples holds it: its variance is 64 (1/4 - 1/16)
        assert found[3:, 1] == pytest.approx([8, 8, 8])
        assert found[3:, 2] == pytest.approx([12, 12, 12])
        z = module(readings).sensor.rotations[4][:, 2]
        assert found[3:, 0] == pytest.approx(8 * np.abs(z).max())

    def test_a_change_leaves_the_window(self):
        readings = np.zeros((9, 30, 3))
        readings[3:] = 5.0
        assert window_changes(module(readings), 4)[3:, 1].tolist() == [5, 5, 5, 0, 0, 0]

    def test_limits_are_those_of_the_rest(self):
        rest = np.column_stack([np.arange(101.0), np.zeros(101), np.full(101, 2.0)])
        assert noise_limits([rest, np.full((3, 3), np.nan)]).tolist() == [99.0, 0.0, 2.0]
        assert noise_limits([np.full((3, 3), np.nan)]) is None


def test_kinds_of_samples():
    labels = (
        Label(0.0, 0.02, ContactState.NO_CONTACT),
        Label(0.02, 0.04, ContactState.UNSTABLE, Cause.SLIP),
        Label(0.04, 0.06, ContactState.STABLE),
    )
    made = replace(module(np.zeros((9, 30, 3))), labels=labels)
    assert label_kinds(made) == ["", "", "", "slip", "slip", "slip", "stable", "stable", "stable"]


def test_shaking_is_visible_and_rest_is_not(tmp_path):
    corpus = scan_corpus("main", save_synthetic(tmp_path / "a", range(2)))
    for counts in count_hidden(corpus, 14):
        assert counts.samples["disturbance"] > 300
        assert counts.hidden["disturbance"] < 0.02 * counts.samples["disturbance"]
        # of three measures, each is exceeded in 1 % of the windows without contact
        assert counts.hidden["stable"] > 0.9 * counts.samples["stable"]


def test_the_rows_of_the_ceiling_by_hand():
    counts = [
        HiddenCounts({"slip": 10, "glitch": 30, "closing": 50, "stable": 100},
                     {"slip": 1, "glitch": 3, "closing": 9, "stable": 80}, 400),
        HiddenCounts({"slip": 10, "stable": 100}, {"slip": 5, "stable": 90}, 100),
    ]  # fmt: skip
    found = {(r.keys["cause"], r.keys["figure"]): r for r in ceiling_rows({}, counts, 0)}
    assert found["slip", "samples"].ours == 20 and found["glitch", "samples"].n == 1
    assert found["slip", HIDDEN].ours == pytest.approx(30)
    assert found["slip", CEILING].ours == pytest.approx(70)
    assert found[HELD_LABELS, HIDDEN].ours == pytest.approx(100 * 9 / 50)
    assert found[ALL_SAMPLES, CEILING].ours == pytest.approx(100 * (1 - 9 / 500))
    assert found["stable", HIDDEN].ours == pytest.approx(85)
    assert ("stable", CEILING) not in found


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("labels") / "main"
    made = [recording_with_truth(f"grasp-{s}", s) for s in range(4)]
    return StudyPlan({"main": scan_corpus("main", save_all(folder, made))}, quick=True)


@pytest.mark.slow
def test_the_table_of_four(plan):
    results = {t.name: t.function(*t.arguments) for t in label_tables.tasks(plan)}
    labels, ceiling = label_tables.tables(plan, results)
    of_logreg = [r for r in labels.rows if str(r.keys["method"]).startswith("LogReg")]
    both = {(row.keys["trained on"], row.keys["tested on"]) for row in of_logreg}
    assert len(both) == 4
    with_events = {r.keys["tested on"] for r in of_logreg if "events" in str(r.keys["figure"])}
    assert with_events == {"exact truth"}
    (rule,) = [
        row for row in labels.rows
        if row.keys["method"] == "the drawn labels themselves"
        and row.keys["figure"] == "accuracy [%]"
    ]  # fmt: skip
    counts = np.sum(results["labels/logreg"].rule, axis=0)
    assert rule.ours == pytest.approx(100 * (counts[0] + counts[3]) / counts.sum())
    assert 80 < rule.ours < 100
    assert {row.keys["N_w"] for row in ceiling.rows} == {14, 64}


def test_without_a_truth_there_is_no_table(tmp_path):
    corpus = scan_corpus("main", save_synthetic(tmp_path / "a", range(2)))
    plan = StudyPlan({"main": corpus})
    assert label_tables.tasks(plan) == []
    assert label_tables.tables(plan, {}) == label_tables.figures(plan, {}) == []
