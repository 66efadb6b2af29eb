import io
import subprocess
import sys

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import Decisions, FingerDecisions, summarise
from holdfast.plots.evaluation import calibration, draw_evaluation


def finger(seed, *, delay=0.05, labelled=True, n=400):
    rng = np.random.default_rng(seed)
    times = 0.01 * np.arange(n)
    labels = np.repeat([NO_CONTACT, STABLE, UNSTABLE, STABLE], n // 4)
    states = np.roll(labels, round(delay * 100))
    states[:5] = UNKNOWN
    score = np.clip(0.5 + 0.4 * (2 * (states == STABLE) - 1) + rng.normal(0, 0.1, n), 0, 1)
    score = np.where(states == UNKNOWN, np.nan, score)
    return FingerDecisions(times, labels if labelled else 0 * labels, states, score)


def example_decisions(n, names=("thumb", "index"), **options):
    return [
        Decisions.of(
            f"grasp-{k}", {name: finger(10 * k + i, **options) for i, name in enumerate(names)}, 2
        )
        for k in range(n)
    ]


def draw(decisions):
    return draw_evaluation(summarise(decisions, n_resamples=10), decisions)


@pytest.mark.parametrize("form", ["png", "svg", "pdf"])
def test_it_is_drawn_without_a_screen(form):
    file = io.BytesIO()
    draw(example_decisions(3)).savefig(file, format=form)
    assert len(file.getvalue()) > 5000


def test_no_global_state_is_touched():
    """pyplot keeps every figure that it makes until it is closed."""
    program = (
        "import sys; from holdfast.plots.evaluation import draw_evaluation\n"
        "from holdfast.metrics import summarise\n"
        "draw_evaluation(summarise([]), []); assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.parametrize(
    "decisions",
    [
        example_decisions(1),
        example_decisions(40),
        example_decisions(2, names=tuple(f"finger{k}" for k in range(9))),
        example_decisions(2, labelled=False),
        [Decisions("nothing", {})],
        [*example_decisions(2), Decisions("nothing", {})],
        [*example_decisions(1), *example_decisions(1, names=("ring",))],
        [],
    ],
    ids=["one", "many", "hand", "bare", "nothing", "some", "unlike", "none"],
)
def test_incomplete_decisions_can_be_drawn(decisions):
    draw(decisions).savefig(io.BytesIO(), format="png")


def test_calibration_by_hand():
    labels = np.array([STABLE, STABLE, UNSTABLE, NO_CONTACT, UNKNOWN, STABLE])
    states = np.array([STABLE, STABLE, STABLE, NO_CONTACT, STABLE, UNKNOWN])
    score = np.array([0.98, 1.0, 0.92, 0.0, 0.5, np.nan])
    given = FingerDecisions(np.arange(6.0), labels, states, score)
    np.testing.assert_allclose(calibration([given]), [[0.0, 0.0, 1], [2.9 / 3, 2 / 3, 3]])
    assert calibration([]).shape == (0, 3)
