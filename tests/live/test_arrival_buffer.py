import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import Fault
from holdfast.devices.sources import Arrival
from holdfast.devices.sources.base import notice_arrival
from holdfast.live import arrival_buffer as module
from holdfast.live.arrival_buffer import ArrivalBuffer, ModuleBuffer, marker_text
from holdfast.recordings import Tactile
from holdfast.sensors import sensor

ANYSKIN = sensor("anyskin")
TIMES = st.lists(st.floats(-1e9, 1e9) | st.sampled_from([math.nan, math.inf, -math.inf]))
NUMBERS = ("uint8", "uint16", "int16", "int64", "float32", "float64", "bool")


@given(TIMES, st.lists(st.booleans()))
def test_a_module_buffer_accepts_increasing_times_only(times, drains):
    module_buffer, kept, last = ModuleBuffer(ANYSKIN), [], -math.inf
    for k, time in enumerate(times):
        assert module_buffer.append(time, np.zeros((5, 3))) is (last < time < math.inf)
        last = max(last, time) if math.isfinite(time) else last
        if k < len(drains) and drains[k]:
            kept += module_buffer.pop_samples()[0].tolist()
    kept += module_buffer.pop_samples()[0].tolist()
    assert np.all(np.diff(kept) > 0)
    assert len(kept) == module_buffer.n_samples
    assert set(kept) <= set(times)


@given(
    st.sampled_from(NUMBERS),
    st.lists(st.tuples(st.sampled_from(NUMBERS), st.integers(-300, 70_000)), max_size=8),
)
def test_readings_keep_their_number_type_and_their_values(number, others):
    module_buffer = ModuleBuffer(ANYSKIN)
    module_buffer.append(0.0, np.ones((5, 3), number))
    want = [np.ones((5, 3))]
    for k, (other, value) in enumerate(others):
        readings = np.full((5, 3), value).astype(other)
        if module_buffer.append(1.0 + k, readings):
            want.append(readings)
        else:
            assert not np.array_equal(readings.astype(number), readings)
    _, readings = module_buffer.pop_samples()
    assert readings.dtype == number
    np.testing.assert_array_equal(readings, want)


def test_integers_that_a_float_rounds_are_rejected():
    module_buffer = ModuleBuffer(ANYSKIN)
    module_buffer.append(0.0, np.zeros((5, 3)))
    assert module_buffer.append(1.0, np.full((5, 3), 2**53))
    assert not module_buffer.append(2.0, np.full((5, 3), 2**53 + 1))


@given(st.sets(st.integers(20, 200), max_size=20), st.lists(st.integers(0, 200), max_size=20))
def test_gaps_are_those_of_the_recording_for_any_chunks(missing, cuts):
    module_buffer = ModuleBuffer(ANYSKIN)
    times = [k / 40 for k in range(220) if k // 4 * 4 not in missing]  # four at a time
    for k, time in enumerate(times):
        module_buffer.append(time, np.zeros((5, 3)))
        if k in cuts:
            module_buffer.pop_samples()
    module_buffer.pop_samples()
    assert module_buffer.n_gaps == Tactile(ANYSKIN, times, np.zeros((len(times), 5, 3))).n_gaps


def test_faults_last_until_an_arrival_clears_them():
    buffer = ArrivalBuffer({"thumb": ANYSKIN, "index": ANYSKIN})
    late, values, markers = {"thumb": (Fault.LATE,)}, np.zeros((5, 3)), []
    for k, (name, faults) in enumerate(
        [
            ("thumb", late),  # begins
            ("index", {}),  # without the thumb
            ("thumb", late),  # goes on
            ("thumb", {}),  # over
            ("thumb", late),  # begins again
            (None, {"thumb": ()}),  # over
            (None, late),  # begins again
        ]
    ):
        samples = {name: values} if name else {}
        buffer.add(Arrival(10.0 * k, samples, 10.0 * k, faults))
        markers.append(len(buffer.pop_markers()))
    assert markers == [1, 0, 0, 0, 1, 0, 1]
    assert buffer.faults == {Fault.LATE: 4}


def test_a_device_with_endless_notices_fills_no_memory(monkeypatch):
    monkeypatch.setattr(module, "MAX_PENDING_MARKERS", 500)
    buffer = ArrivalBuffer({"thumb": ANYSKIN})
    for k in range(10_000):
        buffer.add(notice_arrival(0.01 * k, f"noise {k}", n_refused=1))
    assert buffer.n_refused == 10_000
    assert buffer.pop_markers() == []  # before the first sample
    buffer.add(Arrival(0.0, {"thumb": np.zeros((5, 3))}, 200.0))
    assert len(buffer.pop_markers()) == 500


@pytest.mark.parametrize(
    ("text", "want"),
    [
        ("a\n b\t", "a b"),
        ("\x1b[31mred\x00", "?[31mred?"),
        ("\ud800", "?"),
        ("schließt 閉", "schließt 閉"),
        ("x" * 300, "x" * 200),
    ],
)
def test_marker_text_is_one_printable_line(text, want):
    assert marker_text(text) == want
    marker_text(text).encode()
