"""Tasks whose results are stored, so that a stopped command continues where it stopped."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

from msgspec import UNSET, MsgspecError, Raw, Struct, UnsetType, msgpack

from holdfast.errors import EngineError, OutputError
from holdfast.files import write_whole
from holdfast.parallel import Engine

T = TypeVar("T")
Notify = Callable[[str], None]

PACKAGES = ("holdfast", "holdfast_grip", "holdfast_interop", "holdfast_lab")
"""Packages that make results; other packages are pinned by the lock file."""
SOURCE_SUFFIXES = (".py", ".csv", ".json", ".toml", ".c", ".h")
VERSION_FILE = "version"
"""Name of the file beside the stored results with the digest of the source that made them."""


class Task(NamedTuple):
    """A call of a function whose result depends only on its arguments.

    Attributes:
        name: unique among the tasks: `window/index/14`.
        function: at the top level of a module of the package.
        arguments: values that msgspec can encode: Structs, numbers, text, None, lists of them.
        result: type of the result, for decoding by msgspec.
        cost: expected duration, in a unit that is the same for all tasks.
    """

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    result: Any
    cost: float = 1.0


class ShowProgress(Protocol):
    """Function that passes items on, and may show their progress meanwhile."""

    def __call__(
        self, items: Iterable[T], what: str, total: float, cost: Callable[[T], float]
    ) -> Iterator[T]:
        """Yield the items.

        Args:
            items: to pass on.
            what: title of the work.
            total: sum of the costs of all items.
            cost: from an item to its cost.
        """
        ...


@dataclass(frozen=True)
class TaskRunner:
    """Runs tasks and stores the result of each in its own file.

    The name of the file is a digest of the function and the arguments. All results of the folder
    are of one source: those of another one are removed. A stored result is therefore never
    outdated, and a command that is stopped loses only the tasks that were running.

    Attributes:
        folder: of the outputs; results are stored in `folder/work`.
        engine: that runs the tasks.
        progress: that passes on the finished tasks.
        notify: that is called with messages for the user.
    """

    folder: Path
    engine: Engine = Engine()  # noqa: RUF009 (a tuple: it cannot change)
    progress: ShowProgress = lambda items, _, __, ___: iter(items)
    notify: Notify = lambda _: None

    def run(self, tasks: Sequence[Task]) -> dict[str, Any]:
        """Return the result of each task, by name; tasks of high cost are started first.

        Raises:
            ValueError: two tasks have the same name.
            EngineError: as `Engine.map_unordered`, or a worker has another version of the package.
            Exception: of a task, its text beginning with the name of the task. Later tasks are
                not run; the results of earlier ones stay stored.
        """
        keys = _keys(tasks)
        folder = self._path("").parent
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._remove_outdated(folder)
        except OSError as cause:
            raise OutputError(f"cannot write {folder}: {cause.strerror}") from cause
        by_key = {keys[task.name]: task for task in tasks}
        results = {key: self._load(key, task) for key, task in by_key.items()}
        missing = [task for key, task in by_key.items() if results[key] is UNSET]
        if len(missing) < len(by_key):
            self.notify(f"{len(by_key) - len(missing)} of {len(by_key)} tasks are already done")
        total = sum(task.cost for task in missing)
        done = self._run_missing(missing, keys)
        for task, result in self.progress(done, "working", total, lambda pair: pair[0].cost):
            results[keys[task.name]] = result
        return {name: results[key] for name, key in keys.items()}

    def _run_missing(
        self, tasks: Iterable[Task], keys: Mapping[str, str]
    ) -> Iterator[tuple[Task, Any]]:
        """Yield each task with its result, after storing it."""
        by_name = {task.name: task for task in sorted(tasks, key=lambda task: -task.cost)}
        source = source_digest()  # sent along, because a worker may have another version
        calls = ((name, (source, *task[:3])) for name, task in by_name.items())
        for name, (data, seconds) in self.engine.map_unordered(_call, calls):
            # Decoded before it is stored: a result of another type than promised is no result.
            try:
                result = msgpack.decode(data, type=by_name[name].result)
            except MsgspecError as cause:
                kind = by_name[name].result
                raise TypeError(f"{name} returned no {kind}: {cause}") from cause
            stored = StoredResult(name, sha256(data).hexdigest(), Raw(data), seconds)
            write_whole(self._path(keys[name]), msgpack.encode(stored), force=True)
            yield by_name[name], result

    def seconds(self, tasks: Sequence[Task]) -> float:
        """Return the processor time that the stored results of tasks took [s]."""
        paths = {self._path(key) for key in _keys(tasks).values()}
        return sum(msgpack.decode(path.read_bytes(), type=StoredResult).seconds for path in paths)

    def _remove_outdated(self, folder: Path) -> None:
        """Remove the results of another source."""
        version, source = folder / VERSION_FILE, source_digest()
        if version.is_file() and version.read_text("utf-8") == source:
            return
        outdated = list(folder.glob("*.msgpack"))
        if outdated:
            self.notify(f"{folder} has results of another version: they are computed again")
        for path in outdated:
            path.unlink()
        write_whole(version, source.encode(), force=True)

    def _path(self, key: str) -> Path:
        return self.folder / "work" / f"{key}.msgpack"

    def _load(self, key: str, task: Task) -> Any | UnsetType:  # noqa: ANN401 (any function's)
        """Return the stored result; UNSET if there is none, or if its file is damaged."""
        try:
            stored = msgpack.decode(self._path(key).read_bytes(), type=StoredResult)
            valid = stored.digest == sha256(stored.result).hexdigest()
            return msgpack.decode(stored.result, type=task.result) if valid else UNSET
        except (FileNotFoundError, MsgspecError, ValueError):
            return UNSET


class StoredResult(Struct, frozen=True):
    """A result on disk, with a digest of its bytes and the processor time that it took [s]."""

    task: str
    digest: str
    result: Raw
    seconds: float


@lru_cache
def source_digest() -> str:
    """Return a digest of the source of all packages that make results, and of their data."""
    digest = sha256()
    for package in PACKAGES:
        folder = Path(str(import_module(package).__file__)).parent
        for path in sorted(folder.rglob("*")):
            if path.suffix in SOURCE_SUFFIXES:
                name = path.relative_to(folder).as_posix()
                digest.update(
                    f"{package}/{name} {sha256(path.read_bytes()).hexdigest()}\n".encode()
                )
    return digest.hexdigest()


def _keys(tasks: Sequence[Task]) -> dict[str, str]:
    """Return a digest of what each result depends on, by the name of the task."""
    keys = {}
    for task in tasks:
        function = f"{task.function.__module__}.{task.function.__qualname__}"
        contents = (function, task.arguments)
        # Mappings are encoded in the order of their keys, not in the order of their making.
        keys[task.name] = sha256(msgpack.encode(contents, order="deterministic")).hexdigest()
    if len(keys) < len(tasks):
        names = [task.name for task in tasks]
        repeated = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"two tasks are called {repeated}")
    return keys


def _call(
    source: str, name: str, function: Callable[..., Any], arguments: tuple[Any, ...]
) -> tuple[bytes, float]:
    """Return the encoded result of a function, and its processor time [s].

    The worker must have the same source.
    """
    from threadpoolctl import threadpool_limits

    start = time.process_time()
    try:
        if source != source_digest():
            raise EngineError("the version of holdfast of its worker differs from this one")
        # A sum over several threads is rounded differently.
        with threadpool_limits(1):
            data = msgpack.encode(function(*arguments), enc_hook=_to_builtin)
            return data, time.process_time() - start
    except Exception as failure:
        # Put the name of a task before the text of an exception, or into a note.
        match failure.args:
            case (str(text),):
                failure.args = (f"{name}: {text}",)
            case _:
                failure.add_note(f"in the task {name}")
        raise


def _to_builtin(value: Any) -> Any:  # noqa: ANN401 (NumPy's numbers and arrays)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} cannot be stored")
