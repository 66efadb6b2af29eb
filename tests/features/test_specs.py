import numpy as np
import pytest

from holdfast.features import DEPLOYED_FEATURES, FeatureSpec, parse_features


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


KNOWN = (
    "there are F_a, F_x, F_y, F_z, m, sigma, F_tip for F_x, F_y and F_z, and holdfast or any "
    "alone for the project's own features"
)


@pytest.mark.parametrize(
    ("names", "window", "message"),
    [
        ("F_a,F_q", 14, f"unknown feature 'F_q'; {KNOWN}"),
        ("", 14, f"unknown feature ''; {KNOWN}"),
        ("holdfast,F_a", 14, f"unknown feature 'holdfast'; {KNOWN}"),
        ("F_a,F_a", 14, "a feature is given twice in F_a,F_a"),
        ("F_tip,F_x", 14, "a feature is given twice in F_x,F_y,F_z,F_x"),
        ("F_a", 13, "an even window of at least 2 samples expected, 13 given"),
    ],
)  # fmt: skip
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
        (("m", 3), "an even window of at least 2 samples expected, 3 given"),
        (("F_x", 14), "F_x has no window; 14 given"),
        (("m", 14, "noise"),
         "the transform 'noise' expects sigma over 4 samples or more; noise(m[14]) given"),
        (("sigma", 2, "noise"),
         "the transform 'noise' expects sigma over 4 samples or more; noise(sigma[2]) given"),
        (("F_a", 0, "log"),
         "log(F_a): a floor above 0 expected, which keeps the logarithm finite; 0 given"),
        (("F_a", 0, "log", "finger", -1.0), "a floor of at least 0 expected, -1.0 given"),
        (("F_a", 0, "log", "finger", np.nan), "a floor of at least 0 expected, nan given"),
    ],
)  # fmt: skip
def test_refuses_specifications(arguments, message):
    with pytest.raises(ValueError, match=message):
        FeatureSpec(*arguments)


def test_text():
    assert str(FeatureSpec("sigma", 20, "noise", "hand")) == "hand noise(sigma[20])"
