import math

import pytest

from holdfast_lab.trial.run import TrialResult
from holdfast_lab.trial.summary import compare, summarize


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


class TestCompare:
    def test_differences_are_of_the_same_trials(self):
        ours = [result(number=0), result(number=1, slip=0.002), result(number=2, held=False)]
        lost = {"dropped": True, "slip": math.inf, "reaction": 0.01, "force_ratio": 1.0}
        theirs = [result(number=2), result(number=1, **lost), result(number=0, n_false=1)]
        found = compare(ours, theirs)
        assert found["n"] == 2
        assert found["dropped"]["value"] == -50.0
        assert found["slid_less"]["value"] == 50.0
        assert found["slid_more"]["value"] == 0.0
        assert found["reacted_sooner"]["value"] == 50.0
        assert found["force_ratio_mean"]["value"] == pytest.approx(0.25)
        assert found["false_reactions_per_minute"]["value"] == pytest.approx(-10.0)


def test_a_trial_that_no_force_holds_is_left_out_for_every_law():
    infeasible = result(number=1, feasible=False, dropped=True, slip=math.inf)
    found = summarize([result(), infeasible])
    assert (found["n"], found["n_infeasible"], found["n_not_held"]) == (1, 1, 0)
    assert found["dropped"]["value"] == 0.0
    assert compare([result(), infeasible], [result(), result(number=1)])["n"] == 1


def test_a_rise_before_the_slip_is_no_reaction():
    raised = result(raised_before=True, reaction=math.nan)
    found = summarize([raised, result(), result(reaction=0.04), result(reaction=0.06)])
    assert (found["n_slipped"], found["n_raised_before"], found["n_reacting"]) == (4, 1, 3)
    assert found["reaction_median"]["value"] == 0.04
    lost = result(raised_before=True, dropped=True, slip=math.inf)
    assert summarize([lost])["n_reacting"] == 0


LOST = {"dropped": True, "slip": math.inf}
NOTHING = {"value": None, "interval": None}


@pytest.mark.parametrize(
    ("results", "name", "expected"),
    [
        ([result(**LOST)] * 3, "slip_median", {"value": None, "interval": [None, None]}),
        ([result(**LOST)] * 3, "dropped", {"value": 100.0, "interval": [100.0, 100.0]}),
        ([result(**LOST, reaction=0.01)] * 3, "n_slipped", 3),  # a drop is no reaction
        ([result(slipped=False, reaction=math.nan)] * 2, "reaction_median", NOTHING),
        ([], "dropped", NOTHING),
        ([result(), result(kind="friction")], "n_friction_reacting", 1),
    ],
)
def test_numbers_without_a_value_and_of_parts(results, name, expected):
    assert summarize(results)[name] == expected
