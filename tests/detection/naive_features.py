"""Slow and simple tare, fingertip force and Haar window: plain Python, one loop each."""

import math

import numpy as np

NAMES = ("F_a", "F_x", "F_y", "F_z", "m", "sigma")


def features(force, window):
    """(n, 6) as the paper prints it, with exact sums."""
    rows = []
    for k in range(len(force)):
        held = [[float(value) for value in row] for row in force[max(k - window + 1, 0) : k + 1]]
        if len(held) < window or not all(math.isfinite(v) for row in held for v in row):
            rows.append([math.nan] * 6)
            continue
        amplitudes = [math.sqrt(math.fsum(v * v for v in row)) for row in held]
        pairs = [(amplitudes[j], amplitudes[j + 1]) for j in range(0, window, 2)]
        m, sigma = moments(
            [(x0 + x1) / math.sqrt(2) for x0, x1 in pairs],
            [(x0 - x1) / math.sqrt(2) for x0, x1 in pairs],
            window,
        )
        rows.append([amplitudes[-1], *held[-1], m, sigma])
    return np.array(rows).reshape(-1, 6)


def moments(approximations, details, window):
    """Equations 1 and 2: both divide by the window, though there are half as many."""
    mean = math.fsum(details) / len(details)
    squares = math.fsum((d - mean) ** 2 for d in details)
    return math.fsum(approximations) / window, math.sqrt(squares / window)


def force(sample, baseline, rotations):
    """The sum over taxels of R_i (f_i - b_i)."""
    total = [0.0, 0.0, 0.0]
    for i in range(len(rotations)):
        for row in range(3):
            for column in range(3):
                pressed = float(sample[i][column]) - float(baseline[i][column])
                total[row] += float(rotations[i][row][column]) * pressed
    return total


def first_mean(readings, times, seconds, period):
    """The mean of the finite samples in the first `seconds`, and the first sample after them."""
    finite = [k for k in range(len(times)) if np.isfinite(readings[k]).all()]
    start = times[finite[0]]
    taken = [k for k in finite if times[k] - start < seconds - period / 2] or finite[:1]
    after = [
        k for k in range(len(times)) if k > taken[-1] and times[k] - start >= seconds - period / 2
    ]
    return np.mean([readings[k] for k in taken], axis=0, dtype=np.float64), min(
        after, default=len(times)
    )
