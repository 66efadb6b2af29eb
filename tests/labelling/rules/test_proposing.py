import pytest

from holdfast.labelling.rules import RULES, propose, signal

from .build import grasp


def test_rules_by_name():
    assert list(RULES) == ["signal", "tracking", "command"]
    assert all("\n" not in text for text in RULES.values())
    assert propose("signal", grasp(), tare=0.4) == signal.propose(grasp(), tare=0.4)


def test_an_unknown_rule():
    with pytest.raises(
        ValueError, match="unknown rule 'camera'; there are signal, tracking, command"
    ):
        propose("camera", grasp())


def test_an_unknown_parameter():
    with pytest.raises(
        ValueError, match="rule 'signal' knows no speed; its parameters are tare, rule"
    ):
        propose("signal", grasp(), speed=1)
