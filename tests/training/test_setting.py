import pytest

from holdfast.detection import Debounce, Model
from holdfast.detection.specs import ANY_FEATURES, SLIP_FEATURES
from holdfast.training import Setting


def test_the_defaults_are_those_of_the_deployed_model():
    setting = Setting()
    assert [str(feature) for feature in setting.features] == [
        "F_a", "F_x", "F_y", "F_z", "sigma[14]"
    ]  # fmt: skip
    assert (setting.classifier, setting.window, str(setting.used_tare)) == ("logreg", 14, "0.5")
    assert (setting.split, setting.trials) == ("recording", None)
    assert (setting.debounce, setting.rate) == (Debounce(), None)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"classifier": "magic"}, "'magic'; there are logreg, svm"),
        ({"window": 13}, "13 given"),
        ({"split": "half"}, "'half'; there are recording, object, time, random"),
        ({"trials": -1}, "-1 trials given"),
        ({"trials": 5}, "5 trials given.*grid.*holdfast study"),
        ({"max_samples": 0}, "0 given"),
        ({"seed": -1}, "seed"),
        ({"contact_threshold": -1.0}, "contact threshold"),
        ({"contact_threshold": float("nan")}, "contact threshold"),
        ({"hold": -0.1}, "hold"),
        ({"hold": float("inf")}, "hold"),
        ({"own_slip_features": True, "init": Model.load("builtin:any")}, "own slip features"),
        ({"hysteresis": 1.0}, "hysteresis"),
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
