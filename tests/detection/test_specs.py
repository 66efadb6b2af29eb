import numpy as np
import pytest

from holdfast.detection import DEPLOYED_FEATURES, FeatureSpec, parse_features


def test_the_deployed_features_drop_m():
    assert DEPLOYED_FEATURES == ("F_a", "F_x", "F_y", "F_z", "sigma")


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ("F_a,F_x,F_y,F_z,m,sigma", "F_a F_x F_y F_z m[14] sigma[14]"),
        (" sigma , F_a", "sigma[14] F_a"),
        ("F_tip,m", "F_x F_y F_z m[14]"),
        (["sigma"], "sigma[14]"),
        (DEPLOYED_FEATURES, "F_a F_x F_y F_z sigma[14]"),
    ],
)
def test_names(names, expected):
    assert " ".join(map(str, parse_features(names))) == expected


@pytest.mark.parametrize(
    ("names", "window", "message"),
    [
        ("F_a,F_q", 14, "'F_q'; there are F_a, F_x"),
        ("", 14, "''"),
        ("holdfast,F_a", 14, "'holdfast'"),
        ("F_a,F_a", 14, "twice"),
        ("F_tip,F_x", 14, "twice"),
        ("F_a", 13, "13 given"),
    ],
)
def test_refuses_names(names, window, message):
    with pytest.raises(ValueError, match=message):
        parse_features(names, window)


def test_the_projects_own_features_have_a_name():
    own = parse_features("holdfast", 8)
    assert len(own) == 15
    assert str(own[0]) == "log(F_a)"
    assert max(spec.window for spec in own) == 64


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("m", 3), "3 given"),
        (("F_x", 14), "F_x has no window"),
        (("m", 14, "noise"), "'noise'"),
        (("sigma", 2, "noise"), "'noise'"),
        (("F_a", 0, "log"), "floor"),
        (("F_a", 0, "log", "finger", -1.0), "floor"),
        (("F_a", 0, "log", "finger", np.nan), "floor"),
    ],
)
def test_refuses_specifications(arguments, message):
    with pytest.raises(ValueError, match=message):
        FeatureSpec(*arguments)


def test_text():
    assert str(FeatureSpec("sigma", 20, "noise", "hand")) == "hand noise(sigma[20])"
