"""What verbs print goes to stdout whole, while a bar is on the terminal of stderr."""

import json
import re
import subprocess
import sys

import pytest

from cli.terminal.test_status_line import Terminal
from holdfast.cli import main
from holdfast.cli.terminal import progress
from study.example_recordings import save_synthetic

CONTROL = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")


class AtOnce:
    """Timer whose time has come already."""

    def __init__(self, delay, call):
        self.start = call

    def cancel(self):
        pass


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with two recordings in `data`."""
    folder = tmp_path_factory.mktemp("bars")
    save_synthetic(folder / "data", range(2))
    return folder


VERBS = [
    ("detecting", "detect builtin:noise-floor data/grasp-0.parquet"),
    ("detecting", "detect builtin:noise-floor data/grasp-0.parquet --summary --json"),
    ("evaluating", "evaluate builtin:noise-floor data"),
    ("reading", "info data --json"),
    ("importing", "import data {out} --suffix mcap --jobs 1 --json"),
    ("labelling", "label auto signal data --dry-run --json"),
    ("gaps 0", "record data/grasp-0.parquet {out}/a.mcap --speed 0 --json"),
]
"""Words on the bar of a verb, and its command line: each kind of display and of result once."""


@pytest.mark.parametrize(("bar", "command"), VERBS, ids=[command for _, command in VERBS])
def test_stdout_gets_everything_and_the_terminal_none_of_it(
    bar, command, folder, tmp_path, monkeypatch, capsys
):
    terminal = Terminal()
    monkeypatch.chdir(folder)
    monkeypatch.setattr(progress, "Timer", AtOnce)
    monkeypatch.setattr(progress, "DISPLAY_DELAY", -1.0)
    for name, value in {"TERM": "xterm", "COLUMNS": "80"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "stderr", terminal)
    words = command.format(out=tmp_path).split()
    assert main(words) == 0
    shown = CONTROL.sub("", terminal.getvalue())
    assert bar in shown
    lines = [line for line in capsys.readouterr().out.splitlines() if line]
    assert lines
    assert not any(line[:40] in shown for line in lines)
    if "--json" in words:
        assert len(lines) == 1
        assert isinstance(json.loads(lines[0]), dict)


def test_a_reader_that_stops_ends_detect_quietly(folder):
    """As `| head` does: exit code 0, and no message about it."""
    code = "import sys; from holdfast.cli import main; sys.exit(main())"
    words = ["detect", "builtin:noise-floor", folder / "data" / "grasp-0.parquet"]
    child = subprocess.Popen(
        [sys.executable, "-c", code, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    with child:
        assert child.stdout.readline().startswith(b'{"time":')
        child.stdout.close()
        (line,) = child.stderr.read().splitlines()
    assert b"no slip rule" in line
    assert child.returncode == 0
