import msgspec
import numpy as np
import pytest

from holdfast.contact import UNKNOWN, UNSTABLE
from holdfast.detection import Head
from holdfast.metrics.slip_truth import CREEPING, SLIDING, STILL, Slip, SlipTruth
from holdfast.training.head_fits import SLIP_SMOOTHING
from holdfast_lab.study.evaluation import evaluate_slips as module
from holdfast_lab.study.evaluation.evaluate_method import EvaluationEffort, EvaluationJob
from holdfast_lab.study.evaluation.evaluate_slips import (
    SlipEvaluation,
    SlipScores,
    evaluate_slips,
    slip_curves,
    smoothed,
    still_ranks,
)
from holdfast_lab.study.evaluation.recording_features import corpus_features
from holdfast_lab.study.methods import HAND, METHODS
from holdfast_lab.study.plan import scan_corpus
from study.example_recordings import SLIPS, corpora_of, inside, recording_with_truth, save_synthetic

pytestmark = pytest.mark.slow

RATE = 150.0


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slips")
    return corpora_of(folder, {"main": range(2)}, recording_with_truth)["main"]


@pytest.fixture(scope="module")
def recordings(corpus):
    return corpus_features(METHODS["difference"], corpus)


def test_the_truth_is_that_of_each_finger(recordings):
    truth = recordings[0].slips
    times = recordings[0].times["thumb"]
    np.testing.assert_array_equal(truth["thumb"].codes == SLIDING, inside(SLIPS, times))
    assert not (truth["index"].codes == SLIDING).any()
    assert [len(truth[name].slips) for name in ("thumb", "index")] == [len(SLIPS), 0]
    held = inside([(2.3, 9.5)], times)
    np.testing.assert_array_equal(truth["index"].codes == STILL, held)
    assert truth["index"].quiet[held & inside([(3.0, 5.0)], times)].all()
    assert not truth["index"].quiet[inside([(5.4, 6.4)], times)].any()


def test_a_hand_slides_if_one_of_its_fingers_slides(recordings):
    labels = recordings[0].slip_labels(HAND)
    times = recordings[0].times["thumb"]
    np.testing.assert_array_equal(labels == UNSTABLE, inside(SLIPS, times))
    assert ((labels == UNKNOWN) == ~inside([(2.3, 9.5)], times)).all()


def test_scores_are_smoothed_as_by_the_rule_of_a_model():
    times = np.arange(200) / RATE
    values = np.random.default_rng(0).normal(0, 3, 200)
    values[50:60] = np.nan
    gain, state = Head.gain(_Smoothing, RATE), np.nan
    expected = []
    for value in values:
        state = value if np.isnan(state + value) else state + gain * (value - state)
        expected.append(state)
    np.testing.assert_allclose(smoothed(times, values), expected, atol=1e-12)


class _Smoothing:
    smoothing = SLIP_SMOOTHING


def test_a_perfect_score_finds_every_slip_without_a_false_alarm():
    times = np.arange(3000) / RATE
    codes = np.full(3000, STILL, dtype=np.int8)
    codes[1500:1600], codes[1600:1620] = SLIDING, CREEPING
    truth = SlipTruth(codes, codes == STILL, (Slip(10.0, 1600 / RATE, distance=2e-3),), "truth")
    noise = np.random.default_rng(2).normal(0, 1, 3000)
    scores = SlipScores(times, np.where(codes == SLIDING, 100.0, noise), truth)
    without_contact = SlipScores(times, np.full(3000, -np.inf), truth)
    ranks = still_ranks([{"thumb": scores, "index": without_contact}])
    assert len(ranks) == (codes == STILL).sum()
    curves = slip_curves({"thumb": scores, "index": without_contact}, ranks)
    highest = curves["thumb"][-1]
    assert highest.delays.tolist() == pytest.approx([0.0])
    assert highest.false_held == 0
    assert curves["index"][0].delays.tolist() == [np.inf]


EFFORT = EvaluationEffort(folds=2, inner=2, max_samples=500)


@pytest.fixture(scope="module")
def corpora(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluate-slips")
    seeds = {"main": range(4), "others": range(10, 12)}
    return corpora_of(folder, seeds, recording_with_truth)


def job(name, main, tests=(), compared=()):
    splits = ("object", "recording")
    return EvaluationJob(name, main, splits, tests, effort=EFFORT, compared=compared, slips=True)


def evaluated(corpora, name, compared=()):
    data = msgspec.msgpack.encode(
        evaluate_slips(job(name, corpora["main"], (corpora["others"],), compared))
    )
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
        assert evaluate_slips(job(name, corpus)) == {}


def test_each_budget_has_a_threshold_and_intervals_of_its_own(corpora, monkeypatch):
    """Equal budgets give equal scores; one that allows nothing finds nothing."""
    monkeypatch.setattr(module, "BUDGETS", 2 * [(module.SLIP_RATE, "held")])
    same = evaluated(corpora, "holdfast")["main"]
    assert same.quiet_budget == same.summary
    monkeypatch.setattr(module, "BUDGETS", [(module.SLIP_RATE, "held"), (-1.0, "quiet")])
    strict = evaluated(corpora, "holdfast")["main"]
    assert strict.summary == same.summary
    assert strict.quiet_budget.pooled.incipient["0.1"] == 0.0
    assert strict.quiet_budget.pooled.false_alarms_per_minute["quiet"] == 0.0
    assert strict.quiet_budget.intervals != strict.summary.intervals
