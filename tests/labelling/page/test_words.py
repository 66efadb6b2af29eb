"""words.js: labels, numbers and times as people read them."""

import pytest

from holdfast.labelling.server.store import CAUSES, STATES

CALL = "async ([name, given]) => (await import('/page/words.js'))[name](...given)"


@pytest.mark.parametrize(
    ("name", "given", "text"),
    [
        ("labelWord", [{"state": "unstable", "cause": "slip"}], "unstable, slip"),
        ("labelWord", [{"state": "no_contact", "cause": None}], "no contact"),
        ("stateKey", ["no_contact"], "no-contact"),
        ("stateKey", ["<b>"], "unknown"),
        ("number", [None], "–"),
        ("number", [-3.14159], "−3.14"),
        ("number", [12345.6], "12346"),
        ("percent", [0.876], "88\u202f%"),
        ("timeWord", [1.23456, 0.01], "1.23"),
        ("timeWord", [-2, 1], "−2"),
        ("timeWord", [100, 20], "100"),
        ("spanWord", [{"start": 1.32, "end": 2.01}], "1.320 – 2.010 s (0.690 s)"),
        ("lengthWord", [31.2], "31 s"),
        ("lengthWord", [245], "4:05 min"),
        ("lengthWord", [None], "–"),
        ("many", [1, "label"], "1 label"),
        ("many", [0, "label"], "0 labels"),
        ("whenWord", ["no time"], "no time"),
        ("whenWord", [""], ""),
        ("unitWord", ["count"], "counts"),
    ],
)
def test_words(module, name, given, text):
    assert module.evaluate(CALL, [name, given]) == text


def test_states_and_causes_are_those_of_the_service(module):
    states, causes = module.evaluate(
        "import('/page/words.js').then((words) => [words.STATES, words.CAUSES])"
    )
    assert states == list(STATES)
    assert sorted(causes) == sorted(CAUSES)


def test_every_key_does_one_thing(module):
    keys = module.evaluate("""async () => {
      const { keys } = await import("/page/bindings.js");
      return Object.keys(keys({}));
    }""")
    letters = {cause[0] for cause in CAUSES} | set("123axgnpefyb0?")
    assert letters <= set(keys)
    assert len({cause[0] for cause in CAUSES}) == len(CAUSES)
    assert not {cause[0] for cause in CAUSES} & set("axgnpefyb")


@pytest.mark.parametrize(
    ("least", "step"), [(0.9, 1), (1, 1), (1.1, 2), (3, 5), (6, 10), (0.012, 0.02), (700, 1000)]
)
def test_steps_of_an_axis(module, least, step):
    assert module.evaluate(CALL, ["niceStep", [least]]) == pytest.approx(step)
