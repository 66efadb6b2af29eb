"""The matcher of alarms against a plain loop."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from holdfast.metrics.alarms import first_alarms, outside


@given(st.data())
def test_first_alarm_in_each_window_as_a_loop_finds_it(data):
    n, n_rows = data.draw(st.integers(0, 30)), data.draw(st.integers(1, 3))
    times = np.cumsum(data.draw(st.lists(st.integers(1, 3), min_size=n, max_size=n))) * 0.1
    table = np.array(data.draw(st.lists(st.booleans(), min_size=n * n_rows, max_size=n * n_rows)))
    table = table.astype(bool).reshape(n_rows, n)
    spans = data.draw(st.lists(st.tuples(st.integers(-5, 60), st.integers(0, 20)), max_size=4))
    windows = np.array([(0.1 * a - 0.05, 0.1 * (a + b) + 0.05) for a, b in spans]).reshape(-1, 2)

    expected = [
        [
            min(
                (t for t, alarm in zip(times, row, strict=True) if alarm and a <= t <= b),
                default=math.inf,
            )
            for a, b in windows
        ]
        for row in table
    ]
    found = first_alarms(times, np.flatnonzero(table), windows, n_rows)
    assert found.tolist() == np.array(expected).reshape(n_rows, len(windows)).tolist()
    assert outside(times, windows).tolist() == [
        not any(a <= t <= b for a, b in windows) for t in times
    ]
