import numpy as np
import pytest
from matplotlib.colors import to_hex

from figures.drawing import drawn
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.plots.style import (
    COMPONENT_COLOURS,
)
from holdfast.plots.time_series import FingerSeries
from holdfast_lab.figures.experiment import draw_forces

pytestmark = pytest.mark.slow


def series(n=200, seed=0, **options):
    rng = np.random.default_rng(seed)
    force = rng.normal(0, 100, (n, 3))
    quarter = n // 4
    phases = np.repeat(["free", "closing", "locked", ""], quarter)
    labels = np.repeat([NO_CONTACT, UNSTABLE, STABLE, UNKNOWN], quarter)
    sigma = np.abs(rng.normal(2, 0.1, n))
    sigma[:5] = np.nan
    amplitude = np.linalg.norm(force, axis=1)
    made = FingerSeries(
        "ball-1, index", 0.01 * np.arange(n), force, amplitude, amplitude / 2, sigma, labels, phases
    )
    return made._replace(**options)


def lines(axes):
    return {to_hex(line.get_color()): line.get_ydata() for line in axes.lines}


def test_long_recordings_keep_their_peaks():
    given = series(40_000)
    values = lines(drawn(draw_forces(given)).axes[0])[COMPONENT_COLOURS["F_x"].lower()]
    assert len(values) < 5000
    assert values.max() == given.force[:, 0].max()
