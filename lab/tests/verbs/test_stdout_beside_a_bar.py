"""What verbs print goes to stdout whole, while a bar is on the terminal of stderr."""

import json
import os
import pty
import re
import subprocess
import sys
import threading

import pytest

from holdfast.cli import main
from holdfast.cli.terminal import progress
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

FINGERS = ("thumb", "index")
FORCED_BAR = """
import sys
from holdfast.cli import main
from holdfast.cli.terminal import progress
from holdfast.cli.terminal.console import print_line, print_message

class AtOnce:
    def __init__(self, delay, call): self.start = call
    def cancel(self): pass

progress.Timer, progress.DISPLAY_DELAY = AtOnce, -1.0
sys.exit(main())
"""
"""Program of a child process: holdfast, whose bars appear before their first step."""
CONTROL = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")


class Terminal:
    """Pseudo-terminal that keeps what it receives.

    Attributes:
        end: file descriptor of the end that a program writes to.
    """

    def __init__(self):
        self._ours, self.end = pty.openpty()
        self._received = b""
        self._thread = threading.Thread(target=self._receive)
        self._thread.start()

    def _receive(self):
        while True:
            try:
                data = os.read(self._ours, 65536)
            except OSError:  # all writers have closed it
                return
            if not data:
                return
            self._received += data

    def text(self):
        """Return what it received until every program closed it."""
        self._thread.join()
        os.close(self._ours)
        return self._received.decode()


class AtOnce:
    """Timer whose time has come already."""

    def __init__(self, delay, call):
        self.start = call

    def cancel(self):
        pass


@pytest.fixture
def at_terminal(monkeypatch, tmp_path):
    """Return a function that runs something with stderr on a terminal and stdout in a file."""
    monkeypatch.setattr(progress, "Timer", AtOnce)
    monkeypatch.setattr(progress, "DISPLAY_DELAY", -1.0)
    for name, value in {"TERM": "xterm", "COLUMNS": "80"}.items():
        monkeypatch.setenv(name, value)

    def run(call):
        terminal, path = Terminal(), tmp_path / "stdout.txt"
        try:
            with (
                os.fdopen(terminal.end, "w") as err,
                path.open("w") as out,
                monkeypatch.context() as m,
            ):
                m.setattr(sys, "stderr", err)
                m.setattr(sys, "stdout", out)
                call()
        finally:
            shown = terminal.text()
        return path.read_text(), shown

    return run


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two recordings of two fingers in `data`, and one of them alone."""
    folder = tmp_path_factory.mktemp("bars")
    (folder / "data").mkdir()
    for k in range(2):
        recording = synthetic_recording(f"grasp-{k}", k, FINGERS)
        save_recording(recording, folder / "data" / f"grasp-{k}.parquet")
    save_recording(synthetic_recording("grasp", 3, FINGERS), folder / "grasp.parquet")
    return folder


VERBS = [
    ("detecting", "detect builtin:noise-floor grasp.parquet"),
    ("detecting", "detect builtin:noise-floor grasp.parquet --summary --json"),
    ("evaluating", "evaluate builtin:noise-floor data"),
    ("reading", "info data --json"),
    ("importing", "import data {out} --suffix mcap --jobs 1 --json"),
    ("labelling", "label auto signal data --dry-run --json"),
    ("gaps 0", "record grasp.parquet {out}/a.mcap --speed 0 --json"),
]
"""Words on the bar of a verb, and its command line: each kind of display and of result once."""


@pytest.mark.parametrize(("bar", "command"), VERBS, ids=[command for _, command in VERBS])
def test_the_file_gets_everything_and_the_terminal_none_of_it(
    bar, command, at_terminal, folder, tmp_path, monkeypatch
):
    monkeypatch.chdir(folder)
    words = command.format(out=tmp_path).split()
    codes = []
    printed, shown = at_terminal(lambda: codes.append(main(words)))
    assert codes == [0], shown[-1000:]
    assert bar in shown
    lines = [line for line in printed.splitlines() if line]
    assert lines
    assert not any(line[:40] in CONTROL.sub("", shown) for line in lines)
    if "--json" in words:
        assert len(lines) == 1
        assert isinstance(json.loads(lines[0]), dict)


def test_a_reader_that_stops_ends_detect_quietly(folder):
    """As `| head` does: exit code 0, no message, and the cursor is shown again."""
    terminal = Terminal()
    words = ["detect", "builtin:noise-floor", folder / "grasp.parquet"]
    child = subprocess.Popen(
        [sys.executable, "-c", FORCED_BAR, *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=terminal.end,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "80"},
    )
    os.close(terminal.end)
    with child:
        assert child.stdout.readline().startswith(b'{"time":')
        child.stdout.close()
    shown = terminal.text()
    assert child.returncode == 0
    text = " ".join(CONTROL.sub("", shown).split())  # the terminal breaks long lines
    rest, n_messages = re.subn(r"builtin:noise-floor has no slip rule: .* adds one\)", "", text)
    assert n_messages == 1
    # "detect: working ..." is shown if the first sample takes longer than a second.
    assert re.sub(r"detectworking|detecting", "", re.sub(r"[^a-zA-Z]", "", rest)) == ""
    assert shown.rindex("\x1b[?25h") > shown.rindex("\x1b[?25l")
