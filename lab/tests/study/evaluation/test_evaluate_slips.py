import msgspec
import numpy as np
import pytest

from holdfast.metrics.slip_thresholds import ThresholdChoice
from holdfast_lab.study.evaluation import evaluate_slips as module
from holdfast_lab.study.evaluation.evaluate_method import EvaluationEffort
from holdfast_lab.study.evaluation.evaluate_slips import (
    SlipEvaluation,
    SlipJob,
    evaluate_slips,
)
from holdfast_lab.study.methods.slip_methods import SLIP_METHODS
from holdfast_lab.study.plan import scan_corpus
from study.example_recordings import recording_with_truth, save_all, save_synthetic

pytestmark = pytest.mark.slow

EFFORT = EvaluationEffort(folds=2, inner=2, max_samples=500)


@pytest.fixture(scope="module")
def corpora(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluate-slips")
    seeds = {"main": range(4), "others": range(10, 12)}
    return {
        name: scan_corpus(
            name, save_all(folder / name, [recording_with_truth(f"grasp-{s}", s) for s in each])
        )
        for name, each in seeds.items()
    }


def evaluated(corpora, name, compared=()):
    job = SlipJob(name, corpora["main"], (corpora["others"],), EFFORT, 0, compared)
    data = msgspec.msgpack.encode(evaluate_slips(job))
    return msgspec.msgpack.decode(data, type=dict[str, SlipEvaluation])


@pytest.mark.parametrize("name", ["holdfast", "holdfast_stability", "jl_global_logreg"])
def test_a_job_has_a_result_out_of_fold_and_for_each_other_corpus(corpora, name):
    """Each recording has two slips of the thumb."""
    results = evaluated(corpora, name)
    assert set(results) == {"main", "others"}
    assert [results[key].n_recordings for key in ("main", "others")] == [4, 2]
    assert results["main"].split == "object"
    for evaluation in results.values():
        assert evaluation.summary.pooled.n == 2 * evaluation.n_recordings
        assert evaluation.summary.threshold_chosen
        assert evaluation.summary.intervals is not None
    held = results["main"].summary.fingers["thumb"].held_minutes
    assert held == pytest.approx(4 * (7.2 - 1.353) / 60, rel=0.01)  # less two slips and their time


def test_methods_are_scored_on_the_same_samples(corpora):
    """One of them needs a second before its first estimate: fewer samples, the same for both."""
    compared = ("holdfast", "anyskin")
    pooled = [evaluated(corpora, name, compared)["others"].summary.pooled for name in compared]
    assert pooled[0].held_minutes == pooled[1].held_minutes
    assert pooled[0].n == pooled[1].n == 4


def test_without_known_slips_there_are_no_results(tmp_path):
    corpus = scan_corpus("main", save_synthetic(tmp_path / "main", range(3)))
    for name in ("holdfast", "holdfast_stability"):
        assert evaluate_slips(SlipJob(name, corpus, effort=EFFORT)) == {}


def test_a_threshold_of_other_recordings_comes_from_training_alone(monkeypatch, corpora):
    """What is tested does not change the choice."""
    seen = []
    choose = module.choose_threshold
    monkeypatch.setattr(
        module, "choose_threshold", lambda curve, *rest: seen.append(curve) or choose(curve, *rest)
    )
    evaluated(corpora, "holdfast")
    assert len(seen) == 2  # for each budget
    for curve in seen:
        held_seconds = 4 * (2 * 7.2 - 1.353)  # the thumb slips
        assert curve[0].held_seconds == pytest.approx(held_seconds, rel=0.01)


def test_each_budget_has_a_threshold_and_intervals_of_its_own(corpora, monkeypatch):
    """Equal budgets give equal scores; one that allows nothing finds nothing."""
    monkeypatch.setattr(module, "QUIET_CHOICE", module.CHOICE)
    same = evaluated(corpora, "holdfast")["main"]
    assert same.quiet_budget == same.summary
    monkeypatch.setattr(module, "QUIET_CHOICE", ThresholdChoice(-1.0, "quiet"))
    strict = evaluated(corpora, "holdfast")["main"]
    assert strict.summary == same.summary
    assert strict.quiet_budget.pooled.incipient["0.1"] == 0.0
    assert strict.quiet_budget.pooled.false_alarms_per_minute["quiet"] == 0.0
    assert strict.quiet_budget.intervals != strict.summary.intervals


def test_every_method_can_be_found_and_has_a_title_of_its_own():
    titles = [(m.target, m.method.title) for m in SLIP_METHODS.values()]
    assert len(set(titles)) == len(titles)
    assert np.all([name == SLIP_METHODS[name].method.name for name in SLIP_METHODS
                   if SLIP_METHODS[name].target == "sliding"])  # fmt: skip
