"""The law of holdfast when forces change suddenly: a knock, a bump, a jerk of the hand."""

import pytest

from grip.laws.test_laws import DT, started, touch, update
from grip.laws.test_response import knowing
from holdfast_grip.laws.shocks import BLOW_TIME, LONGEST_SHOCK, SHOCK_TIME
from holdfast_grip.laws.stability import UNCONFIRMED

BEGIN = 1.5
"""When the doubt begins [s]: after the response of the hand was measured."""


def first_rise(
    seconds, *, blow=1.0, late=0.0, load=1.0, slides_after=None, knows_slips=True, ramp=0.0, dt=DT
):
    """Return the time from the beginning of a doubt to the first rise; None without one.

    Args:
        seconds: duration of the doubt.
        blow: ratio of all forces to those before, from `late` after the doubt began.
        late: see `blow`.
        load: ratio of the load to that before, while the doubt lasts.
        slides_after: time in the doubt from which the finger is decided to slide.
        knows_slips: whether the model has a slip rule.
        ramp: time over which the forces change.
        dt: time between two samples.
    """
    one = knowing() if knows_slips else touch()
    law = started("holdfast", [one])
    one.scale = 1.0
    for k in range(round((BEGIN + seconds + 0.3) / dt)):
        since = k * dt - BEGIN
        doubts = 0.0 <= since < seconds
        part = min(max((since - late + dt) / (ramp + dt), 0.0), 1.0)
        ratio = 1.0 + (blow - 1.0) * part
        one.normal, one.tangential = 2.0 * ratio, 0.6 * ratio * (load if doubts else 1.0)
        one.probability = 0.02 if doubts else 0.95
        one.slides = doubts and slides_after is not None and since >= slides_after
        one.slip_probability = 0.9 if one.slides else 0.0
        (target,) = update(law, [one], k * dt, dt)
        if since >= 0 and target.scale > max(one.scale, 1.07):
            return since
        if target.scale < one.scale or since < 0:
            one.scale = target.scale
    return None


@pytest.mark.parametrize("knows_slips", [True, False])
def test_a_blow_explains_the_doubt_that_begins_with_it(knows_slips):
    assert first_rise(0.2, knows_slips=knows_slips) < 0.06
    assert first_rise(0.2, blow=0.95, knows_slips=knows_slips) is None


@pytest.mark.parametrize("dt", [1 / 60, DT, 1 / 225])
def test_a_load_that_comes_smoothly_is_no_blow(dt):
    assert first_rise(0.4, blow=0.8, ramp=0.1, dt=dt) < 0.06


def test_a_blow_in_a_doubt_explains_nothing():
    assert first_rise(0.3, blow=0.95, late=0.1) < 0.06


def test_a_slide_is_answered_when_the_blow_is_over():
    late = first_rise(0.5, blow=0.95, slides_after=0.0)
    assert BLOW_TIME - DT <= late < BLOW_TIME + 4 * DT


@pytest.mark.parametrize(("knows_slips", "longest"), [(True, LONGEST_SHOCK), (False, SHOCK_TIME)])
def test_a_doubt_that_lasts_is_answered_late(knows_slips, longest):
    late = first_rise(1.5, blow=0.95, knows_slips=knows_slips)
    assert longest - DT <= late < longest + 0.1


def test_a_slide_confirms_the_doubt():
    sooner, later = first_rise(0.3, slides_after=0.0), first_rise(0.3)
    assert sooner < later and later >= UNCONFIRMED


def test_noise_of_a_light_grip_is_no_blow():
    """The noise is larger than the share of the force that is a shock elsewhere."""
    one = knowing(normal=0.2, tangential=0.06)
    law = started("holdfast", [one])
    rises = []
    for k in range(round((BEGIN + 0.3) / DT)):
        one.normal = 0.2 + 0.01 * (-1) ** k
        if k * DT >= BEGIN:
            one.probability = 0.02
            rises.append(update(law, [one], k * DT, DT)[0].scale > 1.07)
        else:
            update(law, [one], k * DT, DT)
    assert any(rises)
