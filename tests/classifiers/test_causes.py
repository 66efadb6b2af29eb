"""The fit of causes, and what the detector makes of them."""

import numpy as np
from sklearn.linear_model import LogisticRegression

from holdfast.classifiers.causes import fit_causes
from holdfast.contact import UNSTABLE, Cause
from holdfast.detector import Detector, detect
from holdfast.model import Model
from holdfast.synthetic import synthetic_recording


def test_the_fit_is_that_of_scikit_learn_with_balanced_classes():
    draw = np.random.default_rng(0)
    place = draw.choice(3, p=[0.7, 0.2, 0.1], size=900)
    features = draw.normal(size=(900, 4)) + np.eye(3, 4)[place] + [1e3, 0.0, -5.0, 0.1]
    names = np.array([Cause.SLIP, Cause.GLITCH, Cause.CLOSING])[place].astype(str)
    found, classes = fit_causes(features, names, 0.5)
    standardised = (features - features.mean(axis=0)) / features.std(axis=0)
    peer = LogisticRegression(C=0.5, class_weight="balanced", tol=1e-12, max_iter=10_000)
    peer.fit(standardised, names)
    assert [str(cause) for cause in classes] == peer.classes_.tolist()
    np.testing.assert_allclose(found.weights, peer.coef_, atol=1e-6)
    np.testing.assert_allclose(found.intercepts, peer.intercept_, atol=1e-6)


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
