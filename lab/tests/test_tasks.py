import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
from threadpoolctl import threadpool_info

from holdfast.errors import EngineError
from holdfast.parallel import Engine
from holdfast_lab import tasks as work
from holdfast_lab.tasks import Task, TaskRunner

ENGINES = [Engine(1), Engine(2)]


class Figure(msgspec.Struct, frozen=True):
    value: float
    parts: list[float]


def figure(k, seed):
    """What a task of the study may look like: random numbers by key, a Struct of NumPy numbers."""
    parts = np.random.default_rng([k, seed]).normal(size=3)
    return Figure(parts.sum(), parts)


def n_threads():
    """Of each library that has threads of its own."""
    return [info["num_threads"] for info in threadpool_info()]


def noted(k, folder):
    """Leaves one byte for each time that it is called."""
    with (Path(folder) / str(k)).open("ab") as file:
        file.write(b"x")
    time.sleep(0.05)
    return k


def fail(k):
    if k == 2:
        raise ValueError("no good")
    if k == 3:
        raise OSError(28, "No space left on device")
    return k


def tasks(n=8):
    return [Task(f"figure/{k}", figure, (k, 7), Figure) for k in range(n)]


def noted_tasks(folder, n=12):
    return [Task(f"noted/{k}", noted, (k, str(folder)), int) for k in range(n)]


def calls(folder):
    return {path.name: path.stat().st_size for path in folder.iterdir()}


def kept(folder):
    return sorted((folder / "work").glob("[!.]*.msgpack"))


@pytest.fixture
def log(tmp_path):
    folder = tmp_path / "log"
    folder.mkdir()
    return folder


@pytest.fixture
def expected():
    return {f"figure/{k}": figure(k, 7) for k in range(8)}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("order", [1, -1])
def test_results_are_the_same_on_every_engine_in_every_order(tmp_path, engine, order, expected):
    results = TaskRunner(tmp_path, engine).run(tasks()[::order])
    assert list(results) == list(expected)[::order]
    for name, result in results.items():
        assert isinstance(result, Figure)
        np.testing.assert_array_equal(result.parts, expected[name].parts)
        assert result.value == expected[name].value


@pytest.mark.parametrize("engine", ENGINES, ids=str)
def test_a_task_has_one_thread(tmp_path, engine):
    before = n_threads()
    results = TaskRunner(tmp_path, engine).run([Task("a", n_threads, (), list[int])])
    assert set(results["a"]) == {1}
    assert n_threads()[0] == before[0]


def test_stored_results_are_reused(tmp_path, log):
    messages = []
    first = TaskRunner(tmp_path).run(noted_tasks(log, 4))
    again = TaskRunner(tmp_path, notify=messages.append).run(noted_tasks(log, 6))
    assert set(calls(log).values()) == {1}
    assert again == {f"noted/{k}": k for k in range(6)}
    assert first.items() <= again.items()
    assert messages == ["4 of 6 tasks are already done"]


def test_a_killed_study_continues_with_the_missing_tasks(tmp_path, log):
    code = f"""if True:
        from pathlib import Path
        from holdfast.parallel import Engine
        from test_tasks import TaskRunner, noted_tasks
        TaskRunner(Path({str(tmp_path)!r}), Engine(2)).run(noted_tasks({str(log)!r}))
    """
    tests = str(Path(__file__).parent)
    with subprocess.Popen(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": tests},
        start_new_session=True,
    ) as study:
        while len(kept(tmp_path)) < 5 and study.poll() is None:
            time.sleep(0.01)
        os.killpg(study.pid, signal.SIGKILL)
    n_kept = len(kept(tmp_path))
    assert 5 <= n_kept < 12
    done = calls(log)
    results = TaskRunner(tmp_path).run(noted_tasks(log))
    assert results == {f"noted/{k}": k for k in range(12)}
    again = [k for k, n in calls(log).items() if n != done.get(k, 0)]
    assert len(again) == 12 - n_kept
    assert max(calls(log).values()) <= 2


def test_results_of_another_version_are_computed_again_and_one_line_says_so(
    tmp_path, log, monkeypatch
):
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "old.msgpack").write_bytes(b"of 0.3.0")
    messages = []
    runner = TaskRunner(tmp_path, notify=messages.append)
    runner.run(noted_tasks(log, 2))
    monkeypatch.setattr(work, "source_digest", lambda: "another")
    runner.run(noted_tasks(log, 2))
    assert set(calls(log).values()) == {2}
    line = f"{tmp_path / 'work'} has results of another version: they are computed again"
    assert messages == [line, line]
    assert len(kept(tmp_path)) == 2


def test_the_version_is_that_of_every_source_file(tmp_path, monkeypatch):
    (tmp_path / "toy" / "part").mkdir(parents=True)
    for name in ("__init__.py", "part/step.c", "part/table.csv"):
        (tmp_path / "toy" / name).write_text("1\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(work, "PACKAGES", ("toy",))
    found = {work.source_digest.__wrapped__()}
    for name in ("__init__.py", "part/step.c", "part/table.csv", "part/new.py"):
        (tmp_path / "toy" / name).write_text("2\n")
        found.add(work.source_digest.__wrapped__())
    (tmp_path / "toy" / "part" / "step.pyc").write_text("2\n")
    assert len(found) == 5 and work.source_digest.__wrapped__() in found


def test_a_worker_with_another_source_is_rejected(tmp_path, monkeypatch):
    monkeypatch.setattr(work, "source_digest", lambda *_: "another")
    with pytest.raises(
        EngineError, match=r"^figure/\d: the version of holdfast of its worker diff"
    ):
        TaskRunner(tmp_path, Engine(2)).run(tasks(2))


def test_two_tasks_of_one_name_are_rejected(tmp_path):
    with pytest.raises(ValueError, match=r"^two tasks are called figure/0$"):
        TaskRunner(tmp_path).run(tasks(2) + tasks(1))


def test_a_damaged_result_is_computed_again(tmp_path):
    first = TaskRunner(tmp_path).run(tasks(1))
    (path,) = kept(tmp_path)
    whole = path.read_bytes()
    flipped = [whole[:k] + bytes([whole[k] ^ 4]) + whole[k + 1 :] for k in range(len(whole))]
    for damaged in (*flipped, b"", whole[:-1]):
        path.write_bytes(damaged)
        assert TaskRunner(tmp_path).run(tasks(1)) == first
    before, after = map(msgspec.msgpack.decode, (whole, path.read_bytes()))
    assert before | after == before | {"seconds": after["seconds"]}
    assert TaskRunner(tmp_path).seconds(tasks(1)) == after["seconds"] > 0


@pytest.mark.parametrize(
    ("task", "error", "message"),
    [
        (Task("figure/9", figure, (9, 7), int), TypeError, "figure/9"),
        (Task("odd", Path, ("x",), str), TypeError, "odd"),
        (Task("fail/3", fail, (3,), int), OSError, "No space left"),
    ],
)
def test_after_a_failure_other_results_stay_stored(tmp_path, task, error, message):
    with pytest.raises(error, match=message) as failure:
        TaskRunner(tmp_path).run([*tasks(2), task])
    assert error is not OSError or "in the task fail/3" in failure.value.__notes__
    assert len(kept(tmp_path)) == 2
