"""Choice of the threshold for a wanted rate of false alarms."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.detection import Debounce, Model, parse_features
from holdfast.errors import ModelError, TrainingError
from holdfast.metrics import summarise
from holdfast.training import Setting, compute_decisions, train, tune

from .build import tiny_recording

pytestmark = pytest.mark.slow

HELD = (ContactState.NO_CONTACT, ContactState.STABLE, ContactState.UNSTABLE, ContactState.STABLE)


@pytest.fixture(scope="module")
def model(grasps):
    setting = Setting(window=6, features=parse_features("F_a,F_x,sigma", 6), trials=0)
    return train(grasps, setting).model


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


# --- what is refused -------------------------------------------------------------------------


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
