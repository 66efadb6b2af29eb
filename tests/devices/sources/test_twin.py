import itertools
import subprocess
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from holdfast.devices.sources import open_source
from holdfast.devices.sources import twin as module
from holdfast.devices.sources.twin import AskedTwin, Twin, write
from holdfast.devices.uri import parse
from holdfast.io.stickers import picture_stamps
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.twin.simulation import Grasp, simulate

RUN = module._Simulator._run
BALL = "twin:?object=ball&case=1&seed=3"


@cache
def ball():
    return simulate(Grasp("ball", 1, 1, seed=3))


@pytest.fixture
def quick(monkeypatch):
    """Grasps that take no time: a recording of their number; some fail."""

    def make(grasp, failing=()):
        times = np.arange(10) / 100
        readings = np.full((10, 16, 3), 10 * grasp.repeat + grasp.attempt, "u2")
        failed = (grasp.repeat, grasp.attempt) in failing
        name = grasp.failed_name if failed else grasp.name
        metadata = {"attempt": grasp.attempt, "case": "failed" if failed else str(grasp.case)}
        return Recording(name, {"thumb": Tactile(sensor("uskin-4x4"), times, readings)}, metadata)

    class Here(module._Simulator):
        """As it is, but for the process."""

        def _run(self, grasp):
            write(grasp, str(self._path))
            return subprocess.Popen(["true"])

    def install(failing=()):
        monkeypatch.setattr(module, "simulate", lambda grasp: make(grasp, failing))
        monkeypatch.setattr(module, "_Simulator", Here)

    install()
    return install


@pytest.mark.parametrize("server", [False, True])
def test_samples_are_those_of_the_simulation(server):
    grasp = Grasp("ball", 1, 1, seed=3, server=server)
    recording = simulate(grasp)
    with open_source(f"{BALL}&server={str(server).lower()}", speed=0) as source:
        assert isinstance(source, Twin)
        assert source.sensors == {name: m.sensor for name, m in recording.modules.items()}
        arrivals = list(source)
    for name, one in recording.modules.items():
        mine = [arrival for arrival in arrivals if name in arrival.samples]
        np.testing.assert_array_equal([arrival.time for arrival in mine], one.times)
        readings = np.array([arrival.samples[name] for arrival in mine])
        np.testing.assert_array_equal(readings, one.readings)
        assert readings.dtype == one.readings.dtype


def test_a_grasp_that_fails_is_tried_again(quick):
    quick(failing={(1, 0), (1, 1)})
    with open_source("twin:", speed=0) as source:
        arrivals = list(source)
    assert arrivals[0].notices == ("the twin grasps: can-case2-1, after 2 failed attempts",)
    assert {int(a.samples["thumb"][0, 0]) for a in arrivals} == {12}


def test_the_next_repeats_follow(quick):
    with open_source("twin:?repeat=4", speed=0, loop=True) as source:
        arrivals = list(itertools.islice(source, 35))
        assert not source.ended
        folder = Path(source._simulator._folder.name)
        assert len(list(folder.iterdir())) == 2  # what is played and what comes next
    assert not folder.exists()
    assert [int(a.samples["thumb"][0, 0]) for a in arrivals[::10]] == [40, 50, 60, 70]
    notices = [arrival.notices for arrival in arrivals if arrival.notices]
    assert notices == [(f"the twin grasps: can-case2-{k}",) for k in (4, 5, 6, 7)]
    times = np.array([arrival.time for arrival in arrivals[:30]]).reshape(3, 10)
    np.testing.assert_allclose(times[1:, 0] - times[:-1, -1], 1.0)


@pytest.mark.parametrize(
    ("address", "names"),
    [
        ("twin:?profile=handling", ("ball-case2-1", "box-case2-2", "can-case2-3")),
        ("twin:?profile=handling&object=can", ("can-case2-1", "can-case2-2", "can-case2-3")),
    ],
)
def test_handling_takes_one_object_after_the_other(quick, address, names):
    with open_source(address, speed=0, loop=True) as source:
        arrivals = list(itertools.islice(source, 30))
    notices = [arrival.notices for arrival in arrivals if arrival.notices]
    assert notices == [(f"the twin grasps: {name}",) for name in names]


@pytest.mark.parametrize(
    ("n_read", "then"), [(1, [40, 50]), (5, [50, 60]), (11, [50, 60]), (13, [60, 70])]
)
def test_a_restart_begins_the_next_grasp_unless_one_has_only_begun(quick, n_read, then):
    with open_source("twin:?repeat=4", speed=1000.0, loop=True) as source:
        list(itertools.islice(source, n_read))
        source.restart()
        arrivals = list(itertools.islice(source, 20))
    assert [int(a.samples["thumb"][0, 0]) for a in arrivals[::10]] == then


def test_the_next_grasp_is_simulated_by_another_process(monkeypatch):
    monkeypatch.setattr(module, "simulate", lambda _: short(ball()))
    with open_source(BALL, speed=0, loop=True) as source:
        first = list(itertools.islice(source, 100))
        second = next(iter(source))
    want = simulate(Grasp("ball", 1, 2, seed=3))  # the process has the real one
    assert second.notices == ("the twin grasps: ball-case1-2",)
    assert second.time == pytest.approx(first[-1].time + 1.0)
    for name, one in want.modules.items():
        np.testing.assert_array_equal(second.samples[name], one.readings[0])


def short(recording):
    modules = {name: replace(m.slice(0, 100), labels=()) for name, m in recording.modules.items()}
    return replace(recording, modules=modules, truth=None)


def test_it_waits_for_the_next_grasp(quick, monkeypatch):
    with open_source("twin:", speed=0, loop=True) as source:
        list(itertools.islice(source, 10))
        source._simulator._process.wait()
        source._simulator.close()  # of the process that simulates the next grasp
        source._simulator._process = subprocess.Popen(["sleep", "60"])
        began = time.monotonic()
        assert source.read(0.05) is None
        assert source.read(0.0) is None
        assert time.monotonic() - began >= 0.05
        assert not source.ended
        process = source._simulator._process
    assert process.returncode is not None  # closing ended it


def test_without_another_process_it_is_simulated_here(quick, monkeypatch):
    monkeypatch.setattr("sys.executable", "/nowhere/python")
    monkeypatch.setattr(module._Simulator, "_run", RUN)
    with open_source("twin:", speed=0, loop=True) as source:
        arrivals = list(itertools.islice(source, 20))
    assert [int(a.samples["thumb"][0, 0]) for a in arrivals[::10]] == [10, 20]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("twin:?object=brick", "'brick'; there are ball"),
        ("twin:?profile=wild", "'wild'; there are coupled"),
        ("twin:?case=3", "3 and 1"),
        ("twin:?repeat=0", "2 and 0"),
        ("twin:?seed=-1", "'-1'"),
        ("twin:?seed=", "''"),
        ("twin:?server=yes", "'yes'"),
        ("twin:?sensor=gtac", "'gtac'; there are uskin-curved, orca-finger"),
        ("twin:?attempt=2", "unknown parameter attempt; there are object"),
        ("twin:can", "twin:can"),
        ("twin://can", "twin://can"),
    ],
)
def test_invalid_parameters(text, message):
    with pytest.raises(ValueError, match=message):
        open_source(text)


def test_a_twin_does_what_it_is_asked_and_then_is_silent(monkeypatch, tmp_path):
    asked = []

    def perform(grasp, *action):
        asked.append((grasp.object, grasp.repeat, *action))
        return quick_recording(grasp.repeat)

    def quick_recording(number):
        times = np.arange(10) / 100
        tactile = Tactile(sensor("uskin-4x4"), times, np.full((10, 16, 3), number, "u2"))
        return Recording(f"grasp {number}", {"thumb": tactile})

    filmed = []

    def film(recording, path):
        filmed.append(recording.name)
        path.write_bytes(b"film")
        return np.array([0.0, 0.5])

    monkeypatch.setattr(module, "perform", perform)
    monkeypatch.setattr("holdfast.twin.webcam.film_stickers", film)
    with AskedTwin(parse("twin:?seed=2")[1], speed=0) as twin:

        def samples():
            return [x for x in iter(lambda: twin.read(0.0), None) if x.samples]

        assert len(samples()) == 10
        assert twin.is_idle
        assert not twin.ended
        twin.perform(8, "pull", 6, 30.0)
        assert not twin.is_idle
        arrivals = samples()
        assert [x.samples["thumb"][0, 0] for x in arrivals] == [8] * 10
        twin.film(tmp_path / "a.mp4")
        stamps = picture_stamps(tmp_path / "a.mp4")
        began = arrivals[0].time  # on the clock of the source, as the samples are
        assert stamps.tolist() == pytest.approx([began + 0.04, began + 0.54])
    first, pulled = asked
    assert first[2:] == ("open", 0, module.OPEN_SECONDS)
    assert pulled[1:] == (8, "pull", 6, 30.0)
    assert filmed == ["grasp 8"]
    assert pulled[0] != first[0]  # without an object in the address, each grasp has another one
    twin = AskedTwin(parse("twin:?object=ball")[1])
    assert twin._objects == ["ball"]
