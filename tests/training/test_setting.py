import pytest

from holdfast.model import Debounce
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
        ({"hysteresis": 1.0}, "a hysteresis from 0 to 1 expected, 1.0 given"),
    ],
)
def test_refusals(given, message):
    with pytest.raises(ValueError) as refusal:
        Setting(**given)
    assert str(refusal.value) == message


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
