"""Panels about slips: what is drawn is what was counted and decided."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from msgspec.structs import replace as replace_fields

from holdfast.detection import Model
from holdfast.metrics import Decisions, FingerDecisions, summarise
from holdfast.metrics.slip_truth import SLIDING, STILL, Slip, SlipDecisions, SlipTruth
from holdfast.plots.evaluation import draw_evaluation
from holdfast.plots.recording import plot_recording
from holdfast.plots.slips import draw_slips_found
from holdfast.recordings import Truth
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.slow

TIMES = 0.01 * np.arange(1000)


def decisions(delay, onset=5.0, origin="truth"):
    """One slip, found some time after its onset; gross from 0.1 s after it on."""
    codes = np.where((onset <= TIMES) & (onset + 1 > TIMES), SLIDING, STILL).astype(np.int8)
    raised = (onset + delay - 1e-9 <= TIMES) & (onset + 1 > TIMES)
    slip = Slip(onset, onset + 1, onset + 0.1, 2e-3, (onset + 0.2, np.nan))
    truth = SlipTruth(codes, codes == STILL, (slip,), origin)
    slips = SlipDecisions(TIMES, np.where(raised, 0.9, 0.1), raised, 0.0, truth)
    labels = np.where(codes == SLIDING, 2, 3)
    finger = FingerDecisions(TIMES, labels, labels, np.where(labels == 3, 0.9, 0.1), slip=slips)
    return Decisions.of(f"grasp-{delay}", {"thumb": finger}, 1)


def test_the_share_found_over_time():
    several = [decisions(delay) for delay in (-0.3, 0.04, 0.2, 0.6)]
    axes = Figure().subplots()
    draw_slips_found(axes, several, summarise(several, n_resamples=10).slips.pooled)
    curves = {line.get_label().split(" (")[0]: line for line in axes.get_lines()}
    times, shares = curves["incipient"].get_data()
    assert shares[0] == 0.25  # found before the axis begins
    assert [float(shares[times <= limit + 1e-9][-1]) for limit in (0.0, 0.05, 0.3)] == [
        0.25, 0.5, 0.75
    ]  # fmt: skip
    times, shares = curves["gross"].get_data()
    assert float(shares[times <= 0][-1]) == 0.5  # 0.04 s after the onset is before the gross slip
    assert axes.get_xlim() == (-0.1, 0.3)


def test_an_evaluation_has_two_panels_of_slips_only_if_they_are_scored():
    made = [decisions(0.02), decisions(0.1)]
    metrics = summarise(made, n_resamples=10)
    titles = [axes.get_title("left") for axes in draw_evaluation(metrics, made).axes]
    assert titles[-2] == "slips of fingers: 2 by the truth"
    assert titles[-1].startswith("false alarms of slips: ")
    assert len(draw_evaluation(replace_fields(metrics, slips=None), made).axes) == len(titles) - 2


@pytest.fixture(scope="module")
def grasp():
    """A recording with the speed of the thumb, and a time in which it slides."""
    made = synthetic_recording("grasp", 1, ("thumb", "index"))
    times = made.modules["thumb"].times
    speed = np.where((times > 6) & (times < 6.3), 5e-3, 0.0)
    return replace(made, truth=Truth(times, {}, {"thumb": {"slip_speed": speed}}))


@pytest.fixture(scope="module")
def model():
    """The built-in model with the rule that a finger slides where it is not stable."""
    built_in = Model.load("builtin:twin")
    part = built_in.fingers["*"].without_heads("slip_speed")
    (weights,) = part.stable.rule.weights
    rule = replace_fields(part.stable.rule, weights=(tuple(-value for value in weights),))
    slip = replace_fields(part.stable, name="slip", rule=rule, hold=0.1)
    return replace_fields(built_in, fingers={"*": part.with_heads(slip)})


def test_without_a_truth_decisions_are_drawn_alone(grasp, model):
    figure = plot_recording(replace(grasp, truth=None), model=model)
    assert [axes.get_ylabel() for axes in figure.axes][:3] == [
        "force [counts]", "σ [counts]", "p(slip)"
    ]  # fmt: skip


def test_a_model_without_a_rule_is_refused(grasp):
    noise_floor = Model.load("builtin:noise-floor")
    with pytest.raises(ValueError, match="slip rule"):
        plot_recording(grasp, model=noise_floor)
