import pytest

from holdfast.detector.decision_rule import estimate_code, split_code


@pytest.mark.parametrize("decision", [(0, 1, 0, 0), (2, 0, 8191, 6), (3, 4, 255, 0)])
def test_a_code_is_split_as_it_was_made(decision):
    assert split_code(estimate_code(*decision)) == decision
