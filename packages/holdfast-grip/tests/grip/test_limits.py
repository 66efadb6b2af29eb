import math

import pytest

from holdfast_grip import Limits


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"max_scale": 0.9}, "min_scale <= 1 <= max_scale expected, 0.8 and 0.9 given"),
        ({"min_scale": 1.2}, "min_scale <= 1 <= max_scale expected, 1.2 and 3 given"),
        ({"rise": 0.0}, "rise: a finite number above 0 expected, 0.0 given"),
        ({"fall": math.nan}, "fall: a finite number above 0 expected, nan given"),
        ({"cooldown": -1.0}, "cooldown: a finite number of at least 0 expected, -1.0 given"),
        ({"max_force": math.inf}, "max_force: a finite number above 0 expected, inf given"),
        ({"recovery": -0.1}, "recovery: at least 0 s expected, -0.1 given"),
        ({"on_fault": "panic"}, "on_fault: hold or open expected, 'panic' given"),
    ],
)
def test_limits_that_contradict_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        Limits(**given)


def test_the_highest_scale_respects_the_highest_force():
    assert Limits(max_scale=2.0).highest_scale(100.0) == 2.0
    assert Limits(max_scale=2.0, max_force=3.0).highest_scale(2.0) == 1.5
    assert Limits(max_scale=2.0, max_force=3.0).highest_scale(4.0) == 1.0
    assert Limits(max_scale=2.0, max_force=3.0).highest_scale(0.0) == 2.0
