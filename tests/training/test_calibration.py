"""Calibration of a model by own handling."""

import dataclasses

import msgspec
import numpy as np
import pytest

import holdfast
from holdfast.contact import STABLE, ContactState
from holdfast.detection import Model, detect
from holdfast.errors import ModelError, TrainingError
from holdfast.recordings import Label, Recording, Tactile
from holdfast.training import calibrate, calibrate_with_report
from holdfast.training.calibration import (
    CALIBRATED_SUFFIX,
    HandlingFigures,
    activity,
)
from holdfast.training.own_handling import (
    MIN_SCALE,
    HandlingKey,
    OwnHandling,
    grasped_samples,
    location_and_scale,
)
from holdfast.training.thresholds import tune
from training.build import (
    PAD,
    handling_module,
    handling_recording,
    normalised_model,
)

CUP = dataclasses.replace(PAD, name="cup")
DATA = [handling_recording(k, held=12.0) for k in range(3)]
FRESH = handling_recording(77, held=12.0)


@pytest.fixture(scope="module")
def model():
    return normalised_model()


@pytest.fixture(scope="module")
def calibrated(model):
    return calibrate_with_report(model, DATA)


def handling_of(model, sensor="pad"):
    return model.fingers["*"].handling[sensor]


def stable_share(model, recording):
    shares = []
    for trace in detect(model, recording).fingers.values():
        held = grasped_samples(trace.times, trace.state)
        shares.append(np.mean(trace.state[held] == STABLE))
    return np.mean(shares)


def test_the_model_has_the_handling_of_its_sensor(model, calibrated):
    handling = handling_of(calibrated.model)
    assert list(calibrated.model.fingers["*"].handling) == ["pad"]
    assert handling.recordings == {recording.name: recording.digest for recording in DATA}
    assert min(handling.scale) >= MIN_SCALE
    assert handling.seconds == pytest.approx(38, abs=2)
    assert calibrated.model.name == f"builtin:any{CALIBRATED_SUFFIX}"
    assert calibrated.warnings == ()
    assert calibrate(model, DATA) == calibrated.model
    assert holdfast.calibrate is calibrate


def test_more_of_a_fresh_recording_is_stable(model, calibrated):
    before, after = (stable_share(m, FRESH) for m in (model, calibrated.model))
    assert before < 0.5 < 0.85 < after


def test_the_summary_says_what_was_seen(model, calibrated):
    (summary,) = calibrated.sensors
    assert summary.sensor == "pad"
    assert set(summary.fingers) == {"thumb", "index"}
    assert summary.seconds == max(summary.fingers.values())
    assert 0.1 < summary.load_change < 0.4
    assert 0 < summary.n_changed <= summary.n_features == 31
    assert summary.before.stable < 60 < 89 < summary.after.stable
    assert summary.before.threshold == model.fingers["*"].stable.threshold
    after = {"stable": summary.after.threshold, "slip": summary.after.slip_threshold}
    assert handling_of(calibrated.model).thresholds == after


def test_once_more_gives_the_same_model(calibrated):
    again = calibrate_with_report(calibrated.model, DATA)
    assert again.model.digest == calibrated.model.digest
    assert again.sensors[0].before == again.sensors[0].after == calibrated.sensors[0].after


def test_labels_have_no_part_in_it(model, calibrated):
    labelled = []
    for recording in DATA:
        modules = {
            name: Tactile(
                PAD, module.times, module.readings, labels=(Label(2.0, 9.0, ContactState.UNSTABLE),)
            )
            for name, module in recording.modules.items()
        }
        labelled.append(Recording(recording.name, modules))
    handling, usual = handling_of(calibrate(model, labelled)), handling_of(calibrated.model)
    assert (handling.location, handling.thresholds) == (usual.location, usual.thresholds)


def test_handling_of_several_sensors(model, calibrated):
    palm = handling_module(2, 12.0, sensor=CUP)
    hand = Recording("hand", {"thumb": handling_module(1, 12.0), "palm": palm})
    report = calibrate_with_report(model, [hand])
    assert {summary.sensor for summary in report.sensors} == {"pad", "cup"}
    both = calibrate(calibrated.model, [Recording("cup", {"palm": palm})])
    assert handling_of(both, "pad") == handling_of(calibrated.model, "pad")
    assert handling_of(both, "cup").recordings.keys() == {"cup"}
    assert both.name == calibrated.model.name


def test_a_sensor_that_holds_too_little_is_left_as_it_was(model):
    palm = handling_module(2, 12.0, sensor=CUP, force=0.0)
    hand = Recording("hand", {"thumb": handling_module(1, 12.0), "palm": palm})
    report = calibrate_with_report(model, [hand])
    assert list(report.model.fingers["*"].handling) == ["pad"]
    assert any(warning.startswith("cup: 0.0 s") for warning in report.warnings)


def test_each_finger_of_a_model_has_its_own(model):
    part = msgspec.structs.replace(model.fingers["*"], sensor="pad")
    hand = msgspec.structs.replace(
        model, fingers={"thumb": part, "index": part}, sensors={"pad": PAD}
    )
    report = calibrate_with_report(hand, DATA)
    assert [summary.sensor for summary in report.sensors] == ["thumb (pad)", "index (pad)"]
    thumb, index = (report.model.fingers[name].handling["pad"] for name in ("thumb", "index"))
    assert thumb.location != index.location


def test_it_warns_of_little_and_of_still_handling(model):
    report = calibrate_with_report(model, [handling_recording(0, held=12.0, sway=0.0)])
    assert len(report.warnings) == 2


def test_handling_that_the_steps_of_a_sensor_hide(model):
    """It shrinks no scale, and bounds the false alarms of slips by what shows of it alone."""
    steps = dataclasses.replace(
        PAD, name="steps", range=(-40.0, 40.0), step=1.0, rests_at_zero=True
    )
    own, stepped = OwnHandling(model), []
    for recording in DATA:
        modules = {
            name: Tactile(steps, module.times, np.rint(module.readings))
            for name, module in recording.modules.items()
        }
        stepped.append(Recording(recording.name, modules))
        own.add(stepped[-1])
    features = own.features(HandlingKey("*", "steps"))
    hidden = np.median((features == features.min(axis=0)).mean(axis=0))
    assert hidden > 0.5
    report = calibrate_with_report(model, stepped)
    scale = handling_of(report.model, "steps").scale
    seen, default = location_and_scale(features)[1], model.fingers["*"].default_handling[1]
    assert (seen < default).sum() > 10
    np.testing.assert_array_equal(scale, np.maximum(seen, default))
    (summary,), (whole,) = report.sensors, calibrate_with_report(model, DATA).sensors
    shown = summary.slips[0].minutes / whole.slips[0].minutes
    assert shown == pytest.approx(1 - hidden, rel=0.05)
    assert any("push harder" in warning for warning in report.warnings)


def test_false_alarms_are_those_of_slips(model, calibrated):
    report = calibrate_with_report(model, DATA, false_alarms=8.0)
    (summary,), (usual,) = report.sensors, calibrated.sensors
    assert summary.slips[0].threshold < usual.slips[0].threshold
    assert summary.after.threshold == usual.after.threshold
    assert handling_of(report.model).location == handling_of(calibrated.model).location


def test_handling_sets_the_threshold_of_slips(model, calibrated):
    (slips,) = calibrated.sensors[0].slips
    assert (model.reports_slips, calibrated.model.reports_slips) == (False, True)
    assert slips.n <= slips.minutes < slips.at_most * slips.minutes
    before, after = calibrated.sensors[0].before, calibrated.sensors[0].after
    assert before.false_slips_per_minute is None  # it reports none
    assert after.false_slips_per_minute == pytest.approx(slips.n / slips.minutes)
    part = calibrated.model.finger("thumb", PAD)
    assert part.slip.threshold == slips.threshold
    assert part.slip.rule == model.finger("thumb").slip.rule
    assert part.head("slip_changes").threshold == 1.0  # no handling began in contact


def test_handling_that_begins_in_contact_sets_the_other_head(model):
    cut = [dataclasses.replace(r.with_start(loaded=True)) for r in DATA]
    (slips,) = calibrate_with_report(model, cut).sensors[0].slips
    assert slips.head == ("slip_changes" if PAD.unit == "count" else "slip")


def test_activity_is_in_default_scales(model):
    part = model.fingers["*"]
    location, scale = part.default_handling
    rows = location + 0.7 * scale * np.ones((5, 1))
    rows[:, -1] = 1e6  # the load is no change
    assert activity(part, rows) == pytest.approx(0.7)


def test_most_of_it_slip_is_refused(model):
    slips = [handling_recording(k, held=12.0, slip=0.8) for k in range(3)]
    with pytest.raises(TrainingError, match="pad"):
        calibrate(model, slips)


def test_other_models_are_refused():
    with pytest.raises(ModelError, match="builtin:twin"):
        calibrate(Model.load("builtin:twin"), DATA)


def test_another_sensor_is_refused(model):
    part = msgspec.structs.replace(model.fingers["*"], sensor="cup")
    own = msgspec.structs.replace(model, fingers={"*": part}, sensors={"cup": CUP})
    with pytest.raises(ModelError, match="'cup'"):
        calibrate(own, DATA)


@pytest.mark.parametrize("wrong", [-1.0, 0.0, np.nan, np.inf])
def test_false_alarms_are_a_number(model, wrong):
    with pytest.raises(ValueError, match="false alarms"):
        calibrate(model, DATA, false_alarms=wrong)


def test_a_threshold_that_is_tuned_later_wins(calibrated):
    moved = calibrated.model.with_threshold("stable", 0.125).finger("*", PAD)
    assert moved.stable.threshold == 0.125
    assert moved.stable.rule.mean == handling_of(calibrated.model).location
    assert moved.slip == calibrated.model.finger("*", PAD).slip


def test_tuning_starts_from_the_threshold_of_the_sensor(calibrated):
    part = calibrated.model.fingers["*"]
    handling = msgspec.structs.replace(part.handling["pad"], thresholds={"stable": 0.0625})
    part = msgspec.structs.replace(part, handling={"pad": handling})
    own = msgspec.structs.replace(calibrated.model, fingers={"*": part})
    times = DATA[0].modules["thumb"].times
    label = Label(times[0] + 2.0, times[-1] - 2.0, ContactState.STABLE)
    module = DATA[0].modules["thumb"]
    labelled = Recording("held", {"thumb": Tactile(PAD, times, module.readings, labels=(label,))})
    tuned = tune(own, [labelled], false_alarms=100.0)
    assert tuned.before.threshold == 0.0625
    assert tuned.model.finger("*", PAD).stable.threshold == tuned.chosen.threshold


def still_recordings(seed=21):
    """White noise at rest: the force does not change, so no scale of motion is seen."""
    return [handling_recording(seed + k, held=12.0, sway=0.0) for k in range(3)]


def test_still_handling_does_not_shrink_the_scales(model):
    report = calibrate_with_report(model, still_recordings())
    part, handling = model.fingers["*"], handling_of(report.model)
    location, scale = part.default_handling
    assert np.median(np.log(np.divide(handling.scale, scale))) >= -1e-9
    assert np.all(np.array(handling.location) >= location)
    (summary,) = report.sensors
    assert summary.still
    assert summary.after.raised <= summary.before.raised
    with pytest.raises(TrainingError, match="pad"):
        report.check()


FIGURES = HandlingFigures(0.4, 95.0, 2.0, 0.1, 1.0)


@pytest.mark.parametrize(
    ("stable_before", "change", "worse"),
    [
        (95.0, {}, False),
        (95.0, {"stable": 94.6}, False),
        (95.0, {"stable": 94.4}, True),
        (95.0, {"raised": 1.4}, False),
        (95.0, {"raised": 1.6}, True),
        (95.0, {"alarms_per_minute": 3.0}, True),
        (95.0, {"alarms_per_minute": 3.0, "stable": 97.0}, False),
        (95.0, {"raised": None, "slip_threshold": None}, False),
        # More is STABLE than the threshold is chosen for: 95 %.
        (99.0, {"alarms_per_minute": 40.0}, False),
        (99.0, {"alarms_per_minute": 40.0, "stable": 94.4}, True),
        (99.0, {"raised": 1.6}, True),
    ],
)
def test_figures_that_are_worse(calibrated, stable_before, change, worse):
    before = msgspec.structs.replace(FIGURES, stable=stable_before)
    after = msgspec.structs.replace(FIGURES, **change)
    assert after.worse_than(before) is worse
    summary = msgspec.structs.replace(calibrated.sensors[0], before=before, after=after)
    report = dataclasses.replace(calibrated, sensors=(summary,))
    if not worse:
        report.check()
        return
    with pytest.raises(TrainingError, match="pad: worse"):
        report.check()
