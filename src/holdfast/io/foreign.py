"""Files of other programs, read in a child process with one limit of memory and time.

The libraries that read them can abort (h5py, pyarrow), hang, or take all memory for a file that
is damaged or made by an attacker. The child ends then, and this process has one line.
One child reads all files of an import, one at a time: while nothing is read, it waits.

Requests and answers are lines of JSON on its pipes. Values come in a file of a private folder:
arrays of NumPy one after the other, of which the first is a document in JSON; never a pickle.
"""

import atexit
import errno
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from queue import SimpleQueue
from shutil import rmtree
from tempfile import mkdtemp
from threading import Thread
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.children import python_command
from holdfast.errors import EXTRA_MODULES, RecordingError
from holdfast.io.header import decode_header, encode_header, header_of
from holdfast.io.proposals import Proposal, ProposalError
from holdfast.io.safe_reading import recording_errors
from holdfast.io.timed_arrays import array_specs, arrays_of, recording_from
from holdfast.recordings import Recording
from holdfast.sensors import Sensor

if TYPE_CHECKING:
    from holdfast.io.importers.columns import Columns

MAX_MEMORY = 1 << 30
"""Memory that reading a file may take in the child [bytes]."""
MAX_CPU_SECONDS = 120
"""Time of the processor until the next recording of a file, or part of a video [s]."""
WAY_OUT = (
    "cut it into shorter files, or give `holdfast import` the option --no-limit for a file of your "
    "own"
)
"""End of the message about a file that reaches a limit."""
MAX_TEXT = 2000
"""Maximum length of the text of an error [characters]."""

_PROGRAM = "from holdfast.io.foreign import serve; serve(sys.argv[1])"
_ONE_THREAD = dict.fromkeys(
    ("ARROW_IO_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
) | {"ARROW_DEFAULT_MEMORY_POOL": "system"}
"""Environment of the child: stacks of threads and pools of memory would count as its memory."""
_VALUE_FILE = "value"
_NEXT = b"next\n"  # no JSON object, as a request is
Arrays = list[npt.NDArray[Any]]


class _Request(msgspec.Struct, frozen=True):
    """Request to read a file, with or without limits; paths are relative to `folder`."""

    task: str
    path: bytes  # a name may be no UTF-8, which JSON cannot hold
    options: dict[str, Any]
    folder: bytes
    limited: bool


class _Answer(msgspec.Struct, frozen=True):
    """Answer to a request: a value in the file, the end of the values, or the text of an error."""

    kind: Literal["ready", "value", "end", "memory", "error", "proposal"]
    text: str = ""


def read_foreign(
    path: Path,
    name: str,
    sensors: Mapping[str, Sensor] | None = None,
    columns: "Columns | None" = None,
    report: Callable[[str], None] = lambda _: None,
    *,
    limited: bool = True,
    accept: bool = False,
) -> Iterator[Recording]:
    """Yield the recordings in a file or folder of a format, which a child process reads.

    Args:
        path: path of the part.
        name: name of the format, one of `importers.FORMATS`.
        sensors: as in `importers.import_recordings`, of formats that take them.
        columns: the same.
        report: the same.
        limited: the same.
        accept: the same.

    Raises:
        ProposalError: the file does not say its layout.
        RecordingError: the child refuses it, ends, or takes more time or memory than it may.
    """
    skins = {key: skin.to_dict() for key, skin in (sensors or {}).items()}
    options = {"format": name, "sensors": skins, "columns": columns, "accept": accept}
    for document, arrays in _values("import", path, options, limited=limited):
        if not arrays:
            report(os.fsdecode(document))
            continue
        header = decode_header(document, path)
        pairs = zip(arrays[::2], arrays[1::2], strict=True)
        topics = (spec.topic for spec in array_specs(header))
        yield recording_from(header, dict(zip(topics, pairs, strict=True)), path)


def read_foreign_poses(
    path: Path, name: str, bodies: Mapping[str, str]
) -> dict[str, npt.NDArray[Any]]:
    """Return poses (n, 8) by body, as `importers.read_poses`, which a child process reads.

    Args:
        path: path of the file or folder.
        name: name of the format.
        bodies: as in `importers.read_poses`.

    Raises:
        RecordingError: as `read_foreign`.
    """
    ((document, arrays),) = _values("poses", path, {"format": name, "bodies": dict(bodies)})
    return dict(zip(msgspec.json.decode(document, type=list[str]), arrays, strict=True))


def read_stickers(
    path: Path, fps: float | None = None
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], dict[int, npt.NDArray[np.float64]]]:
    """Return times and brightness (n,) of the pictures of a video, and poses of its stickers.

    They are as `holdfast.io.stickers.sticker_poses` yields them, in a child process.

    Raises:
        RecordingError: as `read_foreign`.
    """
    if not path.is_file():
        raise RecordingError(f"{path} does not exist; a video expected")
    times: list[npt.NDArray[np.float64]] = []
    levels: list[npt.NDArray[np.float64]] = []
    parts: list[dict[int, npt.NDArray[np.float64]]] = []
    for document, (part_times, part_levels, *poses) in _values("stickers", path, {"fps": fps}):
        numbers = msgspec.json.decode(document, type=list[int])
        times.append(part_times)
        levels.append(part_levels)
        parts.append(dict(zip(numbers, poses, strict=True)))
    # A part names only the stickers that are seen in it.
    unseen = [np.full((len(part), 2, 3), np.nan) for part in times]
    poses_of = {
        number: np.concatenate(
            [part.get(number, gap) for part, gap in zip(parts, unseen, strict=True)]
        )
        for number in sorted({number for part in parts for number in part})
    }
    empty = np.zeros(0)
    return np.concatenate([empty, *times]), np.concatenate([empty, *levels]), poses_of


def limits() -> dict[str, bool]:
    """Return which limits this system has, by name."""
    return {"processor": os.name == "posix", "memory": sys.platform == "linux"}


def _values(
    task: str, path: Path, options: dict[str, Any], *, limited: bool = True
) -> Iterator[tuple[bytes, Arrays]]:
    """Yield the document and the arrays of each value that a child reads.

    If the caller stops iterating, the child is killed.
    """
    request = _Request(task, os.fsencode(path), options, os.fsencode(Path.cwd()), limited)
    # A child is kept for the next file: a start takes 0.3 s.
    child = _idle.pop() if _idle else _Child()
    try:
        answer = child.ask(msgspec.json.encode(request) + b"\n", path)
        while answer.kind == "value":
            yield child.value()
            answer = child.ask(_NEXT, path)
    except BaseException:  # also Ctrl-C, and an iterator that is left
        child.end()
        raise
    if answer.kind == "memory":
        child.end()  # what it could not use may be in pieces
        needs = f"{path} needs more than 1 GiB of memory: {WAY_OUT}"
        raise RecordingError(needs if limited else answer.text)
    _idle.append(child)
    if answer.kind == "proposal":
        raise ProposalError(msgspec.json.decode(answer.text, type=Proposal))
    if answer.kind == "error":
        raise RecordingError(answer.text)


class _Child:
    """A process that reads files of other programs; see `serve`.

    Raises:
        RecordingError: it cannot be started.
    """

    def __init__(self) -> None:
        self._folder = mkdtemp(prefix="holdfast-")
        try:
            self._process = subprocess.Popen(
                python_command(_PROGRAM, self._folder),
                # A pipe for its errors that is not read would fill, and block it.
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                env={**os.environ, **_ONE_THREAD},
            )  # fmt: skip
        except OSError as cause:
            rmtree(self._folder, ignore_errors=True)
            raise RecordingError(f"no process for reading can be started: {cause}") from cause
        if self._answer() is None:
            self.end()
            raise RecordingError("the process for reading does not start")

    def ask(self, line: bytes, path: Path) -> _Answer:
        """Return the answer to a line.

        Raises:
            RecordingError: the child ends.
        """
        with suppress(OSError):  # it has ended: there is no answer
            _pipe(self._process.stdin).write(line)
            _pipe(self._process.stdin).flush()
        if answer := self._answer():
            return answer
        code = self._process.wait()
        name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        if name == "SIGXCPU":  # the child has reached the limit that it set itself
            raise RecordingError(
                f"{path} takes more than {MAX_CPU_SECONDS} s of the processor to read: {WAY_OUT}"
            )
        # C++ libraries also abort where they get no memory; which of both it was cannot be told.
        memory = f", or needs more than 1 GiB of memory: {WAY_OUT}"
        raise RecordingError(
            f"{path} is damaged: it ended the process that read it ({name})"
            + (memory if name == "SIGABRT" else "")
        )

    def value(self) -> tuple[bytes, Arrays]:
        """Return the document and the arrays that the child wrote."""
        path = Path(self._folder, _VALUE_FILE)
        arrays: Arrays = []
        with path.open("rb") as file:
            while file.peek(1):
                arrays.append(np.lib.format.read_array(file, allow_pickle=False))
        path.unlink()
        return arrays[0].tobytes(), arrays[1:]

    def end(self) -> None:
        """End the process, and delete its files."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):  # the rest of a request
                _pipe(pipe).close()
        rmtree(self._folder, ignore_errors=True)

    def _answer(self) -> _Answer | None:
        """Return the next answer; None if the process has ended."""
        line = _pipe(self._process.stdout).readline()
        return msgspec.json.decode(line, type=_Answer) if line.endswith(b"\n") else None


_idle: list[_Child] = []
"""Children that wait. A fork of this process does not share them."""
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)


@atexit.register
def end_children() -> None:
    """End the children that wait."""
    while _idle:
        _idle.pop().end()


def _pipe(pipe: Any) -> BinaryIO:  # noqa: ANN401 (subprocess declares it as optional)
    stream: BinaryIO = pipe
    return stream


# The child process runs the functions below.


def serve(folder: str) -> None:
    """Answer requests until the parent ends; the main program of the child.

    Args:
        folder: folder for values.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the parent, which ends the child
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    lines: SimpleQueue[bytes] = SimpleQueue()
    Thread(target=_receive, args=(lines, folder), daemon=True).start()
    answer = _Answer("ready")
    values: Iterator[tuple[bytes, Arrays]] = iter(())
    while True:
        answers.write(msgspec.json.encode(answer) + b"\n")
        answers.flush()
        if (line := lines.get()) != _NEXT:
            values = _read(msgspec.json.decode(line, type=_Request))
        answer = _next_answer(values, Path(folder, _VALUE_FILE))


def _receive(lines: "SimpleQueue[bytes]", folder: str) -> None:
    """Pass on the lines of the parent; end this process with it, also while it reads a file."""
    for line in sys.stdin.buffer:
        lines.put(line)
    rmtree(folder, ignore_errors=True)
    # `sys.exit` would end this thread only.
    os._exit(0)


def _next_answer(values: Iterator[tuple[bytes, Arrays]], path: Path) -> _Answer:
    """Write the next value into a file; return the answer to the parent."""
    try:
        for document, arrays in values:
            with path.open("wb") as file:
                for array in (np.frombuffer(document, np.uint8), *arrays):
                    np.lib.format.write_array(file, array, allow_pickle=False)
            return _Answer("value")
    except ProposalError as cause:
        return _Answer("proposal", msgspec.json.encode(cause.proposal).decode())
    except Exception as cause:
        text = str(cause)[:MAX_TEXT].encode(errors="backslashreplace").decode()
        # A library may hide that no memory is left behind an error of its own.
        inner: BaseException | None = cause
        while inner is not None and not isinstance(inner, MemoryError):
            # The file of values has reached its limit, FSIZE.
            if isinstance(inner, OSError) and inner.errno == errno.EFBIG:
                break
            inner = inner.__cause__ or inner.__context__
        return _Answer("error" if inner is None else "memory", text)
    return _Answer("end")


def _read(request: _Request) -> Iterator[tuple[bytes, Arrays]]:
    """Yield the values of a request; each may take the same time."""
    # The working folder of the parent may have changed since the child began.
    os.chdir(os.fsdecode(request.folder))
    _limit_time(request)
    path = Path(os.fsdecode(request.path))
    with recording_errors(path):
        for value in _TASKS[request.task](path, request):
            yield value
            _limit_time(request)


def import_task(path: Path, request: _Request) -> Iterator[tuple[bytes, Arrays]]:
    """Yield the recordings in a file, and the reports about them."""
    from holdfast.io.importers import extra_of, importer, takes_sensors
    from holdfast.io.importers.columns import Columns

    name = str(request.options["format"])
    source = importer(name)
    # Before the limit: it is for the file, not for the libraries.
    for module in EXTRA_MODULES.get(extra_of(name) or "", ()):
        import_module(module)
    _limit_memory(request)
    lines: list[str] = []
    more: dict[str, object] = {}
    if takes_sensors(name):
        sensors = {key: Sensor.from_dict(skin) for key, skin in request.options["sensors"].items()}
        columns = msgspec.convert(request.options["columns"], Columns | None)
        more = {"sensors": sensors, "columns": columns, "report": lines.append}
        more["accept"] = request.options["accept"]
    try:
        for recording in source.read(path, **more):
            yield from _texts(lines)
            header = header_of(recording, path.stem)
            pairs = arrays_of(recording).values()
            yield encode_header(header), [array for pair in pairs for array in pair]
    except Exception:  # reports precede it
        yield from _texts(lines)
        raise


def _texts(lines: list[str]) -> Iterator[tuple[bytes, Arrays]]:
    """Yield texts for the parent, and remove them; a value without arrays is a text."""
    while lines:
        yield os.fsencode(lines.pop(0)), []


def poses_task(path: Path, request: _Request) -> Iterator[tuple[bytes, Arrays]]:
    """Yield the poses of bodies in a file as one value."""
    from holdfast.io.importers import importer

    source = importer(str(request.options["format"]))
    _limit_memory(request)
    poses = source.poses(path, request.options["bodies"])
    yield msgspec.json.encode(list(poses)), list(poses.values())


def stickers_task(path: Path, request: _Request) -> Iterator[tuple[bytes, Arrays]]:
    """Yield the poses of stickers in a video, part by part."""
    from holdfast.io.stickers import sticker_poses

    import_module("cv2")
    _limit_memory(request)
    for times, levels, poses in sticker_poses(path, request.options["fps"]):
        yield msgspec.json.encode(list(poses)), [times, levels, *poses.values()]


_TASKS: Mapping[str, Callable[[Path, _Request], Iterator[tuple[bytes, Arrays]]]] = {
    "import": import_task,
    "poses": poses_task,
    "stickers": stickers_task,
}


def _limit_time(request: _Request) -> None:
    """Limit the time of this process; that of the system counts from its start."""
    used = int(sum(os.times()[:2]))
    _limit("CPU", used + MAX_CPU_SECONDS + 1 if request.limited else None)


def _limit_memory(request: _Request) -> None:
    """Limit the memory of this process to what it has and that of a file, and its files."""
    _limit("CORE", 0)  # a crash leaves no image of the memory in the folder of the user
    # Of values, which the parent reads into its memory.
    _limit("FSIZE", MAX_MEMORY if request.limited else None)
    with suppress(OSError):  # there is no such file: only Linux has this limit
        status = Path("/proc/self/status").read_text()
        (used,) = re.findall(r"^VmData:\s+(\d+) kB", status, re.MULTILINE)
        # Addresses without memory are free.
        _limit("DATA", 1024 * int(used) + MAX_MEMORY if request.limited else None)


def _limit(name: str, value: int | None) -> None:
    """Set a limit of this process where the system has it; None for the highest."""
    if os.name == "posix":
        import resource

        kind = getattr(resource, f"RLIMIT_{name}")
        hard = resource.getrlimit(kind)[1]
        if value is None or (hard != resource.RLIM_INFINITY and value > hard):
            value = hard
        resource.setrlimit(kind, (value, hard))
