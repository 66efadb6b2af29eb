import pytest
from msgspec.structs import asdict

from holdfast.twin.profile import profile, profiles


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


def test_coupled_is_the_reference_with_coupled_nodes_and_impacts():
    coupled, reference = asdict(profile("coupled")), asdict(profile("reference"))
    differ = {name for name in reference if coupled[name] != reference[name]}
    assert differ == {"name", "coupled", "impacts", "drawn_as"}
    assert coupled["drawn_as"] == "reference"  # so the disturbances of a seed are the same
    assert [name for name in profiles() if profile(name).coupled] == ["coupled"]


def test_handling_is_pushed_for_as_much_of_the_hold_as_reference_is():
    handling, reference = asdict(profile("handling")), asdict(profile("reference"))
    same = {name for name in reference if handling[name] == reference[name]}
    assert {"grip", "rest", "push_duration", "move_duration", "move_share", "push_depth"} <= same
    assert [name for name in profiles() if profile(name).without_slips] == ["handling"]


@pytest.mark.parametrize("name", ["", "Reference", "../profile", "reference.toml"])
def test_an_unknown_one_is_refused(name):
    with pytest.raises(ValueError, match="unknown profile"):
        profile(name)
