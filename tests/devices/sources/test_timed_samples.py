from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.devices.sources.replay import timed_samples
from holdfast.io import read_chunks, save_recording
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor

TINY = Sensor("tiny", np.eye(3)[:2], np.tile(np.eye(3), (2, 1, 1)), np.array([0, 0, 1.0]), 100.0)


def module(times, seed=0, dtype="u2"):
    rng = np.random.default_rng(seed)
    return Tactile(TINY, times, rng.integers(0, 999, (len(times), 2, 3)).astype(dtype))


def hand(n=500, **fields):
    """Three modules: two that share their times, and one with its own."""
    rng = np.random.default_rng(1)
    times = np.arange(n) / 100
    own = np.sort(rng.uniform(0, n / 100, n // 2))
    modules = {"thumb": module(times), "index": module(times, 1), "palm/1": module(own, 2, "f4")}
    return Recording(**({"name": "grasp", "modules": modules} | fields))


def slowly(recording):
    """What a recording has at each instant, found by looking for it."""
    instants = sorted({t for m in recording.modules.values() for t in m.times.tolist()})
    for time in instants:
        rows = {n: np.flatnonzero(m.times == time) for n, m in recording.modules.items()}
        yield time, {n: recording.modules[n].readings[k[0]] for n, k in rows.items() if len(k)}


def assert_same(got, recording):
    got, want = [item for item in got if item.samples], list(slowly(recording))
    assert [item.time for item in got] == [time for time, _ in want]
    for item, (_, samples) in zip(got, want, strict=True):
        assert list(item.samples) == list(samples)
        for name, sample in samples.items():
            assert item.samples[name].dtype == sample.dtype
            np.testing.assert_array_equal(item.samples[name], sample)


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
@pytest.mark.parametrize("n_samples", [1, 7, 100, 10_000])
def test_a_file_in_pieces_of_any_size_is_the_recording(tmp_path, suffix, n_samples):
    recording = hand(200 if n_samples == 1 else 500)
    path = tmp_path / f"grasp.{suffix}"
    save_recording(recording, path)
    assert_same(timed_samples(read_chunks(path, n_samples)), recording)


@settings(max_examples=50)
@given(st.data())
def test_modules_with_any_times(data):
    modules = {}
    for name in ("thumb", "index", "middle"):
        steps = data.draw(st.lists(st.sampled_from([0.01, 0.02, 0.5, 3.0]), min_size=1, max_size=9))
        modules[name] = module(data.draw(st.sampled_from([0.0, 0.01, 4.0])) + np.cumsum(steps))
    recording = Recording("made", modules)
    assert_same(timed_samples([recording]), recording)


def test_markers_come_after_the_samples_of_their_time():
    markers = ((0.05, "closed"), (0.055, "two\nlines"), (0.05, "and held"))
    got = list(timed_samples([hand(20, markers=markers)]))
    indices = [k for k, item in enumerate(got) if item.notice]
    texts = [(got[k].time, got[k].notice.removeprefix("marker: ")) for k in indices]
    assert texts == [(0.05, "closed"), (0.05, "and held"), (0.055, "two lines")]
    assert got[indices[0] - 1].time == 0.05
    assert all(not got[k].samples for k in indices)
    assert [item.time for item in got] == sorted(item.time for item in got)


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
def test_markers_of_a_file_occur_once_and_in_place(tmp_path, suffix):
    markers = tuple((0.1 * k + 0.003, f"m{k}") for k in range(45))
    save_recording(hand(markers=markers), tmp_path / f"a.{suffix}")
    got = list(timed_samples(read_chunks(tmp_path / f"a.{suffix}", 20)))
    assert [m.notice for m in got if m.notice] == [f"marker: m{k}" for k in range(45)]
    assert [item.time for item in got] == sorted(item.time for item in got)


def test_samples_out_of_order_are_refused_and_counted():
    whole = hand(1000)
    early, late = (
        replace(whole, modules={name: m.slice(*cut) for name, m in whole.modules.items()})
        for cut in ((0, 400), (400, 1000))
    )
    behind = {"thumb": late.modules["thumb"], "index": whole.modules["index"].slice(0, 600)}
    got = list(timed_samples([early, replace(late, modules=behind)]))
    times = [item.time for item in got]
    assert times == sorted(set(times))
    n_refused = sum(item.n_refused for item in got)
    n_given = sum(len(item.samples) for item in got)
    n_there = sum(m.n_samples for part in (early.modules, behind) for m in part.values())
    assert n_refused > 0
    assert n_given + n_refused == n_there


def test_memory_is_bounded():
    """A chunk is read when the one before it is over."""
    seen = []

    def chunks():
        for k in range(50):
            seen.append(k)
            yield Recording("made", {"thumb": module(10.0 * k + np.arange(1000) / 100)})

    stream = timed_samples(chunks())
    next(stream)
    assert len(seen) == 1
    for item in stream:
        assert len(seen) == item.time // 10 + 1
