import pytest

from holdfast.features.specs import ANY_FEATURES, SLIP_FEATURES
from holdfast.model import Debounce, Model
from holdfast.training import Setting


def test_the_defaults_are_those_of_the_deployed_model():
    setting = Setting()
    assert [str(feature) for feature in setting.features] == [
        "F_a", "F_x", "F_y", "F_z", "sigma[14]"
    ]  # fmt: skip
    assert (setting.classifier, setting.window, str(setting.used_tare)) == ("logreg", 14, "0.5")
    assert (setting.split, setting.trials) == ("recording", 30)
    assert (setting.debounce, setting.rate) == (Debounce(), None)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"classifier": "magic"}, "unknown classifier 'magic'; there are logreg, svm"),
        ({"window": 13}, "an even window of at least 2 samples expected, 13 given"),
        ({"split": "half"}, "unknown split 'half'; there are recording, object, time, random"),
        (
            {"trials": -1},
            "trials of at least 0 and samples of at least 1 expected; -1 and 200000 given",
        ),
        (
            {"max_samples": 0},
            "trials of at least 0 and samples of at least 1 expected; 30 and 0 given",
        ),
        ({"objective": "auc"}, "unknown objective 'auc'; there are error, log_loss"),
        ({"seed": -1}, "a seed from 0 to 2^32 - 1 expected, -1 given"),
        (
            {"contact_threshold": -1.0},
            "a contact threshold of at least 0 expected, -1.0 given",
        ),
        (
            {"contact_threshold": float("nan")},
            "a contact threshold of at least 0 expected, nan given",
        ),
        ({"hold": -0.1}, "a hold of at least 0 s expected, -0.1 given"),
        ({"hold": float("inf")}, "a hold of at least 0 s expected, inf given"),
        (
            {"own_slip_features": True, "init": Model.load("builtin:any")},
            "own slip features given with a model to adapt, which keeps its slip rule; leave "
            "one of them out",
        ),
        ({"hysteresis": 1.0}, "a hysteresis from 0 to 1 expected, 1.0 given"),
    ],
)
def test_refusals(given, message):
    with pytest.raises(ValueError, match=message):
        Setting(**given)


def test_features_of_the_slip_rule():
    assert Setting().slip_features is None
    assert Setting(own_slip_features=True).slip_features == SLIP_FEATURES
    relative = Setting(features=ANY_FEATURES, own_slip_features=True).slip_features
    assert relative[: len(ANY_FEATURES)] == ANY_FEATURES
    added = relative[len(ANY_FEATURES) :]
    assert added == tuple(spec for spec in SLIP_FEATURES if spec.seconds)


@pytest.mark.parametrize(
    ("given", "objective"),
    [
        ({}, "log_loss"),
        ({"classifier": "svm"}, "error"),
        ({"objective": "error"}, "error"),
        ({"classifier": "svm", "objective": "log_loss"}, "log_loss"),
    ],
)
def test_the_objective_of_the_search(given, objective):
    assert Setting(**given).search_objective == objective
