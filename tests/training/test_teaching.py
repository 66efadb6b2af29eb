"""Teaching: a head of slips from few grasps of one hand, its threshold, and what is refused."""

from dataclasses import replace

import msgspec
import pytest

from holdfast import teach
from holdfast.contact import Cause, ContactState
from holdfast.detection import Model
from holdfast.detection.specs import SLIDING_FEATURES
from holdfast.errors import TrainingError
from holdfast.recordings import Label
from holdfast.training import evaluate, teach_with_report, teaching
from holdfast.training.teaching import taught_recording
from holdfast.training.verdict import slips_verdict

from .build import sliding_recording, tiny_recording

pytestmark = pytest.mark.slow

BASE = Model.load("builtin:any")


@pytest.fixture(scope="module")
def recordings():
    return [sliding_recording(seed) for seed in range(6)]


@pytest.fixture(scope="module")
def taught(recordings):
    return teach_with_report(BASE, recordings, false_alarms=3.0)


def test_a_part_of_another_recording_is_refused(recordings):
    part = replace(
        recordings[0],
        name="part",
        modules={"index": recordings[0].modules["index"].slice(0, 1000)},
        truth=None,
    )
    with pytest.raises(TrainingError, match="'slips-0' and 'part' share readings"):
        teach(BASE, [*recordings, part])


class TestModel:
    def test_it_finds_slips_of_the_hand_that_the_base_misses(self, taught):
        others = [sliding_recording(seed) for seed in range(20, 24)]
        base, own = (evaluate(model, others).slips.pooled for model in (BASE, taught.model))
        assert base.incipient["0.1"] < 10 < 90 < own.incipient["0.1"]

    def test_stability_and_cause_stay_those_of_the_base(self, taught):
        before, after = (model.finger("thumb") for model in (BASE, taught.model))
        assert after.stable == before.stable
        assert after.head("cause") == before.head("cause")
        assert after.head("slip_speed") is None
        assert {*after.slip.features} <= {*SLIDING_FEATURES}
        assert taught.model.name == "builtin:any, taught"

    def test_it_keeps_its_record_in_the_file(self, taught, tmp_path):
        taught.model.save(tmp_path / "mine.json")
        model = Model.load(tmp_path / "mine.json")
        choice = model.finger("index").slip.choice
        assert model.training.recordings.keys() == {f"slips-{seed}" for seed in range(6)}
        assert (choice.requested, choice.n) == (3.0, 48)
        assert choice.found == taught.slips.pooled.incipient["0.1"]
        assert model.finger("index").slip.threshold in [p.threshold for p in choice.points]

    def test_own_handling_of_the_base_goes_into_its_stability_alone(self, recordings):
        part = BASE.finger("thumb")
        location, scale = (tuple(values) for values in part.default_handling)
        handling = msgspec.structs.replace(
            part, handling={"tiny": _handling([x + 1 for x in location], scale)}
        )
        calibrated = msgspec.structs.replace(BASE, fingers={"*": handling})
        own = teach(calibrated, recordings, false_alarms=3.0).finger("thumb")
        assert own.stable == handling.for_sensor("tiny").stable
        assert not (own.normalised or own.handling)
        assert own.slip == teach(BASE, recordings, false_alarms=3.0).finger("thumb").slip


def _handling(location, scale):
    from holdfast.detection import Handling

    return Handling(location=tuple(location), scale=tuple(scale), seconds=30.0)


class TestFigures:
    def test_no_recording_is_scored_by_a_head_that_was_fitted_to_it(self, recordings):
        """The labels of one recording are turned round: a head that has seen them would agree."""
        turned = [_turned(recordings[0]), *recordings[1:]]
        report = teach_with_report(BASE, turned, false_alarms=3.0)
        straight = teach_with_report(BASE, recordings, false_alarms=3.0)
        assert report.slips.pooled.incipient["0.1"] < straight.slips.pooled.incipient["0.1"] - 5

    def test_the_verdict_is_that_of_evaluate(self, taught):
        assert taught.verdict == slips_verdict(taught.slips, 6)
        assert taught.hand_alarms >= taught.slips.pooled.false_alarms_per_minute["held"]

    def test_the_curve_has_the_threshold_of_each_rate_and_that_of_the_model(self, taught):
        wanted = [point.wanted for point in taught.curve]
        assert wanted == sorted({0.5, 1.0, 1.5, 3.0, 6.0} & {*wanted})
        thresholds = [point.threshold for point in taught.curve]
        assert thresholds == sorted(thresholds, reverse=True)
        chosen = taught.curve[wanted.index(3.0)]
        assert chosen.threshold == taught.model.finger("index").slip.threshold
        assert chosen.found == taught.slips.pooled.incipient["0.1"]
        assert chosen.hand_false_alarms == taught.hand_alarms

    def test_the_base_is_scored_on_the_same_slips(self, taught):
        assert taught.base.pooled.n == taught.slips.pooled.n == 48

    def test_few_slips_and_few_recordings_are_said(self, recordings):
        few = teach_with_report(BASE, recordings[:2], false_alarms=60.0)
        assert len(few.warnings) == 1

    def test_held_time_that_is_too_short_for_the_rate_is_said(self, recordings):
        short = teach_with_report(BASE, recordings[:2], false_alarms=0.3)
        (warning,) = short.warnings[1:]
        assert f"{short.slips.pooled.held_minutes:.2g} were seen" in warning
        assert "30 minutes of hold with pushes" in warning


def _turned(recording):
    """Return the recording whose slips are labelled where it holds still."""
    modules = {}
    for name, module in recording.modules.items():
        labels = tuple(
            replace(
                label,
                state=ContactState.UNSTABLE
                if label.state is ContactState.STABLE
                else (ContactState.STABLE if label.cause is Cause.SLIP else label.state),
                cause=Cause.SLIP if label.state is ContactState.STABLE else None,
                author="a person",
            )
            for label in module.labels
        )
        modules[name] = replace(module, labels=labels)
    return replace(recording, modules=modules)


def test_labels_of_a_person_count_instead_of_the_truth_of_a_simulation():
    recording = sliding_recording(0)
    modules = {
        name: replace(module, labels=tuple(replace(x, author="twin") for x in module.labels))
        for name, module in recording.modules.items()
    }
    simulated = replace(recording, modules=modules)
    assert taught_recording(simulated) is simulated
    labelled = replace(simulated, modules=modules | {"index": recording.modules["index"]})
    taught = taught_recording(labelled)
    assert taught.truth is None
    assert taught.modules["index"].labels == recording.modules["index"].labels
    assert taught.modules["thumb"].labels == ()  # no camera saw it


def _without_slips(recording):
    """Return the recording with stable labels where it slides, and without a truth."""
    modules = {
        name: replace(module, labels=(Label(2.0, 15.0, ContactState.STABLE),))
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules, truth=None)


REFUSED = {
    "no labels": (
        lambda: [replace(tiny_recording(k), modules={
            name: replace(module, labels=())
            for name, module in tiny_recording(k).modules.items()
        }) for k in range(2)],
        "0 slips in 0 of 2",
    ),
    "no slips": (
        lambda: [_without_slips(sliding_recording(k)) for k in range(3)],
        "0 slips in 0 of 3",
    ),
    "one recording": (
        lambda: [sliding_recording(0)],
        "8 slips in 1 of 1 .*holdfast label auto tracking",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    recordings, message = REFUSED[case]
    with pytest.raises(TrainingError, match=message):
        teach(BASE, recordings())


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
def test_a_rate_that_is_not_above_0_is_refused(rate, recordings):
    with pytest.raises(ValueError, match="false alarms"):
        teach(BASE, recordings, false_alarms=rate)


def test_no_threshold_is_quiet_enough(recordings, monkeypatch):
    monkeypatch.setattr(teaching, "choose_threshold", lambda *_, **__: None)
    with pytest.raises(TrainingError, match=r"0.01 false alarms"):
        teach(BASE, recordings, false_alarms=0.01)
