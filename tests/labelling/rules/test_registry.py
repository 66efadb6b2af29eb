import pytest

from holdfast.labelling.rules import RULES, propose, signal

from .build import grasp


def test_rules_by_name():
    assert list(RULES) == ["signal", "tracking", "command"]
    assert propose("signal", grasp(), tare=0.4) == signal.propose(grasp(), tare=0.4)


def test_thresholds_are_given_by_name():
    given = propose("signal", grasp(), share=0.5)["thumb"]
    assert given == signal.propose(grasp(), rule=signal.SignalRule(share=0.5))["thumb"]
    assert given != propose("signal", grasp())["thumb"]


@pytest.mark.parametrize(
    ("rule", "words", "text"),
    [
        ("camera", {}, "'camera'; there are signal, tracking, command"),
        ("signal", {"speed": 1}, "speed; .*tare, share"),
        ("command", {"share": 1}, "share; .*tare, delay, opening"),
        *(("signal", {"share": value}, "share: ") for value in (0, -1.0, float("nan"), None)),
        ("tracking", {"speed": 0}, "speed: "),
    ],
)
def test_an_unknown_rule_or_parameter(rule, words, text):
    with pytest.raises(ValueError, match=text):
        propose(rule, grasp(), **words)
