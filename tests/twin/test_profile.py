import pytest
from msgspec.structs import asdict

from holdfast.twin.profile import Profile, profile, profiles


def test_three_profiles_come_along():
    assert profiles() == ("gentle", "reference", "vigorous")


@pytest.mark.parametrize("name", ["gentle", "reference", "vigorous"])
def test_a_profile_is_a_possible_experiment(name):
    given = profile(name)
    assert given.name == name
    for low, high in (value for value in asdict(given).values() if isinstance(value, tuple)):
        assert 0 < low <= high
    assert given.hold >= 10.0
    assert given.grip > 0
    assert given.tremor > 0
    assert given.push_duration[1] + 2.5 < given.hold  # at least one disturbance fits


def test_profiles_disturb_in_their_order():
    gentle, reference, vigorous = (profile(name) for name in ("gentle", "reference", "vigorous"))
    assert gentle.tremor < reference.tremor < vigorous.tremor
    assert gentle.push_depth[1] <= reference.push_depth[1] <= vigorous.push_depth[1]


@pytest.mark.parametrize("name", ["", "Reference", "../profile", "reference.toml"])
def test_an_unknown_one_is_refused(name):
    with pytest.raises(ValueError, match=r"unknown profile .*; there are gentle, reference"):
        profile(name)


def test_a_profile_cannot_be_turned():
    with pytest.raises(AttributeError, match="immutable"):
        profile("reference").grip = 9.0
    assert isinstance(profile("reference"), Profile)
