"""Alarms and the windows of time in which they are right: one matcher for events and slips."""

import numpy as np

from holdfast.metrics.masks import Mask
from holdfast.sensors.types import Array, Integers


def first_alarms(times: Array, alarms: Integers, windows: Array, n_rows: int = 1) -> Array:
    """Return the time of the first alarm in each window.

    Args:
        times: (n,) strictly increasing [s].
        alarms: (n_alarms,) in ascending order: index of each alarm in the table (n_rows, n), with
            one row for each threshold.
        windows: (n_windows, 2) first and last time of each window [s].
        n_rows: number of thresholds.

    Returns:
        (n_rows, n_windows) [s]; infinite without an alarm.

    Example:
        >>> times, windows = np.arange(10) / 10, np.array([[0.0, 0.25], [0.5, 0.6]])
        >>> first_alarms(times, np.array([2, 3, 9]), windows).tolist()
        [[0.2, inf]]
    """
    n, row = len(times), np.arange(n_rows)[:, None]
    earliest, latest = windows.T
    index = np.searchsorted(alarms, row * n + np.searchsorted(times, earliest))
    rows, samples = np.divmod(alarms, max(n, 1))
    alarm_times, rows = np.append(times[samples], np.inf), np.append(rows, -1)
    is_inside = (rows[index] == row) & (alarm_times[index] <= latest)
    return np.where(is_inside, alarm_times[index], np.inf)


def outside(times: Array, windows: Array) -> Mask:
    """Return (n,) True at the times that are in no window.

    Args:
        times: (n,) strictly increasing [s].
        windows: (n_windows, 2) first and last time of each window [s].
    """
    mask = np.ones(len(times), dtype=bool)
    for first, last in windows:
        mask[np.searchsorted(times, first) : np.searchsorted(times, last, side="right")] = False
    return mask
