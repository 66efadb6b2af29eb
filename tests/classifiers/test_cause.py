"""The classifier of causes, and what the detector makes of it."""

import numpy as np
import pytest
from holdfast.classifiers.cause import ALL_CAUSES, CauseClassifier, add_scores, fit_causes
from sklearn.linear_model import LogisticRegression

from holdfast.contact import UNSTABLE, Cause
from holdfast.detector import Detector, detect
from holdfast.errors import ModelError
from holdfast.model import Model
from holdfast.synthetic import synthetic_recording

FIELDS = {
    "causes": (Cause.SLIP, Cause.GLITCH),
    "mean": (1.0, 2.0),
    "scale": (2.0, 4.0),
    "coefficients": ((1.0, -1.0), (0.5, 3.0)),
    "intercepts": (0.25, -0.5),
}


def test_the_fit_is_that_of_scikit_learn_with_balanced_classes():
    draw = np.random.default_rng(0)
    place = draw.choice(3, p=[0.7, 0.2, 0.1], size=900)
    features = draw.normal(size=(900, 4)) + np.eye(3, 4)[place] + [1e3, 0.0, -5.0, 0.1]
    names = np.array([Cause.SLIP, Cause.GLITCH, Cause.CLOSING])[place].astype(str)
    found = fit_causes(features, names, 0.5)
    standardised = (features - features.mean(axis=0)) / features.std(axis=0)
    peer = LogisticRegression(C=0.5, class_weight="balanced", tol=1e-12, max_iter=10_000)
    peer.fit(standardised, names)
    assert [str(cause) for cause in found.causes] == peer.classes_.tolist()
    np.testing.assert_allclose(found.coefficients, peer.coef_, atol=1e-6)
    np.testing.assert_allclose(found.intercepts, peer.intercept_, atol=1e-6)


def test_the_largest_sum_of_scores_wins():
    made = CauseClassifier(**FIELDS)
    rows = np.array([[0.0, 1.0], [5.0, 9.0]])
    standardised = (rows - made.mean) / made.scale
    wanted = (standardised @ np.array(made.coefficients).T + made.intercepts).cumsum(axis=0)
    scores = np.zeros(len(ALL_CAUSES))
    for row, sums in zip(rows, wanted, strict=True):
        code = add_scores(row, made.weights(), scores)
        assert ALL_CAUSES[code - 1] is made.causes[int(sums.argmax())]
        assert scores[made.codes() - 1] == pytest.approx(sums)
    assert np.isneginf(np.delete(scores, made.codes() - 1)).all()


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"causes": (Cause.SLIP, Cause.SLIP)}, "two or more different causes expected"),
        ({"mean": (1.0,)}, "the numbers of means, scales"),
        ({"intercepts": (1.0,)}, "the numbers of means, scales"),
        ({"scale": (0.0, 1.0)}, "scales above 0 expected"),
        ({"intercepts": (np.inf, 0.0)}, "a number of the causes is not finite"),
    ],
)
def test_fields_that_contradict_each_other_are_refused(fields, message):
    with pytest.raises(ModelError, match=message):
        CauseClassifier(**(FIELDS | fields))


def test_an_unstable_finger_has_a_cause_live_and_offline():
    model = Model.load("builtin:any")
    recording = synthetic_recording("made", seed=0)
    modules = recording.modules
    expected = detect(model, recording).fingers
    detector = Detector(model, {n: m.sensor for n, m in modules.items()}, recording.rate)
    for k, time in enumerate(next(iter(modules.values())).times):
        found = detector.update({n: m.readings[k] for n, m in modules.items()}, time)
        for name, trace in expected.items():
            assert found.fingers[name].cause == trace.estimate(k).cause
    states = np.concatenate([trace.state for trace in expected.values()])
    causes = np.concatenate([trace.cause for trace in expected.values()])
    assert (causes[states == UNSTABLE] > 0).all()
    assert (causes[states != UNSTABLE] == 0).all()
    assert len(set(causes[causes > 0].tolist())) > 1


def test_a_model_without_causes_names_none():
    trace = detect(Model.load("builtin:noise-floor"), synthetic_recording("made", seed=0))
    assert not any(finger.cause.any() for finger in trace.fingers.values())
