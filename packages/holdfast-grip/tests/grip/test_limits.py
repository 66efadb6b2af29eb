import math

import pytest

from holdfast_grip import Limits


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("max_scale", 0.9),
        ("min_scale", 1.2),
        ("rise", 0.0),
        ("fall", math.nan),
        ("cooldown", -1.0),
        ("max_force", math.inf),
        ("recovery", -0.1),
        ("on_fault", "panic"),
    ],
)
def test_limits_that_contradict_are_refused(name, value):
    with pytest.raises(ValueError, match=f"{name}.*{value}"):
        Limits(**{name: value})


def test_the_highest_scale_respects_the_highest_force():
    assert Limits(max_scale=2.0).highest_scale(100.0) == 2.0
    assert Limits(max_scale=2.0, max_force=3.0).highest_scale(2.0) == 1.5
    assert Limits(max_scale=2.0, max_force=3.0).highest_scale(4.0) == 1.0
    assert Limits(max_scale=2.0, max_force=3.0).highest_scale(0.0) == 2.0
