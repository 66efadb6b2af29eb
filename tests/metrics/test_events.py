import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, ContactState
from holdfast.metrics import (
    event_metrics,
    match_alarms,
    pool_events,
)

from . import naive

U, N, F, S = UNKNOWN, NO_CONTACT, UNSTABLE, STABLE
"""As codes: unlabelled, no contact, unstable ("fails"), stable."""


def codes(*runs):
    """Codes at 100 Hz from (code, n_samples) pairs."""
    return np.repeat([code for code, _ in runs], [n for _, n in runs]).astype(np.int8)


def match(labels, states, start=0.0):
    return match_alarms(start + 0.01 * np.arange(len(labels)), labels, states)


def spans(labels):
    found = match(labels, np.full(len(labels), S)).events
    return [(round(event.onset, 6), round(event.end, 6)) for event in found]


def ticks(found, start=0.0):
    def tick(time):
        return None if time is None else round((time - start) * 100)

    events = [tuple(tick(time) for time in event) for event in found.events]
    return events, [tick(alarm.time) for alarm in found.false_alarms]


@pytest.mark.parametrize(
    ("runs", "expected"),
    [
        pytest.param([(S, 50), (F, 5), (S, 9)], [(0.5, 0.55)], id="just long enough"),
        pytest.param([(S, 50), (N, 5), (S, 9)], [(0.5, 0.55)], id="no contact is not stable"),
        pytest.param(
            [(S, 50), (F, 3), (N, 2)], [(0.5, 0.55)], id="a run of two states, to the end"
        ),
        pytest.param([(S, 49), (F, 20)], [], id="not stable for long enough"),
        pytest.param([(S, 50), (F, 4), (S, 50)], [], id="too short"),
        pytest.param([(S, 50), (F, 3), (S, 9), (F, 3)], [(0.5, 0.65)], id="stable gap closed"),
        pytest.param([(S, 50), (F, 3), (U, 9), (F, 3)], [(0.5, 0.65)], id="unlabelled gap closed"),
        pytest.param([(S, 50), (F, 3), (S, 10), (F, 3)], [], id="gap of 0.1 s stays open"),
        pytest.param(
            [(S, 50), (F, 5), (S, 40), (F, 9)], [(0.5, 0.55)], id="stable again too briefly"
        ),
        pytest.param([(S, 30), (F, 1), (S, 30), (F, 9)], [], id="a blip breaks the stable time"),
        pytest.param([(S, 50), (U, 1), (F, 9)], [], id="the onset follows at once"),
        pytest.param(
            [(S, 30), (U, 1), (S, 30), (F, 9)], [], id="unlabelled breaks the stable time"
        ),
        pytest.param([(S, 50), (F, 9), (U, 30), (F, 9)], [(0.5, 0.59)], id="ends where unlabelled"),
        pytest.param([(F, 20), (S, 20)], [], id="nothing was held"),
        pytest.param([(S, 50), (F, 5)] * 2, [(0.5, 0.55), (1.05, 1.1)], id="two"),
        pytest.param([], [], id="no samples"),
        pytest.param([(S, 1)], [], id="one sample"),
    ],
)
def test_what_is_an_event(runs, expected):
    assert spans(codes(*runs)) == expected


LABELS = codes((S, 100), (F, 10), (S, 100))
"""An event from 1.0 s to 1.1 s: alarms from 0.98 s to 1.35 s belong to it."""


@pytest.mark.parametrize(
    ("alarms", "expected"),
    [
        ([97], (None, [97])),
        ([98], (98, [])),
        ([135], (135, [])),
        ([136], (None, [136])),
        ([50, 98, 104, 134, 150], (98, [50, 150])),
        ([], (None, [])),
    ],
)
def test_which_alarms_belong_to_an_event(alarms, expected):
    states = np.full(len(LABELS), S)
    states[alarms] = F
    found = match(LABELS, states)
    assert ticks(found) == ([(100, 110, expected[0])], expected[1])


@pytest.mark.parametrize(
    ("runs", "alarms"),
    [
        pytest.param([(S, 5), (F, 5)], [5], id="unstable"),
        pytest.param([(S, 5), (N, 5)], [5], id="no contact"),
        pytest.param([(S, 5), (F, 2), (N, 2), (F, 1)], [5], id="once per change"),
        pytest.param([(S, 5), (U, 1), (F, 4)], [], id="consecutive samples alone count"),
        pytest.param([(U, 5), (F, 5)], [], id="from unknown"),
        pytest.param([(F, 5), (S, 5)], [], id="becoming stable"),
        pytest.param([(F, 10)], [], id="never stable"),
    ],
)
def test_what_is_an_alarm(runs, alarms):
    states = codes(*runs)
    assert ticks(match(np.full(len(states), S), states)) == ([], alarms)


def test_a_false_alarm_has_the_label_at_its_time():
    labels = codes((S, 10), (U, 10), (N, 10))
    states = np.tile([S, S, S, S, F], 6)
    found = match(labels, states)
    assert [alarm.label for alarm in found.false_alarms] == [
        *[ContactState.STABLE] * 2,
        *[ContactState.NO_CONTACT] * 2,
    ]
    metrics = pool_events([found])
    assert metrics.false_alarms == {"NO_CONTACT": 2, "UNSTABLE": 0, "STABLE": 2}
    assert metrics.unlabelled_alarms == found.n_unlabelled == 2
    assert metrics.false_alarms_per_minute == pytest.approx(4 / (0.1 / 60))


def test_what_is_not_labelled_has_no_false_alarm():
    """The release of a hand whose quiet hold alone is labelled."""
    labels, states = codes((S, 100), (U, 100)), codes((S, 120), (N, 30), (S, 30), (N, 20))
    metrics = event_metrics(np.arange(200) / 100, labels, states)
    assert metrics.false_alarms_per_minute == 0
    assert metrics.unlabelled_alarms == 2


def test_without_samples_there_are_no_event_metrics():
    for metrics in (pool_events([]), event_metrics([], [], [])):
        assert (metrics.n_events, metrics.stable_minutes) == (0, 0.0)
        assert metrics.missed == {"0.05": None, "0.1": None, "0.2": None}
        assert metrics.delay_median is None
        assert metrics.delay_p95 is None
        assert metrics.false_alarms_per_minute is None


def test_arguments_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"labels \(1,\)"):
        event_metrics([0.0, 0.1], [S], [S, S])
    with pytest.raises(ValueError, match="times"):
        event_metrics([0.1, 0.0], [S, S], [S, S])


code = st.sampled_from([U, N, F, S, S, S])
length = st.sampled_from([2, 3, 4, 5, 6, 9, 10, 11, 25, 26, 49, 50, 51, 70])
sequence = st.lists(st.tuples(code, length), min_size=1, max_size=14).map(lambda r: codes(*r))


@st.composite
def recordings(draw):
    labels = draw(sequence)
    states = np.resize(draw(sequence), len(labels))
    return labels, np.roll(labels, draw(st.integers(-3, 30))) if draw(st.booleans()) else states


@given(recordings(), st.sampled_from([0.0, -7.3, 1.7e9]))
def test_the_twin_in_ticks_agrees_wherever_time_begins(recording, start):
    labels, states = recording
    found = match(labels, states, start)
    assert ticks(found, start) == naive.match(labels, states)
    assert found.stable_seconds == pytest.approx(0.01 * (labels == S).sum(), abs=1e-5)


@given(recordings(), recordings())
def test_a_cut_in_a_calm_stretch_changes_nothing(one, two):
    calm = codes((S, 60))
    first = [np.concatenate([part, calm]) for part in one]
    second = [np.concatenate([calm, part]) for part in two]
    whole = pool_events(
        [match(*(np.concatenate(pair) for pair in zip(first, second, strict=True)))]
    )
    parts = pool_events([match(*first), match(*second, start=33.0)])
    assert whole.n_events == parts.n_events
    assert whole.missed == parts.missed
    assert whole.false_alarms == parts.false_alarms
    assert whole.stable_minutes == pytest.approx(parts.stable_minutes)
    assert whole.delay_median == pytest.approx(parts.delay_median, abs=1e-6)


well_formed = st.lists(
    st.tuples(st.integers(50, 90), st.sampled_from([N, F]), st.integers(5, 60)),
    min_size=1,
    max_size=6,
)


def alternating(grasps):
    return codes(*(run for held, lost, n in grasps for run in ((S, held), (lost, n))), (S, 50))


@given(well_formed, st.integers(-2, 29))
def test_delays_shift_as_alarms_do(grasps, shift):
    labels = alternating(grasps)
    states = np.roll(labels, shift)
    states[: max(shift, 0)] = S
    metrics = event_metrics(0.01 * np.arange(len(labels)), labels, states)
    assert metrics.delay_median == pytest.approx(0.01 * shift, abs=1e-9)
    assert metrics.delay_p95 == pytest.approx(0.01 * shift, abs=1e-9)
    expected = {str(post): 100.0 * (shift > 100 * post) for post in (0.05, 0.1, 0.2)}
    assert metrics.missed == expected


@pytest.mark.parametrize(
    ("labels", "states", "held", "unstable", "rises"),
    [
        pytest.param([(N, 100), (S, 200)], [(N, 100), (S, 200)], 2.0, 0.0, 0, id="always right"),
        pytest.param([(N, 100), (S, 200)], [(F, 300)], 2.0, 2.0, 0, id="always UNSTABLE"),
        pytest.param(
            [(S, 300)], [(S, 100), (F, 9), (S, 9), (F, 9), (S, 173)], 3.0, 0.18, 2, id="twice"
        ),
        pytest.param(
            [(S, 100), (F, 20), (S, 100)],
            [(S, 130), (F, 10), (S, 80)],
            2.2,
            0.1,
            0,
            id="late, within the tolerance of a disturbance",
        ),
        pytest.param([(S, 100), (N, 200)], [(S, 200), (F, 100)], 1.0, 0.0, 0, id="after release"),
        pytest.param([(U, 300)], [(S, 100), (F, 200)], 0.0, None, None, id="nothing labelled"),
    ],
)
def test_held_time_that_is_unstable_and_its_rises(labels, states, held, unstable, rises):
    found = match(codes(*labels), codes(*states))
    assert found.held.seconds == pytest.approx(held)
    metrics = pool_events([found, found])
    if not held:
        assert metrics.held_unstable is metrics.rises_per_minute is None
        return
    assert metrics.held_unstable == pytest.approx(100 * unstable / held)
    assert metrics.rises_per_minute == pytest.approx(60 * rises / held)
