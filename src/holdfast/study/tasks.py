"""Tasks whose results are kept, so that a stopped study goes on where it was stopped."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import numba
from msgspec import UNSET, MsgspecError, Raw, Struct, UnsetType, msgpack
from threadpoolctl import threadpool_limits

from holdfast.errors import EngineError, OutputError
from holdfast.files import write_whole
from holdfast.parallel import Engine

T = TypeVar("T")
Notify = Callable[[str], None]


class Task(NamedTuple):
    """A piece of work that depends on nothing but its arguments.

    Attributes:
        name: unique among the tasks, for people: `window/index/14`.
        function: of the package, at the top of its module.
        arguments: that msgspec can encode: Structs, numbers, text, None and lists of them.
        result: type of what it returns, to which msgspec can decode.
        cost: how long it takes, in any unit that is the same for all tasks.
    """

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    result: Any
    cost: float = 1.0


class ShowProgress(Protocol):
    """Goes through items, with a word on what for and what they cost; may show progress."""

    def __call__(
        self, items: Iterable[T], what: str, total: float, cost: Callable[[T], float]
    ) -> Iterator[T]:
        """Yields the items."""
        ...


@dataclass(frozen=True)
class TaskRunner:
    """Does tasks and keeps what each returns in a file of its own.

    A file is found again by what the result depends on: the package's source, the function and
    the arguments. So nothing that is kept is ever out of date, and whatever stops the work
    costs only what was being done.

    Attributes:
        folder: of the study; results are kept in `folder/work`.
        engine: where the work is done.
        progress: goes through the tasks as they are done.
        notify: is given what a person would want to know.
    """

    folder: Path
    engine: Engine = Engine()  # noqa: RUF009 (a tuple: it cannot change)
    progress: ShowProgress = lambda items, _, __, ___: iter(items)
    notify: Notify = lambda _: None

    def run(self, tasks: Sequence[Task]) -> dict[str, Any]:
        """What each task returns, by name; long ones are begun first.

        Raises:
            ValueError: two tasks have one name.
            EngineError: as `Engine.map_unordered`, or a worker has another source of the package.
            Exception: what a task raises, its text beginning with the task's name; it stops the
                work. What was done before stays kept.
        """
        keys = _keys(tasks)
        self._prepare()
        by_key = {keys[task.name]: task for task in tasks}
        results = {key: self._read(key, task) for key, task in by_key.items()}
        missing = [task for key, task in by_key.items() if results[key] is UNSET]
        if len(missing) < len(by_key):
            self.notify(f"{len(by_key) - len(missing)} of {len(by_key)} tasks are done already")
        total = sum(task.cost for task in missing)
        for task, result in self.progress(self._done(missing, keys), "working", total, _cost):
            results[keys[task.name]] = result
        return {name: results[key] for name, key in keys.items()}

    def _done(self, tasks: Iterable[Task], keys: Mapping[str, str]) -> Iterator[tuple[Task, Any]]:
        """Each task with its result, which is kept by then."""
        by_name = {task.name: task for task in sorted(tasks, key=lambda task: -task.cost)}
        source = source_digest()
        calls = ((name, (source, *task[:3])) for name, task in by_name.items())
        for name, data in self.engine.map_unordered(_do, calls):
            result = _decoded(data, by_name[name])
            kept = _Kept(name, sha256(data).hexdigest(), Raw(data))
            write_whole(self._path(keys[name]), msgpack.encode(kept), force=True)
            yield by_name[name], result

    def _prepare(self) -> None:
        place = self._path("").parent
        try:
            place.mkdir(parents=True, exist_ok=True)
        except OSError as cause:
            raise OutputError(f"cannot write {place}: {cause.strerror}") from cause

    def _path(self, key: str) -> Path:
        return self.folder / "work" / f"{key}.msgpack"

    def _read(self, key: str, task: Task) -> Any | UnsetType:  # noqa: ANN401 (any function's)
        """The result as it is kept; UNSET where there is none, or none that is whole."""
        try:
            kept = msgpack.decode(self._path(key).read_bytes(), type=_Kept)
            whole = kept.digest == sha256(kept.result).hexdigest()
            return msgpack.decode(kept.result, type=task.result) if whole else UNSET
        except (FileNotFoundError, MsgspecError, ValueError):
            return UNSET


@lru_cache
def source_digest() -> str:
    """Digest of what the package's results depend on: its files, but not the command line's."""
    package = Path(__file__).parents[1]
    digest = sha256()
    for path in sorted(package.rglob("*")):
        place = path.relative_to(package)
        if path.is_file() and place.parts[0] != "cli" and "__pycache__" not in place.parts:
            content = sha256(path.read_bytes()).hexdigest()
            digest.update(f"{place.as_posix()} {content}\n".encode())
    return digest.hexdigest()


class _Kept(Struct, frozen=True):
    """A result on disk; `digest` is over the bytes of `result`."""

    task: str
    digest: str
    result: Raw


def _keys(tasks: Sequence[Task]) -> dict[str, str]:
    """By the name of each task, the digest of what its result depends on."""
    keys = {task.name: _key(task) for task in tasks}
    if len(keys) < len(tasks):
        names = [task.name for task in tasks]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"two tasks are called {twice}")
    return keys


def _key(task: Task) -> str:
    function = f"{task.function.__module__}.{task.function.__qualname__}"
    given = (source_digest(), function, task.arguments)
    return sha256(msgpack.encode(given, order="deterministic")).hexdigest()


def _cost(done: tuple[Task, Any]) -> float:
    return done[0].cost


def _do(source: str, name: str, function: Callable[..., Any], arguments: tuple[Any, ...]) -> bytes:
    """What the function returns, encoded; wherever it runs, by the source that asks for it."""
    try:
        if source != source_digest():
            raise EngineError("its worker has another version of holdfast than this one")
        with _one_thread():
            return msgpack.encode(function(*arguments), enc_hook=_plain)
    except Exception as failure:
        _put_before(name, failure)
        raise


@contextmanager
def _one_thread() -> Iterator[None]:
    """Within it neither NumPy nor compiled kernels use threads of their own.

    Workers side by side would take processors from each other; and sums of many threads round
    otherwise than those of one.
    """
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        numba.set_num_threads(before)


def _put_before(name: str, failure: Exception) -> None:
    """The failure's text begins with the name; where it has several parts, a note holds it."""
    match failure.args:
        case (str(text),):
            failure.args = (f"{name}: {text}",)
        case _:
            failure.add_note(f"in the task {name}")


def _plain(value: Any) -> Any:  # noqa: ANN401 (NumPy's numbers and arrays)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} cannot be kept")


def _decoded(data: bytes, task: Task) -> Any:  # noqa: ANN401 (any function's)
    try:
        return msgpack.decode(data, type=task.result)
    except MsgspecError as cause:
        raise TypeError(f"{task.name} returned no {task.result}: {cause}") from cause
