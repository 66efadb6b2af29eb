from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import FingerDecisions, hand_decisions
from holdfast_lab.study.evaluation.fitted_method import FittedMethod, MethodTraining, Scores
from holdfast_lab.study.evaluation.recording_features import RecordingFeatures, corpus_features
from holdfast_lab.study.methods import HAND, METHODS
from holdfast_lab.study.plan import scan_corpus
from study.example_recordings import save_synthetic

pytestmark = pytest.mark.slow


def recording_at(times):
    empty = {name: np.zeros(len(own), dtype=np.int8) for name, own in times.items()}
    return RecordingFeatures("one", None, None, times, {}, *[empty] * 4, {}, {}, {})


def state_of_finger(margin, touching, shift):
    if np.isnan(margin):
        return UNKNOWN
    if not touching:
        return NO_CONTACT
    return STABLE if margin >= shift else UNSTABLE


@pytest.mark.parametrize("seed", range(6))
def test_the_state_of_a_hand_follows_from_its_fingers_at_any_threshold(seed):
    generator = np.random.default_rng(seed)
    times = {f"f{k}": np.sort(generator.random(60)) for k in range(1 + seed % 4)}
    margins = {f: np.round(generator.normal(size=60), 1) for f in times}
    for each in margins.values():
        each[generator.random(60) < 0.1] = np.nan
    touching = {f: generator.random(60) < 0.7 for f in times}
    score = Scores.of_hand(
        [Scores.of_finger(own, margins[f], 0.3, touching[f]) for f, own in times.items()]
    )
    for shift in (-np.inf, -1.0, 0.0, 0.4, np.inf):
        fingers = {}
        for f, own in times.items():
            pairs = zip(margins[f], touching[f], strict=True)
            states = [state_of_finger(m, t, shift) for m, t in pairs]
            fingers[f] = FingerDecisions(own, states, states, np.full(60, np.nan))
        expected = hand_decisions(fingers, len(fingers))
        assert score.times.tolist() == expected.times.tolist()
        assert score.states(shift).tolist() == expected.states.tolist()
        assert not np.isnan(score.probability[score.states(shift) != UNKNOWN]).any()


def test_a_whole_hand_method_decides_for_no_finger():
    """Its estimate of the hand is the latest one of every finger."""
    recording = replace(
        recording_at({"a": np.array([0.0, 1.0, 2.0]), "b": np.array([0.0, 1.5, 2.0])}),
        amplitude={"a": np.ones(3), "b": np.array([1.0, 1.0, 0.0])},
        features={HAND: np.array([[np.nan], [0.8], [0.9]])},
    )
    scores = FittedMethod({HAND: Fixed()}, {"a": 0.5, "b": 0.5}).scores(recording)
    decided = scores.decide(recording.labels)
    assert decided.fingers == {HAND: decided.hand}
    assert scores.fingers["b"].known.tolist() == [False, True, True]
    assert scores.fingers["b"].margin == pytest.approx([np.inf, np.log(4), np.inf])
    assert scores.fingers["b"].grasped.tolist() == [True, True, False]
    assert decided.hand.times.tolist() == [0.0, 1.0, 1.5, 2.0]
    assert decided.hand.states.tolist() == [UNKNOWN, STABLE, STABLE, NO_CONTACT]


class Fixed:
    """A classifier whose probability is its feature."""

    n_features, threshold = 1, 0.5

    def probability(self, features):
        return features[:, 0]


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return scan_corpus("main", save_synthetic(tmp_path_factory.mktemp("fitted") / "main", range(4)))


def test_a_missing_finger_is_not_evaluated(corpus):
    method = METHODS["logreg"]
    recordings = corpus_features(method, corpus)
    lacking = without(recordings[3], "index")
    fitted = MethodTraining.of(method, [*recordings[:3], lacking]).fit()
    decided = fitted.scores(lacking).decide(lacking.labels)
    assert set(decided.fingers) == {"thumb"}
    assert (decided.hand.states == STABLE).any()


def without(recording, finger):
    def rest(each):
        return {name: value for name, value in each.items() if name != finger}

    names = ("times", "amplitude", "labels", "exact_labels", "at_rest", "features")
    return replace(recording, **{name: rest(getattr(recording, name)) for name in names})


def test_one_class_gives_no_classifier_and_no_scores(corpus):
    method = METHODS["logreg"]
    recordings = corpus_features(method, corpus)
    stable = {f: np.full(len(t), STABLE, dtype=np.int8) for f, t in recordings[0].times.items()}
    one = replace(recordings[0], labels=stable)
    fitted = MethodTraining.of(method, [one]).fit()
    assert not fitted.classifiers
    decided = fitted.scores(one).decide(one.labels)
    assert (decided.hand.states == UNKNOWN).all()
    assert all((finger.states == UNKNOWN).all() for finger in decided.fingers.values())
