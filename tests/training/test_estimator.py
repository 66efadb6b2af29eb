import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV, GroupKFold

from holdfast import StabilityClassifier
from holdfast.contact import STABLE
from holdfast.detection import detect
from holdfast.errors import TrainingError
from holdfast.training import Setting, train

from .build import tiny_recording

pytestmark = pytest.mark.slow


def test_parameters_are_kept_as_given():
    given = {"classifier": "svm", "window": 8, "features": "F_a,sigma", "tare": "first", "C": 3.0,
             "class_weight": None, "shared": True, "seed": 5}  # fmt: skip
    estimator = StabilityClassifier(**given)
    assert estimator.get_params() == given
    assert clone(estimator).get_params() == given
    assert StabilityClassifier().set_params(**given).get_params() == given
    assert "svm" in repr(estimator)


@pytest.mark.parametrize("classifier", ["logreg", "svm"])
def test_the_model_is_that_of_the_reference_parameters(grasps, classifier):
    estimator = StabilityClassifier(classifier).fit(grasps)
    trained = train(grasps, Setting(classifier=classifier, trials=0)).model
    assert estimator.model_.fingers == trained.fingers
    assert estimator.classes_.tolist() == [0, 1]


def test_parameters_reach_the_fit(grasps):
    plain = StabilityClassifier().fit(grasps).model_
    others = [
        StabilityClassifier(**changed).fit(grasps).model_
        for changed in (
            {"C": 1e-4},
            {"class_weight": None},
            {"window": 8},
            {"features": "F_a,sigma"},
            {"tare": "first"},
            {"shared": True},
        )
    ]
    assert all(other != plain for other in others)


def test_predictions_are_those_of_the_detector(grasps):
    fast = tiny_recording(30, n=1200, rate=300.0)
    estimator = StabilityClassifier(window=6).fit(grasps)
    given = [*grasps[:2], fast]
    states, probabilities = estimator.predict(given), estimator.predict_proba(given)
    for recording, said, probability in zip(given, states, probabilities, strict=True):
        detection = detect(estimator.model_, recording)
        assert list(said) == ["thumb", "index"]
        for finger, trace in detection.fingers.items():
            np.testing.assert_array_equal(said[finger], trace.state == STABLE)
            assert probability[finger].shape == said[finger].shape
            decided = trace.state == STABLE
            np.testing.assert_allclose(
                probability[finger][decided], trace.stable_probability[decided]
            )


def test_grid_search_with_groups(grasps):
    objects = [recording.metadata["object"] for recording in grasps]
    grid = GridSearchCV(
        StabilityClassifier(), {"window": [4, 8], "C": [0.1, 1.0]}, cv=GroupKFold(3)
    )
    grid.fit(grasps, groups=objects)
    assert grid.best_params_["window"] in (4, 8)
    assert ((grid.cv_results_["mean_test_score"] > 0.5) & (grid.best_score_ <= 1)).all()
    assert grid.predict(grasps[:1])[0]["thumb"].shape == (400,)
    assert grid.best_estimator_.model_.window == grid.best_params_["window"]


def test_refusals(grasps):
    with pytest.raises(NotFittedError):
        StabilityClassifier().predict(grasps)
    with pytest.raises(TrainingError, match="labels"):
        StabilityClassifier().fit([tiny_recording(0, states=[None] * 4)])
    with pytest.raises(ValueError, match="'magic'"):
        StabilityClassifier("magic").fit(grasps)
