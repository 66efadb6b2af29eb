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
        ValueError, match="rule 'signal' has no parameter speed; its parameters are tare, share, "
    ):
        propose("signal", grasp(), speed=1)


def test_thresholds_are_given_by_name():
    given = propose("signal", grasp(), share=0.5)["thumb"]
    assert given == signal.propose(grasp(), rule=signal.SignalRule(share=0.5))["thumb"]
    assert given != propose("signal", grasp())["thumb"]


@pytest.mark.parametrize("value", [0, -1.0, float("nan"), None])
def test_invalid_thresholds(value):
    with pytest.raises(ValueError, match="share: a number above 0 expected"):
        propose("signal", grasp(), share=value)
    with pytest.raises(ValueError, match="speed: a number above 0 expected"):
        propose("tracking", grasp(), speed=value)


def test_a_rule_without_thresholds():
    with pytest.raises(
        ValueError, match="has no parameter share; its parameters are tare, delay, opening"
    ):
        propose("command", grasp(), share=1)
