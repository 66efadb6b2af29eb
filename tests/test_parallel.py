import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from holdfast import cluster as cluster_module
from holdfast.errors import EngineError, MissingExtra
from holdfast.parallel import Engine

PRIVATE = {
    "threads_per_worker": 1,
    "host": "127.0.0.1",
    "dashboard_address": "127.0.0.1:0",
    "silence_logs": 50,
}
HERE, PROCESSES = Engine(1), Engine(2)


def power(base, exponent):
    if exponent < 0:
        raise ValueError("negative")
    return base**exponent, os.getpid()


def total(index, array):
    time.sleep(0.02)
    return index + float(array.sum())


def die_at(index, deadly):
    if index == deadly:
        os.kill(os.getpid(), signal.SIGKILL)
    return index


def joined(*parts):
    return parts


CLUSTER = f"""
import time
from distributed import LocalCluster

cluster = LocalCluster(n_workers=1, processes=False, protocol="tcp://", **{PRIVATE})
print(cluster.scheduler_address, flush=True)
time.sleep(1000)
"""

ENDLESS = """
import os, sys, time
from holdfast.parallel import Engine

def work(index):
    print(os.getpid(), flush=True)
    time.sleep(100)

list(Engine(2).map_ordered(work, [(0,), (1,)]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not change the parent")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_process_leaves_no_workers(number):
    words = (sys.executable, "-c", ENDLESS)
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as parent:
        workers = [int(parent.stdout.readline()) for _ in range(2)]
        parent.send_signal(number)
        deadline = time.monotonic() + 60
        while any(map(is_running, workers)) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not any(map(is_running, workers))


def is_running(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{process}/status")
    return not (status.exists() and "State:\tZ" in status.read_text())


@contextmanager
def two_workers(**settings):
    """A cluster of two worker processes on this machine that no other machine can reach."""
    distributed = pytest.importorskip("distributed")
    from dask import config

    soon = {"distributed.comm.timeouts.connect": "1s"}  # until a dead worker counts as lost
    with config.set(soon | settings), distributed.LocalCluster(n_workers=2, **PRIVATE) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def cluster():
    with two_workers() as cluster:
        yield cluster


def engine_of(cluster):
    return Engine.parse(f"dask:{cluster.scheduler_address}")


def pids(cluster):
    from distributed import Client

    with Client(cluster.scheduler_address, set_as_default=False) as client:
        client.wait_for_workers(2)
        return list(client.run(os.getpid).values())


class TestMapOrdered:
    @pytest.mark.parametrize("n_jobs", [1, 2])
    def test_results_come_in_the_order_of_the_arguments(self, n_jobs):
        arguments = [(base, base % 3) for base in range(20)]
        assert [n for n, _ in Engine(n_jobs).map_ordered(power, iter(arguments))] == [
            b**e for b, e in arguments
        ]

    def test_one_at_a_time_runs_in_this_process_when_the_result_is_needed(self):
        taken = []

        def arguments():
            for base in range(3):
                taken.append(base)
                yield base, 1

        results = Engine().map_ordered(power, arguments())
        assert taken == []
        assert next(results) == (0, os.getpid())
        assert taken == [0]

    @pytest.mark.parametrize("n_jobs", [1, 2])
    def test_an_exception_of_the_function_is_raised(self, n_jobs):
        with pytest.raises(ValueError, match="negative"):
            list(Engine(n_jobs).map_ordered(power, [(1, 1), (1, -1)]))


class TestEngine:
    @pytest.mark.parametrize(
        ("text", "engine"),
        [
            ("loky", Engine(3)),
            ("dask:10.0.0.1:8786", Engine(3, "10.0.0.1:8786")),
            ("dask:tls://hub:8786", Engine(3, "tls://hub:8786")),
        ],
    )
    def test_a_text_names_it(self, text, engine):
        assert Engine.parse(text, 3) == engine

    def test_as_many_jobs_as_processors_by_default(self):
        assert Engine.parse() == Engine(-1)

    @pytest.mark.parametrize("text", ["", "dask", "dask:", "loky:2", "spark:10.0.0.1:8786"])
    def test_another_is_refused(self, text):
        with pytest.raises(ValueError, match=f"'{text}'"):
            Engine.parse(text)

    @pytest.mark.parametrize("engine", [HERE, PROCESSES])
    def test_results_carry_the_name_of_their_call(self, engine):
        calls = {f"{base}²": (base, 2) for base in range(9)}
        done = dict(engine.map_unordered(power, calls.items()))
        assert {name: n for name, (n, _) in done.items()} == {f"{b}²": b**2 for b in range(9)}

    @pytest.mark.parametrize("engine", [HERE, PROCESSES])
    def test_shared_arguments_come_first(self, engine):
        assert list(engine.map_ordered(joined, [("c",), ("d",)], shared=("a", ["b"]))) == [
            ("a", ["b"], "c"),
            ("a", ["b"], "d"),
        ]

    def test_only_a_cluster_needs_absolute_paths(self):
        assert HERE.path(Path("data")) == Path("data")
        assert Engine.parse("dask:hub:8786").path(Path("data")) == Path.cwd() / "data"


class TestProcesses:
    def test_a_process_that_dies_is_an_error(self):
        with pytest.raises(EngineError, match="a process died"):
            list(PROCESSES.map_unordered(die_at, [(k, (k, 4)) for k in range(8)]))


class TestCluster:
    def test_a_killed_worker_loses_no_result(self, cluster):
        arguments = [(index, np.full(10_000, float(index))) for index in range(60)]
        results = []
        for result in engine_of(cluster).map_ordered(total, arguments):
            results.append(result)
            if len(results) == 20:
                os.kill(pids(cluster)[0], signal.SIGKILL)
        assert results == list(HERE.map_ordered(total, arguments))

    def test_an_exception_of_the_function_is_raised(self, cluster):
        with pytest.raises(ValueError, match="negative"):
            list(engine_of(cluster).map_ordered(power, [(1, 1), (1, -1)]))

    def test_a_call_that_kills_its_workers_is_an_error(self):
        calls = [(index, 2) for index in range(6)]
        with (
            two_workers(**{"distributed.scheduler.allowed-failures": 0}) as cluster,
            pytest.raises(EngineError, match="its workers died"),
        ):
            list(engine_of(cluster).map_ordered(die_at, calls))

    def test_shared_arguments_come_first(self, cluster):
        shared = (np.arange(100_000), {"of": "all"})
        found = list(engine_of(cluster).map_ordered(joined, [(1,), (2,)], shared=shared))
        assert [each[1:] for each in found] == [({"of": "all"}, 1), ({"of": "all"}, 2)]
        assert all((each[0] == shared[0]).all() for each in found)

    @pytest.mark.parametrize(
        ("preload", "message"),
        [
            ("import sys; sys.modules['holdfast'] = None", "cannot import this holdfast: install"),
            (
                "from holdfast import cluster; cluster.package_digest = lambda: 'other'",
                "has another version of holdfast: install",
            ),
        ],
    )
    def test_a_worker_with_another_installation(self, tmp_path, preload, message):
        distributed = pytest.importorskip("distributed")
        file = tmp_path / "before.py"
        file.write_text(preload)
        with (
            distributed.LocalCluster(n_workers=1, preload=[str(file)], **PRIVATE) as other,
            pytest.raises(EngineError, match=rf"^the worker at tcp://127\.0\.0\.1:\d+ {message}"),
        ):
            list(engine_of(other).map_ordered(power, [(1, 1)]))

    def test_without_workers(self, monkeypatch):
        distributed = pytest.importorskip("distributed")
        monkeypatch.setattr(cluster_module, "NO_WORKER_TIMEOUT", 0.5)
        with distributed.LocalCluster(n_workers=0, **PRIVATE) as empty:
            address = empty.scheduler_address
            with pytest.raises(EngineError, match=f"{address} has no work"):
                list(engine_of(empty).map_ordered(power, [(1, 1)]))

    @pytest.mark.parametrize("address", ["127.0.0.1:1", "spark://127.0.0.1:1"])
    def test_no_scheduler_at_the_address(self, monkeypatch, address):
        pytest.importorskip("distributed")
        monkeypatch.setattr(cluster_module, "SCHEDULER_TIMEOUT", 0.5)
        with pytest.raises(EngineError, match=f"no Dask scheduler answers at {address}"):
            list(Engine.parse(f"dask:{address}").map_ordered(power, [(1, 1)]))

    @pytest.mark.parametrize("sent", ["SIGKILL", "SIGSTOP"])
    def test_a_scheduler_that_is_killed_or_frozen(self, monkeypatch, sent):
        pytest.importorskip("distributed")
        config = pytest.importorskip("dask.config")
        process = subprocess.Popen(
            [sys.executable, "-c", CLUSTER], stdout=subprocess.PIPE, text=True
        )
        with process, config.set({"distributed.comm.timeouts.connect": "1s"}):
            try:
                address = process.stdout.readline().strip()
                results = Engine.parse(f"dask:{address}").map_ordered(
                    abs, [(k,) for k in range(99)]
                )
                next(results)
                monkeypatch.setattr(cluster_module, "SCHEDULER_TIMEOUT", 1.0)
                process.send_signal(getattr(signal, sent))
                with pytest.raises(EngineError, match="gone"):
                    list(results)
            finally:
                process.kill()

    def test_without_dask(self, monkeypatch):
        monkeypatch.setitem(sys.modules, "distributed", None)
        with pytest.raises(MissingExtra, match="cluster"):
            list(Engine.parse("dask:127.0.0.1:1").map_ordered(power, [(1, 1)]))
