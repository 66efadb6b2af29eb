"""Files of other programs are read in a child process, whose end is one line."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from holdfast.children import python_command
from holdfast.errors import RecordingError
from holdfast.io import FORMATS, foreign, import_recordings
from holdfast.io.importers import IMPORTER_PLUGINS

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs signals and pipes")

CRASHES = {
    "abort": ("os.abort()", "SIGABRT"),
    "exit": ("os._exit(3)", r"exit code 3"),
    "loop": ("exec('while True: pass')", r"more than \d+ s of the processor .* --no-limit"),
    "bomb": ("numpy.ones(2 * 10**9)", "1 GiB of memory: .* --no-limit"),
    "file": (
        "__import__('tempfile').TemporaryFile().truncate(2 * 10**9)",
        "1 GiB of memory: .* --no-limit",
    ),
    "error": ("[][1]", "list index out of range"),
    "print": ("print('{}') or [][1]", "list index out of range"),
    "interrupt": ("os.kill(os.getpid(), 2) or [][1]", "list index out of range"),
}
"""What a library does in the child, and the message."""


@pytest.fixture
def file(tmp_path):
    """A file of another program, and a child of its own."""
    foreign.end_children()
    path = tmp_path / "log.csv"
    path.write_text("time,x\n0,1\n")
    yield path
    foreign.end_children()


@pytest.mark.parametrize(("code", "message"), CRASHES.values(), ids=CRASHES)
def test_whatever_a_library_does_is_one_line(file, monkeypatch, code, message):
    program = (
        "import os, numpy; from holdfast.io import foreign\n"
        "from holdfast.io.importers import xela_log\n"
        "foreign.MAX_CPU_SECONDS = 1\n"
        f"def read(path):\n    {code}\n    yield\n"
        "xela_log.read = read\n"
    )
    monkeypatch.setattr(foreign, "_PROGRAM", program + foreign._PROGRAM)
    with pytest.raises(RecordingError, match=message) as refused:
        list(import_recordings(file, "xela-log"))
    assert str(file) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.fixture
def tables(tmp_path):
    """A folder of two tables."""
    folder = tmp_path / "tables"
    folder.mkdir()
    for name in "ab":
        rows = ("# sensor: uskin-curved", ",".join(COLUMNS), *(ROW.format(k / 100) for k in (0, 1)))
        (folder / f"{name}.csv").write_text("\n".join(rows))
    return folder


COLUMNS = ("time", *(f"t{taxel:02}.{axis}" for taxel in range(1, 31) for axis in "xyz"))
ROW = "{}" + 90 * ",1"


def test_one_child_reads_all_files(tables, file):
    for _ in range(2):
        assert [recording.name for recording in import_recordings(tables)] == ["a", "b"]
        with pytest.raises(RecordingError, match="1104"):
            list(import_recordings(file, "xela-log"))
        (child,) = foreign._idle
        number = child._process.pid
    assert number == child._process.pid
    folder = Path(child._folder)
    assert not list(folder.iterdir())
    foreign.end_children()
    assert not folder.exists()


def test_an_iterator_that_is_left_ends_its_child(tables, file):
    recordings = import_recordings(tables)
    next(recordings)
    recordings.close()
    assert foreign._idle == []


@pytest.mark.parametrize("kind", [signal.SIGKILL, signal.SIGINT])
def test_a_child_ends_with_its_parent(tmp_path, kind):
    """Also while it waits for a pipe that nobody writes to."""
    os.mkfifo(tmp_path / "pipe")
    hanging = (
        "from holdfast.io.importers import xela_log; xela_log.poses = lambda *_: open('pipe'); "
    )
    program = (
        "from pathlib import Path; from holdfast.io import foreign\n"
        f"foreign._PROGRAM = {hanging!r} + foreign._PROGRAM\n"
        "child = foreign._Child(); foreign._idle.append(child)\n"
        "print(child._process.pid, child._folder, flush=True)\n"
        "foreign.read_foreign_poses(Path('.'), 'xela-log', {})\n"
    )
    parent = subprocess.Popen(
        python_command(program), cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    with parent:
        number, folder = parent.stdout.readline().split()
        time.sleep(0.5)
        parent.send_signal(kind)
    with suppress(ProcessLookupError):
        while True:  # the time limit of the test ends it
            os.kill(int(number), 0)
            if b") Z " in Path(f"/proc/{int(number)}/stat").read_bytes():
                break
            time.sleep(0.01)
    while Path(os.fsdecode(folder)).exists():
        time.sleep(0.01)


def test_a_fork_has_a_child_of_its_own(tables, file):
    list(import_recordings(tables))
    number = os.fork()
    if not number:
        list(import_recordings(tables))
        foreign.end_children()
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(number, 0)[1]) == 0
    assert len(list(import_recordings(tables))) == 2


def test_the_answer_is_no_pickle(file):
    child = foreign._Child()
    value = Path(child._folder, "value")
    with value.open("wb") as file_of_value:
        np.save(file_of_value, np.array([{}], object), allow_pickle=True)
    with pytest.raises(ValueError, match="Object"):
        child.value()
    child.end()


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have fewer limits")
def test_a_file_of_ones_own_is_read_without_limits(file, monkeypatch):
    program = (
        "import resource; from holdfast.io.importers import xela_log\n"
        "KINDS = ('RLIMIT_CPU', 'RLIMIT_DATA', 'RLIMIT_FSIZE')\n"
        "def read(path):\n"
        "    pairs = [resource.getrlimit(getattr(resource, kind)) for kind in KINDS]\n"
        "    raise ValueError([soft == hard for soft, hard in pairs])\n"
        "xela_log.read = read\n"
    )
    monkeypatch.setattr(foreign, "_PROGRAM", program + foreign._PROGRAM)
    for limited in (True, False, True):
        with pytest.raises(RecordingError, match=str([not limited] * 3)[1:-1]):
            list(import_recordings(file, "xela-log", limited=limited))
    assert foreign.limits() == {"processor": True, "memory": True}


PARTS = (
    *("data_sample_1/xela_sensor1.csv", "data_sample_1/robot_state.csv", "seq_1.pt", "a.csv"),
    *("a.h5", "a.bag", "a.mcap", "a.db3", "metadata.yaml", "meta/info.json"),
)
"""Names of files that an importer would open in a folder."""


@pytest.mark.parametrize("name", ["uskin-pick-move", "csv"])
def test_every_format_is_read_in_the_child(tmp_path, monkeypatch, name, file):
    for part in PARTS:
        (tmp_path / part).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / part).write_text("a,b\n1,2\n")
    program = f"import os; from holdfast.io.importers import importer\nimporter({name!r}).read = "
    program += "lambda *_, **__: os.abort()\n"
    monkeypatch.setattr(foreign, "_PROGRAM", program + foreign._PROGRAM)
    with pytest.raises(RecordingError, match="SIGABRT"):
        list(import_recordings(tmp_path, name))


@pytest.mark.parametrize("name", (*FORMATS, *IMPORTER_PLUGINS.names()))
def test_no_importer_opens_a_pipe_in_a_folder(tmp_path, name):
    for part in PARTS:
        (tmp_path / part).parent.mkdir(parents=True, exist_ok=True)
        os.mkfifo(tmp_path / part)
    with pytest.raises(RecordingError, match=r"a pipe or a device; a reg|expected"):
        list(import_recordings(tmp_path, name))
