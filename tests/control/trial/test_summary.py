import math

import pytest

from holdfast.control.trial.run import TrialResult
from holdfast.control.trial.summary import summarize


def result(**given):
    fields = {
        "number": 0, "law": "fixed", "object": "can", "unseen": False, "kind": "pull",
        "n_fingers": 4, "held": True, "dropped": False, "slip": 0.001, "slipped": True,
        "reaction": 0.02, "force_ratio": 1.5, "peak_ratio": 1.2, "quiet_time": 3.0,
    }  # fmt: skip
    return TrialResult(**{**fields, **given})


def test_numbers_are_over_all_trials_that_were_held():
    lost = {"dropped": True, "slip": math.inf, "reaction": math.inf}
    found = summarize(
        [result(n_false=1), result(slip=0.003), result(**lost), result(held=False, **lost)]
    )
    assert (found["n"], found["n_not_held"]) == (3, 1)
    assert found["dropped"]["value"] == pytest.approx(100 / 3)
    assert found["slip_median"]["value"] == 0.003
    assert found["reaction_median"]["value"] == 0.02
    assert found["force_ratio_mean"]["value"] == 1.5
    assert found["false_reactions_per_minute"]["value"] == pytest.approx(60 / 9)


def test_an_infinite_number_is_null():
    found = summarize([result(dropped=True, slip=math.inf, reaction=math.inf)] * 3)
    assert found["slip_median"] == {"value": None, "interval": [None, None]}
    assert found["dropped"] == {"value": 100.0, "interval": [100.0, 100.0]}


def test_a_trial_without_slip_has_no_reaction_time():
    found = summarize([result(slipped=False, reaction=math.nan, slip=0.0)] * 2)
    assert found["reaction_median"] == {"value": None, "interval": None}
    assert found["slip_median"]["value"] == 0.0


def test_no_trials_give_no_numbers():
    found = summarize([])
    assert found["n"] == 0
    assert found["dropped"] == {"value": None, "interval": None}
