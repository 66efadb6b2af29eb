import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from holdfast.errors import EngineError
from holdfast.parallel import Engine

HERE, PROCESSES = Engine(1), Engine(2)


def power(base, exponent):
    if exponent < 0:
        raise ValueError("negative")
    return base**exponent, os.getpid()


def die_at(index, deadly):
    if index == deadly:
        os.kill(os.getpid(), signal.SIGKILL)
    return index


def joined(*parts):
    return parts


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

    def test_two_at_a_time_run_in_other_processes(self):
        assert os.getpid() not in {pid for _, pid in Engine(2).map_ordered(power, [(1, 1)] * 4)}

    @pytest.mark.parametrize("n_jobs", [1, 2])
    def test_an_exception_of_the_function_is_raised(self, n_jobs):
        with pytest.raises(ValueError, match="negative"):
            list(Engine(n_jobs).map_ordered(power, [(1, 1), (1, -1)]))


class TestEngine:
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


class TestProcesses:
    def test_a_process_that_dies_is_an_error(self):
        with pytest.raises(EngineError, match="a process died"):
            list(PROCESSES.map_unordered(die_at, [(k, (k, 4)) for k in range(8)]))
