import numpy as np
import pytest

from holdfast.twin.uskin_readout import UskinParameters
from holdfast_lab.study.paper import attribution
from holdfast_lab.study.paper.attribution import (
    DOUBLE_NOISE,
    SWITCHES,
    difference_row,
    same_repeats,
)
from holdfast_lab.study.paper.pooled_samples import Treatment, pool_samples
from holdfast_lab.study.plan import StudyPlan, scan_corpus
from study.example_recordings import recording_with_truth, save_all


def test_one_thing_is_switched_at_a_time():
    exact = {switch.name: switch for switch in SWITCHES}
    for switch in SWITCHES[1:]:
        base = exact["short_window" if switch.name == "own_energy" else "base"]
        fields = ("role", "treatment", "classifier", "window")
        assert sum(getattr(switch, f) != getattr(base, f) for f in fields) == 1
    assert {each.factor for each in SWITCHES[1:]} == {
        "labels", "disturbances", "classifier", "noise", "window",
    }  # fmt: skip


def test_twice_the_noise():
    own = UskinParameters().noise_counts
    assert np.hypot(own, DOUBLE_NOISE) == pytest.approx(2 * own)


def test_differences_by_hand():
    first = [[8, 2, 0, 10], [10, 0, 5, 5], [0, 0, 0, 0]]
    base = [[9, 1, 0, 10], [10, 0, 0, 10], [0, 0, 0, 0]]
    for paired in (True, False):
        row = difference_row({}, first, base, 0, paired)
        assert row.ours == pytest.approx(100 * (33 / 40 - 39 / 40)) and row.n == 2
    low, high = difference_row({}, first, base, 0, True).interval
    assert (low, high) == (pytest.approx(-25), pytest.approx(-5))


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("attribution")
    corpora = {}
    for role, repeats in (("main", 3), ("finger", 2)):
        made = [
            recording_with_truth(f"can-case{case}-{repeat}", 10 * case + repeat)
            for case in (1, 2)
            for repeat in range(1, repeats + 1)
        ]
        corpora[role] = scan_corpus(role, save_all(folder / role, made))
    return StudyPlan(corpora, quick=True)


@pytest.mark.slow
def test_all_corpora_have_the_same_repeats(plan):
    cut = same_repeats(plan.corpora)
    assert cut["main"].recordings == cut["finger"].recordings == plan.corpora["finger"].recordings


@pytest.mark.slow
def test_treatments_change_labels_and_readings(plan):
    pools = {
        name: pool_samples(plan.main, 150.0, "index", 14, 0, treatment)
        for name, treatment in (
            ("exact", Treatment("exact")),
            ("sliding", Treatment("sliding")),
            ("no_glitches", Treatment("no_glitches")),
            ("noisy", Treatment("exact", 50.0)),
        )
    }
    stable = {name: pool.samples.positive.sum() for name, pool in pools.items()}
    assert stable["sliding"] > stable["no_glitches"] > stable["exact"]  # the index never slides
    assert stable["exact"] == stable["noisy"]
    sigma = {name: np.median(pool.samples.features[:, 5]) for name, pool in pools.items()}
    assert sigma["noisy"] > 2 * sigma["exact"]


@pytest.mark.slow
def test_the_table(plan):
    results = {task.name: task.function(*task.arguments) for task in attribution.tasks(plan)}
    (table,) = attribution.tables(plan, results)
    assert "Not simulated in this run: noiseless." in table.note
    switched = [row.keys["to"] for row in table.rows if row.keys["figure"] == "accuracy"]
    assert len(switched) == 2 * (len(SWITCHES) - 1)
    accuracy = {
        (row.keys["to"], row.keys["on"]): row.ours
        for row in table.rows
        if row.keys["figure"] == "accuracy"
    }
    first = SWITCHES[0].setting
    for row in table.rows:
        if row.keys["figure"] == attribution.LINE_DIFFERENCE:
            to, on = row.keys["to"], row.keys["on"]
            assert row.ours == pytest.approx(accuracy[to, on] - accuracy[first, on])
