import inspect
from collections import defaultdict

import pytest
from typer.models import OptionInfo

from holdfast.cli import app

OTHER_MEANING = {
    "--false-alarms": "of stability or slips by labels, and of slips in handling without labels",
    "--for": "the threshold that tune chooses, and the one answer that train fits",
    "--format": "of the input, and of exported recordings",
    "--fps": "of an exported dataset, and of a video of stickers",
    "--in-contact": "a declaration, and for an exported model a choice of two",
    "--model": "the detector of trials, and a model whose decisions a figure shows",
    "--rate": "of a sensor, and of a source against its model",
    "--seconds": "record until it is stopped, and a minute of handling",
    "--sensor": "of a CSV file, and of the fingers of an exported model",
    "--set": "metadata of a recording, and parameters of a rule",
    "--speed": "play cannot send as fast as possible",
    "--separate": "classifiers of the fingers, and sensors in a packet",
    "--unit": "of the readings of a file, and of a described sensor",
    "--video": "films each recording of the twin, and names the film of a recording",
    "-o": "the model file, and the folder of a report",
}
"""Flags that two verbs use for different things, with the difference."""


def declarations(verb):
    """Yield each flag of a verb with the object that declares it."""
    for name, option in inspect.signature(app.spread_groups(verb)).parameters.items():
        for declared in getattr(option.annotation, "__metadata__", ()):
            if not isinstance(declared, OptionInfo):
                continue
            words = [] if declared.default is ... else [declared.default]
            words += declared.param_decls or ()
            for word in words or [f"--{name.replace('_', '-')}"]:
                for flag in word.split("/"):
                    yield flag, declared


def test_every_flag_is_declared_once():
    declared = defaultdict(set)
    for name in (*app.VERBS, *app.SUB_VERBS):
        for flag, option in declarations(app.load_verb(name)):
            declared[flag].add(id(option))
    twice = {flag for flag, options in declared.items() if len(options) > 1}
    assert twice == set(OTHER_MEANING)


@pytest.mark.parametrize(("words", "port"), [([], "8080"), (["--port", "9"], "9")])
def test_the_options_of_a_group_have_the_defaults_of_the_verb(words, port, monkeypatch):
    from holdfast.cli.serve import serve

    seen = []

    def verb(**values) -> None:
        seen.append(values)

    verb.__signature__ = inspect.signature(serve)
    monkeypatch.setattr(app, "load_verb", lambda name: verb)
    assert app.main(["serve", "builtin:any", "twin:", *words]) == 0
    (values,) = seen
    assert str(values["access"].port) == port
    assert values["options"].debounce is None
