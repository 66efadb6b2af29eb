"""format.js: numbers, states and times for people."""

import pytest

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
        ("faultWord", "packet_gap", "packets missing"), ("faultWord", "a_new_one", "a new one"),
        ("unitWord", "count", "counts"), ("unitWord", "N", "N"),
    ],
)  # fmt: skip
def test_words(module, name, value, text):
    assert module.evaluate(CALL, [name, value]) == text


def test_every_state_reason_and_fault_has_its_words(module):
    from holdfast.contact import ContactState, Fault, Reason

    words = module.evaluate("import('/page/format.js').then((m) => m.STATES)")
    assert words == [state.value for state in ContactState]
    for name, members in (("reasonWord", Reason), ("faultWord", Fault)):
        texts = [module.evaluate(CALL, [name, member.value]) for member in members]
        assert len(set(texts)) == len(members)
        assert not any("_" in text for text in texts)
