"""Thresholds: the replay of decisions at any threshold, curves, and the choice on them."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from detection.detector.build import finger_model, slip_head
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, ContactState
from holdfast.detection import Debounce, Model, parse_features
from holdfast.errors import ModelError, TrainingError
from holdfast.metrics import Decisions, FingerDecisions, match_decisions, summarise
from holdfast.metrics.slip_truth import SlipDecisions
from holdfast.training import Setting, compute_decisions, train, tune
from holdfast.training.thresholds import (
    STABLE_SHARE,
    GraspingFinger,
    GraspingFingers,
    ThresholdReplay,
    choose_handling_thresholds,
)

from .build import tiny_recording

DEBOUNCES = (Debounce(), Debounce(hold=0.1), Debounce(hysteresis=0.2), Debounce(0.05, 0.1, 0.1))
RATE = 100.0


@pytest.fixture(scope="module")
def model(grasps):
    setting = Setting(window=6, features=parse_features("F_a,F_x,sigma", 6), trials=0)
    return train(grasps, setting).model


# --- the replay of the decision rule ---------------------------------------------------------


@pytest.mark.parametrize("debounce", DEBOUNCES)
@pytest.mark.parametrize("threshold", [0.02, 0.5, 0.9])
def test_it_gives_the_states_of_the_detector(model, debounce, threshold):
    own = msgspec.structs.replace(model, debounce=debounce)
    recording = tiny_recording(20)
    expected = compute_decisions(own.with_threshold("stable", threshold), recording).hand
    found = ThresholdReplay.of(own, recording).hand(threshold)
    np.testing.assert_array_equal(found.times, expected.times)
    np.testing.assert_array_equal(found.labels, expected.labels)
    np.testing.assert_array_equal(found.states, expected.states)
    assert len(set(found.states.tolist())) > 1
    assert match_decisions(found) == match_decisions(expected)


def test_a_lower_threshold_is_stable_more_often(model):
    replay = ThresholdReplay.of(model, tiny_recording(21))
    stable = [(replay.hand(p).states == STABLE).sum() for p in (0.999, 0.5, 0.001)]
    assert stable == sorted(stable)
    assert stable[0] < stable[-1]


def test_the_threshold_is_that_of_all_fingers(model):
    changed = model.with_threshold("stable", 0.25)
    assert {part.stable.threshold for part in changed.fingers.values()} == {0.25}
    assert changed.with_threshold("stable", 0.5).fingers.keys() == model.fingers.keys()


# --- tune ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def others():
    return [tiny_recording(seed, n=800) for seed in range(30, 36)]


def hand_events(model, recordings):
    return summarise([compute_decisions(model, each) for each in recordings]).events.hand


@pytest.mark.parametrize("wanted", [40.0, 60.0])
def test_the_detector_keeps_to_the_rate(model, others, wanted):
    tuned = tune(model, others, wanted)
    events = hand_events(tuned.model, others)
    assert events.false_alarms_per_minute <= wanted
    assert events.n_events == tuned.chosen.events.n_events > 0
    assert events.missed == tuned.chosen.events.missed
    assert tuned.chosen.false_alarms == events.false_alarms_per_minute


def test_no_other_threshold_shown_misses_less_for_that_rate(model, others):
    tuned = tune(model, others, 40.0)
    allowed = [point for point in tuned.points if point.false_alarms <= 40.0]
    assert min(allowed, key=lambda point: point.cost(40.0)) == tuned.chosen
    thresholds = [point.threshold for point in tuned.points]
    assert thresholds == sorted(thresholds)
    assert tuned.chosen.threshold in thresholds


def test_the_model_keeps_how_it_was_tuned(model, others, tmp_path):
    named = msgspec.structs.replace(model, name="mine")
    tuned = tune(named, others, 40.0)
    chosen = tuned.chosen
    tuned.model.save(tmp_path / "tuned.json")
    found = Model.load(tmp_path / "tuned.json")
    assert found == tuned.model
    assert found.name == "mine, tuned"
    for part in found.fingers.values():
        choice = part.stable.choice
        assert choice.requested == 40.0
        assert choice.recordings == {each.name: each.readings_digest for each in others}
        assert (choice.n, choice.minutes) == (chosen.events.n_events, chosen.events.stable_minutes)
        assert choice.found == 100 - chosen.events.missed["0.2"]
        assert choice.false_alarms_per_minute == chosen.false_alarms
        assert part.stable.threshold == chosen.threshold
    assert found.training == model.training


def test_without_events_the_most_sensitive_threshold_is_taken(model):
    states = (ContactState.NO_CONTACT, None, ContactState.STABLE, ContactState.STABLE)
    quiet = [tiny_recording(seed, states=states) for seed in (40, 41)]
    tuned = tune(model, quiet, 70.0)
    assert tuned.chosen.events.n_events == 0
    above = [p for p in tuned.points if p.threshold > tuned.chosen.threshold]
    assert all(point.false_alarms > 70.0 for point in above)


def test_a_threshold_that_misses_every_event_is_not_used(model, others):
    """Below the hysteresis, a contact that was stable stays so, whatever happens."""
    lazy = msgspec.structs.replace(model, debounce=Debounce(hysteresis=0.05))
    tuned = tune(lazy, others, 1e6)
    for part in tuned.model.fingers.values():
        assert len(part.stable.choice.points) > 1
        assert all(point.missed < 100 for point in part.stable.choice.points)


@pytest.mark.parametrize("wanted", [-1.0, np.nan, np.inf])
def test_a_rate_below_0(model, others, wanted):
    with pytest.raises(ValueError, match="false alarms"):
        tune(model, others, wanted)


def test_recordings_without_labels(model):
    with pytest.raises(TrainingError, match="labels"):
        tune(model, [tiny_recording(50, states=[None] * 4)], 1.0)


def test_recordings_without_a_stable_hold(model):
    states = (ContactState.NO_CONTACT, None, ContactState.UNSTABLE, ContactState.UNSTABLE)
    with pytest.raises(TrainingError, match="stable"):
        tune(model, [tiny_recording(51, states=states)], 1.0)


def test_a_model_that_is_never_stable(model, others):
    blind = {
        name: msgspec.structs.replace(part, contact_threshold=1e9)
        for name, part in model.fingers.items()
    }
    with pytest.raises(ModelError, match="never STABLE"):
        tune(msgspec.structs.replace(model, fingers=blind), others, 1.0)


def test_a_rate_that_no_threshold_reaches(model):
    """The hand loses contact in a hold that is labelled stable."""
    held = tiny_recording(52, n=800)
    labelled = replace(
        held,
        modules={
            name: replace(module, readings=with_breaks(module.readings), labels=module.labels)
            for name, module in held.modules.items()
        },
    )
    with pytest.raises(TrainingError) as refusal:
        tune(model, [labelled], 0.5)
    message = str(refusal.value)
    assert message.startswith(
        "no threshold gives at most 0.5 false alarms a minute on these recordings; the least is "
    )
    assert "which misses" in message


def with_breaks(readings):
    """Readings without contact, in the middle of the holds."""
    changed = np.array(readings)
    for start in (280, 320, 680, 720):
        changed[start : start + 10] = changed[:10]
    return changed


# --- own handling ----------------------------------------------------------------------------


def part(threshold=0.5, slip=None):
    made = finger_model(threshold=threshold)
    return made if slip is None else made.with_heads(slip_head(made.features, threshold=slip))


def held_finger(probability, slips=None, *, hold=0.0, states=None, name="thumb"):
    """Return a finger that is in contact, with these probabilities of stability and of a slip."""
    n = len(probability)
    times, touching = np.arange(n) / RATE, np.full(n, STABLE, dtype=np.int8)
    states = touching if states is None else np.asarray(states, dtype=np.int8)
    slip = None
    if slips is not None:
        slip = SlipDecisions(times, np.asarray(slips), np.zeros(n, dtype=bool), 0.0, None)
    finger = FingerDecisions(times, np.zeros(n), states, np.asarray(probability), slip=slip)
    raw = Decisions("made", {name: finger}, finger)
    replay = ThresholdReplay(raw, Debounce(hold=hold), 1 / RATE, 1)
    return GraspingFinger(name, replay, states == STABLE)


def handling(*args, **options):
    return GraspingFingers([held_finger(*args, **options)])


def logistic(values):
    return 1 / (1 + np.exp(-np.asarray(values)))


SPREAD = logistic(np.random.default_rng(0).normal(0.5, 1.0, size=3000))


def test_a_share_of_the_handling_is_stable():
    held = handling(SPREAD)
    point = choose_handling_thresholds(held, part())
    assert point.keys() == {"stable"}
    assert held.share("stable", point["stable"]) >= STABLE_SHARE
    assert held.share("stable", point["stable"] * 1.2) < STABLE_SHARE


def test_the_hold_time_of_the_model_counts():
    steady, held = (
        choose_handling_thresholds(handling(SPREAD, hold=s), part()) for s in (0.0, 0.1)
    )
    assert held["stable"] < steady["stable"]


@pytest.mark.parametrize("usual", [0.1, 0.4321])
def test_it_is_at_most_the_threshold_of_the_model(usual):
    calm = logistic(np.random.default_rng(1).normal(6.0, 0.5, size=500))
    assert choose_handling_thresholds(handling(calm), part(usual))["stable"] == usual


@pytest.mark.parametrize(("usual", "highest"), [(0.1, 0.9), (0.95, 0.95)])
def test_handling_that_moves_may_raise_it(usual, highest):
    calm = logistic(np.random.default_rng(1).normal(6.0, 0.5, size=500))
    chosen = choose_handling_thresholds(handling(calm), part(usual), moves=True)
    assert chosen["stable"] == pytest.approx(highest)


def test_a_tenth_of_slip_does_not_move_it_to_the_slip():
    rng = np.random.default_rng(2)
    mixed = np.concatenate([rng.normal(1.0, 1.0, size=1700), rng.normal(-12.0, 1.0, size=300)])
    point = choose_handling_thresholds(handling(logistic(mixed)), part())
    assert np.mean(logistic(mixed[:1700]) >= point["stable"]) > 0.97
    assert np.mean(logistic(mixed[1700:]) >= point["stable"]) == 0.0


def test_slips_are_reported_seldom():
    slips = logistic(np.random.default_rng(3).normal(-1.0, 1.0, size=2000))
    held = handling(np.full(2000, 0.9), slips)
    point = choose_handling_thresholds(held, part(slip=0.3))
    assert held.share("slip", point["slip"]) <= 0.05 < held.share("slip", 0.3)
    assert choose_handling_thresholds(held, part(slip=0.9))["slip"] == 0.9


def test_a_slip_in_it_does_not_silence_the_slip_rule():
    rng = np.random.default_rng(4)
    slips = logistic(
        np.concatenate([rng.normal(-2.0, 0.6, size=1700), rng.normal(4.0, 0.5, size=300)])
    )
    point = choose_handling_thresholds(handling(np.full(2000, 0.9), slips), part(slip=0.3))
    assert np.mean(slips[1700:] >= point["slip"]) == 1.0


def test_false_alarms_are_counted_per_minute_of_holding():
    probability = np.full(6000, 0.9)  # one minute
    probability[1000:1010], probability[2000:2010], probability[3000:3010] = 0.05, 0.2, 0.4
    held = handling(probability)
    assert [held.alarms_per_minute("stable", t) for t in (0.01, 0.1, 0.3, 0.5)] == [0, 1, 2, 3]
    for alarms, low, high in ((0, 0.0, 0.05), (1, 0.05, 0.2), (2, 0.2, 0.4), (3, 0.4, 0.5)):
        chosen = choose_handling_thresholds(held, part(), float(alarms))["stable"]
        assert low < chosen <= high


def test_two_fingers_have_more_alarms_in_the_same_time():
    probability = np.full(6000, 0.9)
    probability[1000:1010] = 0.05
    both = GraspingFingers([held_finger(probability), held_finger(probability, name="index")])
    assert (both.seconds, both.alarms_per_minute("stable", 0.5)) == (pytest.approx(60.0), 2.0)
    parts = GraspingFingers([held_finger(probability), held_finger(probability)])
    assert (parts.seconds, parts.alarms_per_minute("stable", 0.5)) == (pytest.approx(120.0), 1.0)


def test_an_alarm_at_the_release_is_right():
    states = np.repeat([STABLE, NO_CONTACT, STABLE, UNKNOWN], [1000, 500, 1000, 500])
    probability = np.full(3000, 0.9)
    probability[990:1000] = probability[1500:1510] = probability[2490:2500] = 0.01
    assert held_finger(probability, states=states).n_alarms("stable", 0.5) == 0
    probability[500:510] = 0.01
    assert held_finger(probability, states=states).n_alarms("stable", 0.5) == 1


def test_reported_slips_are_counted_too():
    slips = np.full(6000, 0.1)
    slips[1000:1010], slips[2000:2010] = 0.8, 0.95
    held = handling(np.full(6000, 0.9), slips)
    assert [held.alarms_per_minute("slip", t) for t in (0.5, 0.9, 0.99)] == [2, 1, 0]
    chosen = [choose_handling_thresholds(held, part(slip=0.5), n)["slip"] for n in (2.0, 1.0)]
    assert chosen[0] == 0.5
    assert 0.8 < chosen[1] <= 0.95


def test_too_many_alarms_are_refused():
    probability = np.full(6000, 0.9)
    probability[::100] = 1e-9
    with pytest.raises(TrainingError, match="the least is 59"):
        choose_handling_thresholds(handling(probability), part(), 1.0)
    slips = np.full(6000, 0.1)
    slips[100::100] = 1.0
    with pytest.raises(TrainingError, match="least is 59"):
        choose_handling_thresholds(handling(np.full(6000, 0.9), slips), part(slip=0.5), 0.0)
