"""What the help of each verb shows, and what only `--help-all` shows."""

import re

import pytest

from holdfast.cli import app, main

SHOWN = {
    "detect": "--summary --in-contact --sensor --seconds --json",
    "serve": "--host --port --token-file --record-to --speed --once --in-contact --rerun "
    "--ros2 --json",
    "record": "--seconds --object --case --note --set --camera --force --json",
    "play": "--host --port --speed --once --json",
    "import": "--format --sensor --columns --no-labels --suffix --jobs --force --json",
    "label": "--tare --poses --track --author --browser --json",
    "teach": "--output --from --camera --to --resume --unattended --model --false-alarms "
    "--jobs --force --in-contact --json",
    "train": "--output --classifier --features --split --trials --own-slip-features --init --for "
    "--jobs --force --in-contact --json",
    "evaluate": "--sensor --jobs --plot --force --in-contact --json",
    "calibrate": "--output --false-alarms --seconds --in-contact --force --json",
    "demo": "--speed --browser --force --json",
    "simulate": "--objects --cases --repeats --profile --randomize --grasps --jobs --video "
    "--force --json",
    "hold": "--hand --law --armed --confirm --max-scale --max-force --on-fault --record --seconds "
    "--speed --in-contact --json",
    "export": "--like --sensor --fingers --float --format --fps --model --force --json",
    "datasets": "--only --force --json",
    "trial": "--out --laws --model --quick --n --plant --impacts --jobs --force --json",
    "study": "--out --twin --quick --full --jobs --tare --force --json",
    "label auto": "--tare --poses --track --video --author --dry-run --force --json",
}
"""Options that the help of a verb shows; that of all other verbs shows all."""


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
    return re.findall(r"^  (?:-\w, )?(--[\w-]+)", options, re.MULTILINE)


@pytest.mark.parametrize("verb", ALL_VERBS)
def test_help_shows_what_most_need_and_help_all_the_rest(verb, capsys):
    *shown, last = flags(capsys, verb, "--help")
    assert last == "--help"
    *everything, help_all, _ = flags(capsys, verb, "--help-all")
    assert help_all == "--help-all"
    if verb in SHOWN:
        assert shown == [*SHOWN[verb].split(), "--help-all"]
        assert set(shown[:-1]) < set(everything)
    else:
        assert shown == everything
    command = app.get_command(app._app(verb.split())).commands[verb]
    long = [option.opts[0] for option in command.params if option.opts[0].startswith("--")]
    assert everything == [flag for flag in long if flag != "--help-all"]


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


def test_a_rare_option_works_as_before(capsys):
    assert main(["detect", "builtin:any", "a.csv", "--raw", "--debounce", "1"]) == 2
    assert "--raw decides without debouncing" in capsys.readouterr().err
