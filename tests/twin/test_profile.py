import pytest
from msgspec.structs import asdict

from holdfast.twin.profile import Profile, profile, profiles


def test_the_profiles_and_those_of_the_old_protocol():
    new = ("gentle", "reference", "vigorous")
    old = [f"finger-{name}" for name in new]
    assert profiles() == tuple(sorted([*new, *old, "slips", "long-hold", "coupled"]))


@pytest.mark.parametrize("name", profiles())
def test_a_profile_is_a_possible_experiment(name):
    given = profile(name)
    assert given.name == name
    for name, span in asdict(given).items():
        if isinstance(span, tuple) and (given.move_share or not name.startswith("move_")):
            assert 0 < span[0] <= span[1]
    assert given.hold >= 10.0
    assert given.grip > 0
    assert given.tremor > 0
    assert given.push_duration[1] + 2.5 < given.hold  # at least one disturbance fits


def test_the_ranges_of_slips_are_possible():
    slips = profile("slips").slips
    for span in (value for value in asdict(slips).values() if isinstance(value, tuple)):
        assert 0 < span[0] < span[1]
    assert 0 < slips.share < 1
    assert slips.friction_factor[1] < 1
    assert slips.creep_speed == (0.0003, 0.003)
    assert all(profile(name).slips is None for name in profiles() if name != "slips")


def test_slips_has_the_disturbances_of_the_reference():
    slips, reference = asdict(profile("slips")), asdict(profile("reference"))
    differ = {name for name in reference if slips[name] != reference[name]}
    assert differ == {"name", "hold", "slips"}


def test_coupled_is_the_reference_with_coupled_nodes_and_impacts():
    coupled, reference = asdict(profile("coupled")), asdict(profile("reference"))
    differ = {name for name in reference if coupled[name] != reference[name]}
    assert differ == {"name", "coupled", "impacts", "drawn_as"}
    assert coupled["drawn_as"] == "reference"  # so the disturbances of a seed are the same
    others = [profile(name) for name in profiles() if name != "coupled"]
    assert not any(other.coupled or other.impacts for other in others)


def test_profiles_disturb_in_their_order():
    gentle, reference, vigorous = (profile(name) for name in ("gentle", "reference", "vigorous"))
    assert gentle.tremor < reference.tremor < vigorous.tremor
    assert gentle.push_depth[1] <= reference.push_depth[1] <= vigorous.push_depth[1]


@pytest.mark.parametrize("name", ["", "Reference", "../profile", "reference.toml"])
def test_an_unknown_one_is_refused(name):
    with pytest.raises(ValueError, match="unknown profile"):
        profile(name)


def test_a_profile_is_immutable():
    with pytest.raises(AttributeError, match="immutable"):
        profile("reference").grip = 9.0
    assert isinstance(profile("reference"), Profile)


@pytest.mark.parametrize("name", ["gentle", "reference", "vigorous"])
def test_the_old_protocol_has_a_pushing_finger_only(name):
    old, new = profile(f"finger-{name}"), profile(name)
    assert (old.move_share, old.label_margin, old.label_glitches) == (0.0, 0.1, False)
    assert old.drawn_as == name
    assert (new.move_share, new.label_margin, new.label_glitches) == (0.5, 0.0, True)


def test_the_reference_has_the_length_of_the_papers_grasps():
    """250,000 samples of a fingertip at 150 Hz in 60 grasps; closing and release take about 3 s."""
    reference = profile("reference")
    seconds = sum(reference.idle) + reference.hold + 3.0
    assert seconds == pytest.approx(250_000 / 150 / 60, abs=1.0)
