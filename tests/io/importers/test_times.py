"""Times: units by their names and by a plausible rate, clocks, and stamps that are wrong."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.errors import RecordingError
from holdfast.io.importers.times import (
    TIME_UNITS,
    clock_seconds,
    increasing,
    restarts,
    smoothest,
    stated_unit,
    times_of,
)

WORDS = {"ms": "ms", "min": "minutes", "d": "days", "us": "us", "ns": "ns", "h": "h", "s": "sec"}


@pytest.mark.parametrize("unit", TIME_UNITS)
@given(rate=st.floats(6, 4900))
def test_a_unit_that_the_name_says(unit, rate):
    times = times_of(f"time_{WORDS[unit]}", np.arange(20) / rate / TIME_UNITS[unit], None, 100)
    assert (times.unit, times.reason) == (unit, "")
    assert times.seconds[1] == pytest.approx(1 / rate)


@pytest.mark.parametrize("unit", ["ms", "us", "ns", "min", "h", "d"])
def test_a_unit_that_is_not_said_is_proposed_by_the_rate_of_the_sensor(unit):
    times = times_of("stamp", np.arange(20) / 100 / TIME_UNITS[unit], None, 100)
    assert times.unit == unit
    assert "100 Hz" in times.reason


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_times_since_1970_say_their_unit(unit):
    times = times_of("stamp", (1.7e9 + np.arange(20) / 100) / TIME_UNITS[unit], None, 100)
    assert (times.unit, times.reason) == (unit, "")


@pytest.mark.parametrize(("name", "step"), [("time_ms", 0.01), ("time_s", 10), ("t", 10)])
def test_impossible_rates_are_refused_with_the_unit_that_makes_sense(name, step):
    unit = None if name != "t" else "s"
    with pytest.raises(RecordingError, match=rf"give --columns time={name}:"):
        times_of(name, step * np.arange(20), unit, 100)


@pytest.mark.parametrize("values", [[], [1.0], [2.0, 2.0], [np.nan, np.nan]])
def test_times_without_steps_are_seconds(values):
    assert times_of("t", np.array(values), None, 100).unit == "s"


def test_a_smoother_clock_goes_before_an_earlier_one():
    device = np.arange(200) / 100
    arrival = device + np.random.default_rng(0).uniform(0, 0.004, 200)
    assert smoothest({"time": arrival, "tus": device}) == "tus"
    assert smoothest({"time": device, "tus": arrival}) == "time"
    assert smoothest({"timestamp": device.round(3), "elapsed": device}) == "timestamp"
    assert stated_unit("tus") == "us"


def test_a_stamp_that_steps_back_is_no_restart():
    times = np.arange(100) / 100
    times[50] -= 0.3
    assert restarts(times) == []
    assert np.flatnonzero(~increasing(times)).tolist() == [50]
    assert restarts(np.tile(np.arange(20) / 100, 3)) == [20, 40]


def test_a_cell_that_is_no_time():
    assert clock_seconds(["0.5"]) is None
    with pytest.raises(RecordingError, match="'12:61'"):
        clock_seconds(["12:00:00", "12:61"])


def test_stamps_in_bursts_are_refused_with_their_mean_rate():
    bursts = 1.7e9 + np.arange(200) // 10 * 0.1 + np.arange(200) % 10 * 1e-5
    with pytest.raises(RecordingError, match=r"in bursts .* --columns time=10[0-9.]*Hz"):
        times_of("time", bursts, None, 100)
