"""Thresholds: the replay of decisions at any threshold, curves, and the choice on them."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from detection.detector.build import finger_model, slip_head
from holdfast.contact import STABLE, ContactState
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
    choose_handling_slips,
    choose_stability_threshold,
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
    threshold = choose_stability_threshold(held, part())
    assert held.share(threshold) >= STABLE_SHARE > held.share(threshold * 1.2)


def test_the_hold_time_of_the_model_counts():
    steady, held = (
        choose_stability_threshold(handling(SPREAD, hold=s), part()) for s in (0.0, 0.1)
    )
    assert held < steady


@pytest.mark.parametrize("usual", [0.1, 0.4321])
def test_it_is_at_most_the_threshold_of_the_model(usual):
    calm = logistic(np.random.default_rng(1).normal(6.0, 0.5, size=500))
    assert choose_stability_threshold(handling(calm), part(usual)) == usual


@pytest.mark.parametrize(("usual", "highest"), [(0.1, 0.9), (0.95, 0.95)])
def test_handling_that_moves_may_raise_it(usual, highest):
    calm = logistic(np.random.default_rng(1).normal(6.0, 0.5, size=500))
    chosen = choose_stability_threshold(handling(calm), part(usual), moves=True)
    assert chosen == pytest.approx(highest)


def test_a_tenth_of_slip_does_not_move_it_to_the_slip():
    rng = np.random.default_rng(2)
    mixed = np.concatenate([rng.normal(1.0, 1.0, size=1700), rng.normal(-12.0, 1.0, size=300)])
    threshold = choose_stability_threshold(handling(logistic(mixed)), part())
    assert np.mean(logistic(mixed[:1700]) >= threshold) > 0.97
    assert np.mean(logistic(mixed[1700:]) >= threshold) == 0.0


def test_two_fingers_have_more_alarms_in_the_same_time():
    probability = np.full(6000, 0.9)
    probability[1000:1010] = 0.05
    both = GraspingFingers([held_finger(probability), held_finger(probability, name="index")])
    assert (both.seconds, both.alarms_per_minute(0.5)) == (pytest.approx(60.0), 2.0)
    parts = GraspingFingers([held_finger(probability), held_finger(probability)])
    assert (parts.seconds, parts.alarms_per_minute(0.5)) == (pytest.approx(120.0), 1.0)


# --- slips of own handling -------------------------------------------------------------------


def bumps(*heights):
    """Return a minute of a low probability of a slip, with a short bump every 5 s."""
    probability = np.full(6000, 0.05)
    for k, height in enumerate(heights):
        probability[500 * k + 100 : 500 * k + 105] = height
    return probability


def slips_of(probability, slip=None, false_alarms=1.0, **options):
    made = finger_model()
    made = made.with_heads(slip or slip_head(made.features, threshold=1.0))
    held = handling(np.full(len(probability), 0.9), probability, **options)
    return choose_handling_slips(held, made, false_alarms)


@pytest.mark.parametrize(("rate", "low", "high"), [(0.5, 0.9, 0.96), (1, 0.8, 0.9), (2, 0.6, 0.8)])
def test_the_threshold_is_the_lowest_with_few_enough_alarms(rate, low, high):
    (chosen,) = slips_of(bumps(0.9, 0.8, 0.6), false_alarms=rate)
    assert low < chosen.threshold <= high
    assert (chosen.n, chosen.minutes) == (int(rate), pytest.approx(1.0))


def test_a_quiet_threshold_below_an_alarming_one_is_not_taken():
    """Two bumps that one long alarm joins at a low threshold are two at a higher one."""
    probability = bumps(0.9, 0.9, 0.9)
    (chosen,) = slips_of(probability)
    assert chosen.threshold > 0.9


def test_the_minutes_of_all_fingers_count():
    made = finger_model().with_heads(slip_head(finger_model().features, threshold=1.0))
    stable = np.full(6000, 0.9)
    both = GraspingFingers(
        [held_finger(stable, bumps(0.9)), held_finger(stable, bumps(0.8, 0.7), name="index")]
    )
    (chosen,) = choose_handling_slips(both, made, 1.0)
    assert chosen.minutes == pytest.approx(2.0)
    assert 0.7 < chosen.threshold <= 0.8  # two alarms in two minutes


@pytest.mark.parametrize(
    ("scores", "silent"), [((-2.0,) * 10, True), ((-2.0,) * 8 + (4.0,) * 2, False)]
)
def test_a_threshold_that_finds_hardly_a_slip_is_none(scores, silent):
    """The five highest times are shown, one of each bump."""
    made = finger_model()
    head = msgspec.structs.replace(slip_head(made.features, threshold=1.0), slip_scores=scores)
    heights = (0.95, 0.9, 0.85, 0.8, 0.75, 0.7)
    (chosen,) = slips_of(bumps(*heights), head)
    assert chosen.is_silent is silent
    assert chosen.found == (0.0 if silent else 20.0)
    assert [x.probability for x in chosen.highest] == list(heights[:5])
    assert [x.time for x in chosen.highest] == pytest.approx([1.0, 6.0, 11.0, 16.0, 21.0], abs=0.05)
    assert ("thumb 1.00 s" in chosen.text()) is silent


def test_each_form_of_zero_has_its_head():
    made = finger_model()
    both = made.with_heads(
        slip_head(made.features, threshold=1.0),
        msgspec.structs.replace(slip_head(made.features, threshold=1.0), name="slip_changes"),
    )
    stable = np.full(6000, 0.9)
    fingers = [
        held_finger(stable, bumps(0.9)),
        replace(held_finger(stable, bumps(0.7, 0.6)), zero_unknown=True),
    ]
    slip, changes = choose_handling_slips(GraspingFingers(fingers), both, 1.0)
    assert (slip.head, changes.head) == ("slip", "slip_changes")
    assert slip.threshold < changes.threshold <= 0.7
    (only,) = choose_handling_slips(GraspingFingers(fingers[:1]), both, 1.0)
    assert only == slip
