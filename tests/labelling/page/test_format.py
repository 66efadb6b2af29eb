"""format.js and keyboard.js: labels, numbers and times for people; keys."""

import pytest

from holdfast.labelling.server.store import CAUSE_NAMES, STATE_NAMES

CALL = "async ([name, given]) => (await import('/page/format.js'))[name](...given)"


@pytest.mark.parametrize(
    ("name", "given", "text"),
    [
        ("labelText", [{"state": "unstable", "cause": "slip"}], "unstable, slip"),
        ("labelText", [{"state": "no_contact", "cause": None}], "no contact"),
        ("stateKey", ["no_contact"], "no-contact"),
        ("stateKey", ["<b>"], "unknown"),
        ("number", [None], "–"),
        ("number", [-3.14159], "−3.14"),
        ("number", [12345.6], "12346"),
        ("percent", [0.876], "88\u202f%"),
        ("timeText", [1.23456, 0.01], "1.23"),
        ("timeText", [-2, 1], "−2"),
        ("timeText", [100, 20], "100"),
        ("spanText", [{"start": 1.32, "end": 2.01}], "1.320 – 2.010 s (0.690 s)"),
        ("durationText", [31.2], "31 s"),
        ("durationText", [245], "4:05 min"),
        ("durationText", [None], "–"),
        ("countOf", [1, "label"], "1 label"),
        ("countOf", [0, "label"], "0 labels"),
        ("dateText", ["no time"], "no time"),
        ("dateText", [""], ""),
        ("unitWord", ["count"], "counts"),
    ],
)
def test_texts(module, name, given, text):
    assert module.evaluate(CALL, [name, given]) == text


def test_states_and_causes_equal_those_of_the_service(module):
    states, causes = module.evaluate("import('/page/format.js').then((m) => [m.STATES, m.CAUSES])")
    assert states == list(STATE_NAMES)
    assert sorted(causes) == sorted(CAUSE_NAMES)


def test_every_key_has_one_command(module):
    keys = module.evaluate("""async () => {
      const { keyBindings } = await import("/page/keyboard.js");
      return Object.keys(keyBindings({}));
    }""")
    letters = set("cdslrk") | set("123axgnpefyb0?")
    assert letters <= set(keys)


def test_every_cause_has_a_key_of_its_own(module):
    call = "async (causes) => causes.map((await import('/page/format.js')).causeKey)"
    keys = module.evaluate(call, [str(cause) for cause in CAUSE_NAMES])
    assert keys == ["c", "d", "s", "l", "r", "k"]
    assert not set(keys) & set("axgnpefyb")


@pytest.mark.parametrize(
    ("minimum", "step"), [(0.9, 1), (1, 1), (1.1, 2), (3, 5), (6, 10), (0.012, 0.02), (700, 1000)]
)
def test_nice_step(module, minimum, step):
    assert module.evaluate(CALL, ["niceStep", [minimum]]) == pytest.approx(step)
