"""What every source fulfils, whatever it reads from."""

import time
from itertools import islice

import msgspec
import numpy as np
import pytest

from devices.sources.reading import LIMIT, some_of
from devices.sources.sources import BROKEN, ENDING, EVERY, LASTING, N_SOON
from holdfast.detection import Detector, Model
from holdfast.errors import HoldfastError
from holdfast.sensors import Sensor

pytestmark = pytest.mark.slow


@pytest.fixture(params=EVERY)
def ready(request, tmp_path, monkeypatch):
    with EVERY[request.param](tmp_path, monkeypatch) as ready:
        yield ready


@pytest.fixture(params=LASTING)
def lasting(request, tmp_path, monkeypatch):
    with LASTING[request.param](tmp_path, monkeypatch) as ready:
        yield ready


@pytest.fixture(params=ENDING)
def ending(request, tmp_path, monkeypatch):
    with ENDING[request.param](tmp_path, monkeypatch) as ready:
        yield ready.source


@pytest.fixture(params=BROKEN)
def broken(request, tmp_path, monkeypatch):
    with BROKEN[request.param](tmp_path, monkeypatch) as source:
        yield source


def test_entering_makes_the_modules_known(ready):
    with ready.source as source:
        assert source is ready.source
        assert source.sensors
        assert all(isinstance(one, Sensor) for one in source.sensors.values())
        assert not source.ended


def test_metadata_are_plain_and_name_the_source(ready):
    with ready.source as source:
        assert source.metadata["source"] == source.name
        decoded = msgspec.json.decode(msgspec.json.encode(source.metadata))
    assert decoded == dict(source.metadata)


def test_samples_have_the_shape_of_the_sensors(ready):
    with ready.source as source:
        for arrival in some_of(source, N_SOON):
            assert set(arrival.samples) <= set(source.sensors)
            assert set(arrival.faults) <= set(source.sensors)
            for name, sample in arrival.samples.items():
                assert sample.shape == (source.sensors[name].n_taxels, 3)
                assert sample.dtype.isnative
                assert sample.dtype.kind in "iuf"


def test_times_go_forward(ready):
    with ready.source as source:
        arrivals = some_of(source, N_SOON)
        times = np.array([arrival.time for arrival in arrivals])
        received = np.array([arrival.received for arrival in arrivals])
        assert np.isfinite(times).all()
        assert (np.diff(times) > 0).all()
        assert (np.diff(received) >= 0).all()
        assert received[-1] <= time.monotonic()


def test_samples_are_not_written_to_again(ready):
    with ready.source as source:
        first = some_of(source, 5)
        copies = [{name: a.copy() for name, a in arrival.samples.items()} for arrival in first]
        some_of(source, N_SOON - 5)
    for arrival, copy in zip(first, copies, strict=True):
        for name, sample in copy.items():
            np.testing.assert_array_equal(arrival.samples[name], sample)


def test_a_detector_takes_everything(ready):
    with ready.source as source:
        detector = Detector(Model.load("builtin:noise-floor"), source.sensors)
        for arrival in some_of(source, N_SOON):
            estimate = detector.update(arrival.samples, arrival.time)
        assert set(estimate.fingers) == set(source.sensors)


@pytest.mark.parametrize("timeout", [0.0, 0.05])
def test_reading_without_samples_waits_and_gives_none(lasting, timeout):
    with lasting.source as source:
        some_of(source, 1)
        lasting.hush()
        end = time.monotonic() + LIMIT
        waited = None
        while waited is None and time.monotonic() < end:
            began = time.monotonic()
            if source.read(timeout) is None:
                waited = time.monotonic() - began
        assert waited is not None
        assert waited >= 0.9 * timeout
        assert not source.ended


def test_iterating_ends_with_the_source(ending):
    with ending as source:
        arrivals = list(source)
        assert source.ended
        assert source.read(0.1) is None
        assert source.ended
    assert len(arrivals) > N_SOON


def test_closing_again_is_harmless(ready):
    with ready.source as source:
        some_of(source, 1)
    source.close()
    source.close()


def test_closing_what_was_never_open_is_harmless(ready):
    ready.source.close()


def test_entering_again_starts_again(ready):
    with ready.source as source:
        sensors = dict(source.sensors)
        some_of(source, 3)
    with ready.source as source:
        assert dict(source.sensors) == sensors
        times = [arrival.time for arrival in some_of(source, 3)]
    assert times == sorted(set(times))


def test_two_equal_sources_are_independent(ending):
    with ending as source:
        first = list(islice(source, 3))
    with ending as source:
        second = list(islice(source, 3))
    assert [arrival.time for arrival in first] == [arrival.time for arrival in second]


def test_only_entering_raises_and_then_it_is_closed(broken):
    for _ in range(2):
        with pytest.raises((HoldfastError, OSError)), broken:
            pytest.fail("was opened")
    broken.close()
