import itertools

import numpy as np
import pytest

from devices.sources.reading import Clock
from holdfast.devices.sources import open_source
from holdfast.devices.sources import replay as module
from holdfast.devices.sources.replay import ReplaySource
from holdfast.errors import RecordingError
from holdfast.io import load_recording, save_recording
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    return clock


def hand(n=50, **fields):
    times = 3.0 + np.arange(n) / 100
    rng = np.random.default_rng(0)
    modules = {
        "thumb": Tactile(sensor("uskin-4x4"), times, rng.integers(0, 999, (n, 16, 3)).astype("u2")),
        "index": Tactile(sensor("anyskin"), times[::2] + 0.003, rng.normal(size=(n // 2, 5, 3))),
    }
    return Recording(**({"name": "grasp", "modules": modules} | fields))


@pytest.fixture
def path(tmp_path):
    save_recording(hand(), tmp_path / "grasp.parquet")
    return str(tmp_path / "grasp.parquet")


@pytest.mark.parametrize("speed", [0.5, 1.0, 20.0])
def test_it_plays_at_its_speed(path, clock, speed):
    with ReplaySource(path, speed=speed) as source:
        assert source.paced
        clock.now += 7.0  # time begins with the first read
        arrivals = list(source)
    began = arrivals[0].received
    assert began == 107.0
    for arrival in arrivals:
        assert arrival.received - began == pytest.approx((arrival.time - 3.0) / speed, abs=1e-9)


def test_speed_0_never_sleeps(path, clock):
    with ReplaySource(path, speed=0) as source:
        assert not source.paced
        assert len(list(source)) == 75
    assert clock.slept == []


def test_a_slow_reader_gets_all_at_once(path, clock):
    with ReplaySource(path) as source:
        first = source.read(1.0)
        clock.now += 0.2
        missed = [source.read(0.0) for _ in range(30)]
        assert [arrival.received for arrival in missed] == [clock.now] * 30
        assert source.read(0.0) is None
        after = source.read(1.0)
        assert after.received - first.received == pytest.approx(after.time - first.time)
        rest = list(source)
    assert len([first, *missed, after, *rest]) == 75


def test_a_timeout_that_is_too_short_gives_none_and_loses_nothing(path, clock):
    with ReplaySource(path, speed=0.1) as source:
        got = [source.read(0.007) for _ in range(1200)]
        assert None in got
        assert source.ended
    arrivals = [arrival for arrival in got if arrival is not None]
    assert len(arrivals) == 75
    assert max(clock.slept) <= 0.0071


@pytest.mark.parametrize("speed", [0.0, 10.0])
def test_time_continues_in_a_loop(path, clock, speed):
    with ReplaySource(path, speed=speed, loop=True) as source:
        got = list(itertools.islice(source, 75 * 3 + 5))
        assert not source.ended
    times = np.array([arrival.time for arrival in got]).ravel()
    assert (np.diff(times) > 0).all()
    passes = times[:225].reshape(3, 75)
    np.testing.assert_allclose(passes - passes[:, :1], [passes[0] - 3.0] * 3, atol=1e-12)
    np.testing.assert_allclose(passes[1:, 0] - passes[:-1, -1], 1.0)
    noticed = [k for k, arrival in enumerate(got) if arrival.notices]
    assert noticed == [75, 150, 225]
    assert got[75].notices == (f"{path} starts again",)
    if speed:
        waited = got[224].received - got[0].received
        assert waited == pytest.approx((got[224].time - got[0].time) / speed)


def test_an_incomplete_recording_is_played_as_far_as_it_goes(tmp_path):
    file = tmp_path / "a.mcap"
    save_recording(hand(900), file)
    file.write_bytes(file.read_bytes()[:-30_000])
    left = load_recording(file).modules
    assert left["thumb"].n_samples < 900
    with ReplaySource(file, speed=0) as source:
        arrivals = list(source)
    assert arrivals[0].notices == (f"{file} was cut off; what could be recovered is played",)
    assert not any(arrival.notices for arrival in arrivals[1:])
    for name, one in left.items():
        assert sum(name in arrival.samples for arrival in arrivals) == one.n_samples


def test_damage_in_its_middle_ends_it_with_a_notice(tmp_path, monkeypatch):
    def damaged(path, n_samples, labels):
        yield hand()
        raise RecordingError("a.parquet is damaged: so it is")

    monkeypatch.setattr("holdfast.devices.sources.replay.read_chunks", damaged)
    with ReplaySource("a.parquet", speed=0, loop=True) as source:
        arrivals = list(source)
        assert source.ended
    assert sum(len(arrival.samples) for arrival in arrivals) == 75
    assert arrivals[-1].notices == ("the rest is lost: a.parquet is damaged: so it is",)
    assert not any(arrival.notices for arrival in arrivals[:-1])


@pytest.mark.parametrize("speed", [-1.0, np.nan, np.inf])
def test_an_invalid_speed(speed):
    with pytest.raises(ValueError, match="speed"):
        ReplaySource("grasp.parquet", speed=speed)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.parquet", None, "none.parquet"),
        ("a.csv", b"", ".csv given"),
        ("a.mcap", b"", "a.mcap"),
        ("a.parquet", b"PAR1" + bytes(99), "a.parquet"),
    ],
)
def test_only_opening_finds_that_it_cannot_be_read(tmp_path, name, content, message):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    source = open_source(str(tmp_path / name))
    with pytest.raises(RecordingError, match=message):
        source.open()


def test_a_recording_without_pieces(path, monkeypatch):
    monkeypatch.setattr("holdfast.devices.sources.replay.read_chunks", lambda *_, **__: iter(()))
    with pytest.raises(RecordingError, match="no samples"):
        ReplaySource(path).open()


@pytest.mark.parametrize("loop", [False, True])
def test_it_starts_again_from_the_beginning(path, clock, loop):
    with ReplaySource(path, loop=loop) as source:
        source.restart()  # at its beginning, it has no effect
        before = [source.read(60.0) for _ in range(20)]
        source.restart()
        after = [source.read(60.0) for _ in range(20)]
    assert after[0].time == pytest.approx(before[-1].time + module.PAUSE)
    for one, again in zip(before, after, strict=True):
        assert again.time - one.time == pytest.approx(after[0].time - before[0].time)
        for name, sample in one.samples.items():
            np.testing.assert_array_equal(again.samples[name], sample)
