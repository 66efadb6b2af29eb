"""format.js: numbers, states and times for people."""

import pytest

from holdfast.contact import ContactState, Reason

CALL = "async ([name, value]) => (await import('/page/format.js'))[name](value)"


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("number", None, "–"), ("number", 0, "0.00"), ("number", -3.14159, "−3.14"),
        ("number", 12.345, "12.3"), ("number", -99.96, "−100"), ("number", 7452.4, "7452"),
        ("number", 123456, "123k"), ("number", -0.001, "0.00"),
        ("percent", 0.876, "88\u202f%"), ("percent", None, "–"),
        ("duration", 2.34, "2.3 s"), ("duration", 64, "64 s"), ("duration", 600, "10 min"),
        ("duration", -0.1, "0.0 s"), ("duration", 7200, "2 h"),
        ("latency", 0.00021, "0.21 ms"), ("latency", 0.0123, "12 ms"), ("latency", 2, "2.0 s"),
        ("latency", None, "–"), ("clock", 7.9, "0:07"), ("clock", 3723, "1:02:03"),
        ("fileSize", 0, "0 B"), ("fileSize", 1234, "1.2 kB"), ("fileSize", 784000, "784 kB"),
        ("fileSize", 2.1e9, "2.1 GB"), ("stateKey", "NO_CONTACT", "no-contact"),
        ("stateKey", "<b>", "unknown"), ("stateWord", "NO_CONTACT", "NO CONTACT"),
        ("reasonWord", "warm_up", "warming up"), ("reasonWord", "", ""),
        ("faultWord", "a_new_one", "a new one"), ("share", 0.5, "50\u202f%"),
        ("share", 0.995, "99.5\u202f%"),
        ("share", 0.99954, "99.95\u202f%"), ("share", 0.68997, "69\u202f%"), ("share", None, "–"),
        ("unitWord", "count", "counts"), ("unitWord", "N", "N"),
    ],
)  # fmt: skip
def test_words(module, name, value, text):
    assert module.evaluate(CALL, [name, value]) == text


def test_every_state_and_reason_has_its_words(module):
    words = module.evaluate("import('/page/format.js').then((m) => m.STATES)")
    assert words == [state.value for state in ContactState]
    texts = [module.evaluate(CALL, ["reasonWord", reason.value]) for reason in Reason]
    assert len(set(texts)) == len(Reason)
    assert not any("_" in text for text in texts)


def test_faults_have_the_words_of_the_service(module):
    call = "async ([fault, texts]) => (await import('/page/format.js')).faultWord(fault, texts)"
    texts = {"late": {"words": "too late", "advice": "hurry"}}
    assert module.evaluate(call, ["late", texts]) == "too late"
    assert module.evaluate(call, ["clock_jump", texts]) == "clock jump"


@pytest.mark.parametrize(
    ("state", "probability", "debounce", "words"),
    [
        ("UNSTABLE", 0.98, {}, "held for 0.1 s after the last alarm"),
        ("UNSTABLE", 0.98, {"hold": 0}, None),
        ("UNSTABLE", 0.98, {"hold": 0, "min_duration": 0.05}, "stable when it lasts 0.05 s"),
        ("UNSTABLE", 0.55, {"hysteresis": 0.1}, "stable from 60\u202f%"),
        ("UNSTABLE", 0.49, {}, None),
        ("UNSTABLE", None, {}, None),
        ("STABLE", 0.45, {"hysteresis": 0.1}, "unstable below 40\u202f%"),
        ("STABLE", 0.2, {"min_duration": 0.05}, "unstable when it lasts 0.05 s"),
        ("STABLE", 0.98, {}, None),
        ("NO_CONTACT", 0.98, {}, None),
    ],
)
def test_a_state_that_differs_from_its_probability_is_explained(
    module, state, probability, debounce, words
):
    call = "async (given) => (await import('/page/format.js')).debounceNote(...given)?.long ?? null"
    finger = {"state": state, "stable_probability": probability}
    debounce = {"min_duration": 0.0, "hysteresis": 0.0, "hold": 0.1} | debounce
    assert module.evaluate(call, [finger, 0.5, debounce]) == words
