from dataclasses import replace

import msgspec
import numpy as np
import pytest

from holdfast.contact import UNKNOWN, ContactState
from holdfast.recordings import Label
from holdfast_lab.study.evaluation.evaluate_method import (
    EvaluationEffort,
    EvaluationJob,
    MethodEvaluation,
    evaluate_method,
    held_out_folds,
    score_splits,
)
from holdfast_lab.study.plan import scan_corpus
from study.example_recordings import recording_with_truth, save_all, save_synthetic

pytestmark = pytest.mark.slow

EFFORT = EvaluationEffort(folds=3, inner=2, max_samples=1000)


@pytest.fixture(scope="module")
def recordings():
    return [recording_with_truth(f"grasp-{seed}", seed) for seed in range(6)]


@pytest.fixture(scope="module")
def corpus(tmp_path_factory, recordings):
    return scan_corpus("main", save_all(tmp_path_factory.mktemp("evaluation") / "main", recordings))


@pytest.mark.parametrize("n", [2, 5, 12, 13])
@pytest.mark.parametrize("split", ["recording", "object"])
def test_every_recording_is_held_out_once(n, split):
    objects = [f"object {k % 3}" for k in range(n)]
    folds = list(held_out_folds(objects, split, 5, seed=1))
    assert sorted(index for fold in folds for index in fold) == list(range(n))
    if split == "object":
        assert all(len({objects[index] for index in fold}) == 1 for fold in folds)
        assert len(folds) == min(3, n)


@pytest.mark.parametrize("objects", [["ball", "ball"], ["ball", None], [None, None]])
def test_no_split_by_object_without_two_known_objects(objects):
    assert list(held_out_folds(objects, "object", 5, 0)) == []


@pytest.mark.parametrize("method", ["logreg", "jl_global_logreg"])
def test_an_evaluated_recording_does_not_influence_its_scores(tmp_path, recordings, corpus, method):
    """Inverting the labels of one fold changes the scores of all recordings but those of it."""
    held = next(held_out_folds([r.metadata["object"] for r in recordings], "recording", 3, 0))
    other = [inverted(r) if k in held else r for k, r in enumerate(recordings)]
    inverted_corpus = scan_corpus("main", save_all(tmp_path / "main", other))
    job = EvaluationJob(method, corpus, effort=EFFORT)
    (_, scored), (_, inverted_scored) = (
        next(score_splits(each))
        for each in (job, msgspec.structs.replace(job, train=inverted_corpus))
    )
    for index, (case, twin) in enumerate(zip(scored, inverted_scored, strict=True)):
        assert same(case, twin) == (index in held)


def inverted(recording):
    """Return the recording with all labels inverted, without truth."""
    labels = {
        name: [Label(each.start, each.end, _other(each.state)) for each in module.labels]
        for name, module in recording.modules.items()
    }
    return replace(recording.with_labels(labels), truth=None)


def _other(state):
    return ContactState.UNSTABLE if state is ContactState.STABLE else ContactState.STABLE


def same(case, twin):
    pairs = [(own, twin.fingers[name]) for name, own in case.fingers.items()]
    pairs.append((case.hand, twin.hand))
    equal = [
        np.array_equal(getattr(own, name), getattr(other, name), equal_nan=True)
        for own, other in pairs
        for name in ("margin", "known", "grasped", "probability")
    ]
    return all(equal) and case.shifts == twin.shifts


@pytest.fixture(scope="module")
def evaluations(corpus, tmp_path_factory):
    other = save_synthetic(tmp_path_factory.mktemp("evaluation-other") / "others", range(20, 23))
    job = EvaluationJob(
        "logreg", corpus, ("recording", "object"), (scan_corpus("others", other),), effort=EFFORT
    )
    data = msgspec.msgpack.encode(evaluate_method(job))
    return msgspec.msgpack.decode(data, type=dict[str, MethodEvaluation])


def test_a_job_has_a_result_for_each_split_and_each_corpus(evaluations, corpus):
    assert set(evaluations) == {"recording", "object", "others"}
    for split in ("object", "recording"):
        names = [recording.name for recording in evaluations[split].hand.recordings]
        assert names == list(corpus.recordings)
    assert len(evaluations["others"].held) == 3
    assert evaluations["recording"].fingers.pooled.accuracy > 75


def test_a_whole_hand_method_has_no_fingers(corpus):
    found = evaluate_method(EvaluationJob("jl_global_logreg", corpus, effort=EFFORT))["recording"]
    assert found.fingers is None
    assert found.metrics is found.hand
    assert found.hand.pooled.brier is not None


def test_methods_are_scored_where_all_of_them_have_an_estimate(corpus):
    """Differences exist after one sample, the paper's features after 13."""
    alone = EvaluationJob("difference", corpus, effort=EFFORT)
    both = EvaluationJob("difference", corpus, effort=EFFORT, compared=("logreg", "difference"))
    paper = EvaluationJob("logreg", corpus, effort=EFFORT, compared=("logreg", "difference"))
    single, joint, known = (evaluate_method(job)["recording"] for job in (alone, both, paper))
    assert joint.fingers.pooled.n == known.fingers.pooled.n < single.fingers.pooled.n
    for _, scored in score_splits(paper):
        for case in scored:
            labels = case.recording.scored_labels
            for name, finger in case.decide(labels).fingers.items():
                assert (finger.states[labels[name] != UNKNOWN] != UNKNOWN).all()
    assert joint.without_estimate == single.without_estimate
    for (n, n_without), (n_paper, n_without_paper) in zip(
        joint.without_estimate, known.without_estimate, strict=True
    ):
        assert n == n_paper
        assert n_without < n_without_paper
