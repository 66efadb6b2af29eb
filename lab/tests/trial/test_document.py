import json

import msgspec
import pytest

from holdfast_lab.trial.document import document_of, example_of
from holdfast_lab.trial.plan import TrialPlan

from .example_results import results_of

LAWS = ("fixed", "pr2", "holdfast")


@pytest.fixture(scope="module")
def document():
    return document_of(TrialPlan(LAWS, 12), results_of(), 0)


def test_numbers_of_the_contract(document):
    assert list(document["laws"]) == list(LAWS)
    for row in document["laws"].values():
        assert (row["n"], row["n_not_held"]) == (11, 1)
        for name in (
            "dropped", "slip_median", "reaction_median", "force_ratio_mean", "slip_p90",
            "friction_reaction_median", "static_ratio_mean", "coulomb_ratio_mean",
            "false_reactions_per_minute",
        ):  # fmt: skip
            assert row[name].keys() == {"value", "interval"}
    assert document["seed"] == 0
    assert len(document["trials"]) == 36


def test_parts_add_up_to_the_whole(document):
    for law, row in document["laws"].items():
        parts = [document["seen_objects"], document["unseen_objects"]]
        for each in (parts, document["by_kind"].values(), document["by_fingers"].values()):
            assert sum(part[law]["n"] for part in each) == row["n"]


def test_it_is_json_without_infinity(document):
    text = msgspec.json.encode(document)
    assert json.loads(text, parse_constant=pytest.fail)["trials"][0]["slip"] is None


class TestExample:
    def test_it_is_the_first_that_fixed_loses_and_ours_holds(self):
        assert example_of(results_of()) == 0
        results = results_of()
        results["fixed"][0] = msgspec.structs.replace(results["fixed"][0], dropped=False)
        results["holdfast"][1] = msgspec.structs.replace(results["holdfast"][1], dropped=True)
        assert example_of(results) == 3

    def test_a_trial_that_was_not_held_until_the_load_is_none(self):
        results = results_of()
        for each in results.values():
            each[:4] = [msgspec.structs.replace(one, held=False) for one in each[:4]]
        assert example_of(results) == 6  # 4 was not held either, and fixed holds 5


def test_laws_are_compared_with_ours_and_with_fixed(document):
    assert {name: list(by_law) for name, by_law in document["paired"].items()} == {
        "fixed": ["pr2", "holdfast"],
        "holdfast": ["fixed", "pr2"],
    }
    found = document["paired"]["fixed"]["holdfast"]
    assert found["dropped"]["value"] == pytest.approx(-100 * 7 / 11)
