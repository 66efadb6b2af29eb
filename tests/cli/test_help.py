"""Help of each verb: its options, and examples that work when pasted."""

import inspect
import re

import pytest
from typer.models import OptionInfo

from holdfast.cli import app, main
from holdfast.cli.options import RARE
from holdfast.io.importers import FORMATS, IMPORTER_PLUGINS, import_hint

ALL_VERBS = [*app.VERBS, *app.SUB_VERBS]


def help_of(capsys, verb, option):
    """Return the text before the options, and the options."""
    assert main([*verb.split(), option]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert all(len(line) <= 80 for line in out.splitlines())
    return out.split("\nOptions:\n")


def flags(capsys, verb, option):
    _, options = help_of(capsys, verb, option)
    return set(re.findall(r"^  (?:-\w, )?(--[\w-]+)", options, re.MULTILINE))


@pytest.mark.parametrize("verb", ALL_VERBS)
def test_help_leaves_out_rare_options_and_help_all_shows_all(verb, capsys):
    parameters = inspect.signature(app.spread_groups(app.load_verb(verb))).parameters.values()
    marks = [getattr(parameter.annotation, "__metadata__", ()) for parameter in parameters]
    n_options = sum(any(isinstance(x, OptionInfo) for x in given) for given in marks)
    n_rare = sum(RARE in given for given in marks)
    everything, shown = (flags(capsys, verb, option) for option in ("--help-all", "--help"))
    assert shown <= everything
    assert len(everything) == n_options + 2  # --help and --help-all
    assert len(everything - shown) == (n_rare or 1)
    assert n_rare or everything - shown == {"--help-all"}


@pytest.mark.parametrize("verb", ALL_VERBS)
def test_examples_use_only_options_that_the_help_shows(verb, capsys):
    text, _ = help_of(capsys, verb, "--help")
    _, examples = text.replace("\\\n", " ").split("Example:\n")
    commands = [line.split() for line in examples.splitlines() if "holdfast " in line]
    assert commands
    for words in commands:
        first = words.index("holdfast") + 1
        two, one = " ".join(words[first : first + 2]), words[first]
        _, options = help_of(capsys, two if two in app.SUB_VERBS else one, "--help")
        # The names of an option, as `-o, --output` or `--browser / --no-browser`.
        columns = (re.split(r" {2,}", line.strip())[0] for line in options.splitlines())
        shown = {name for column in columns for name in re.findall(r"--[\w-]+", column)}
        used = {word.partition("=")[0] for word in words if word.startswith("--")}
        assert used <= shown, " ".join(words)


@pytest.mark.parametrize("name", [*FORMATS, *IMPORTER_PLUGINS.names()])
def test_hints_of_import_name_its_options_or_another_verb(name, capsys):
    for verb, option in re.findall(r"(holdfast [a-z]+ )?(--[\w-]+)", import_hint(name)):
        assert option in flags(capsys, verb[9:].strip() or "import", "--help-all")
