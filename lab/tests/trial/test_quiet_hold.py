import pytest

from holdfast.twin.hand import RATE
from holdfast_grip.command import GripCommand, LoopState
from holdfast_lab.trial.quiet_hold import IMPACT_MEMORY, START_TIME, QuietHold
from holdfast_lab.trial.trials import draw_trial

SECONDS = 5.0


def hold(rises_at, slides_at=None, impacts=()):
    """A hold of 5 s with one rise, and a slide of one sample."""
    quiet = QuietHold(impacts)
    for k in range(round(SECONDS * RATE)):
        state = LoopState.REACT if k == round(rises_at * RATE) else LoopState.HOLD
        speed = 0.05 if slides_at is not None and k == round(slides_at * RATE) else 0.0
        quiet.add(k / RATE, speed, GripCommand(k / RATE, state, {}))
    return quiet


@pytest.fixture(scope="module")
def impacts():
    found = draw_trial(0, n_impacts=1).impacts()
    assert 1.0 < found[0].start < SECONDS - IMPACT_MEMORY
    return found


def test_a_rise_in_quiet_is_false():
    quiet = hold(2.0)
    assert quiet.n_false == 1
    assert quiet.quiet_time == pytest.approx(SECONDS - START_TIME, abs=2 / RATE)


@pytest.mark.parametrize(("rises_at", "slides_at"), [(0.2, None), (2.0, 1.9)])
def test_a_rise_at_the_start_or_after_a_slide_is_not(rises_at, slides_at):
    assert hold(rises_at, slides_at).n_false == 0


def test_a_rise_after_an_impact_answers_it(impacts):
    start = impacts[0].start
    answered, late = hold(start + 0.1, impacts=impacts), hold(start + 0.6, impacts=impacts)
    assert [one.is_answered for one in answered.impacts] == [True] and answered.n_false == 0
    assert [one.is_answered for one in late.impacts] == [False] and late.n_false == 1
