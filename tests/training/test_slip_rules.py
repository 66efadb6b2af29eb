"""Slip rules: their training, the choice of their threshold, and what is refused."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from detection.detector.build import z_of
from holdfast.contact import ContactState
from holdfast.detection import Model, parse_features
from holdfast.errors import ModelError, TrainingError
from holdfast.metrics import summarise
from holdfast.metrics.slip_curves import MAX_RAISED_QUIET, slip_curve
from holdfast.metrics.slip_truth import NOT_HELD, STILL, SlipDecisions, SlipTruth
from holdfast.training import Setting, compute_decisions, train
from holdfast.training.classifiers.fitting import Samples
from holdfast.training.classifiers.logreg import LogisticRegression
from holdfast.training.evaluation import combine_decisions
from holdfast.training.head_fits import (
    MIN_SLIDING_SAMPLES,
    SLIP_HOLD_TIME,
    SLIP_SMOOTHING,
    fit_slip,
)
from holdfast.training.targets import TargetSamples
from holdfast.training.thresholds import (
    SLIP_FALSE_ALARMS,
    choose_slip_threshold,
    tune,
)

from .build import sliding_recording, tiny_recording

pytestmark = pytest.mark.slow

FEATURES = parse_features("F_a,F_x,F_y,F_z,sigma", 6)
SETTING = Setting(window=6, features=FEATURES, trials=0, shared=True)


@pytest.fixture(scope="module")
def trained(recordings):
    warnings = []
    return train(recordings, SETTING, warn=warnings.append), warnings


@pytest.fixture(scope="module")
def model(trained):
    return trained[0].model


@pytest.fixture(scope="module")
def others():
    return [sliding_recording(seed) for seed in range(20, 26)]


def rule_of(model):
    (part,) = model.fingers.values()
    return part.slip


def slips_of(model, recordings):
    return summarise([compute_decisions(model, made) for made in recordings]).slips.pooled


class TestTraining:
    def test_the_rule_finds_slips_of_other_recordings(self, trained, others):
        model, warnings = trained[0].model, trained[1]
        rule = rule_of(model)
        assert (rule.smoothing, rule.hold) == (SLIP_SMOOTHING, SLIP_HOLD_TIME)
        metrics = slips_of(model, others)
        assert metrics.n == 6 * 2 * 4
        assert metrics.incipient["0.1"] > 50
        assert metrics.auc > 0.8
        assert not [text for text in warnings if "slip" in text]

    def test_the_threshold_of_the_record_holds_out_of_fold(self, trained):
        metrics = trained[0].cross_validation.slips
        record = rule_of(trained[0].model).choice
        assert record.requested == SLIP_FALSE_ALARMS
        assert record.false_alarms_per_minute <= SLIP_FALSE_ALARMS
        assert record.n == metrics.pooled.n == 6 * 2 * 4
        assert record.minutes == pytest.approx(metrics.pooled.held_minutes)
        assert record.recordings == {}
        assert metrics.threshold_chosen
        low, high = metrics.intervals.false_alarms_per_minute["held"]
        assert low <= metrics.pooled.false_alarms_per_minute["held"] <= high

    def test_samples_left_out_have_no_decision_and_no_truth(self, model, others):
        judged = compute_decisions(model, others[0])
        half = len(judged.fingers["thumb"].times) // 2
        combined = combine_decisions([judged] * 2, lambda n: (np.arange(n) >= half) - 1, 2)
        for name, finger in combined.fingers.items():
            before, after = judged.fingers[name].slip, finger.slip
            assert np.isnan(after.probability[:half]).all()
            assert not after.raised[:half].any()
            assert (after.truth.codes[:half] == NOT_HELD).all()
            assert (after.truth.codes[half:] == before.truth.codes[half:]).all()
            late = [item for item in before.truth.slips if item.onset >= finger.times[half]]
            assert list(after.truth.slips) == late

    def test_every_finger_has_its_own_rule(self, recordings):
        separate = train(recordings, replace(SETTING, shared=False)).model
        rules = {name: part.slip for name, part in separate.fingers.items()}
        assert set(rules) == {"thumb", "index"}
        assert rules["thumb"].rule.weights != rules["index"].rule.weights
        assert rules["thumb"].threshold == rules["index"].threshold
        assert rules["thumb"].choice == rules["index"].choice

    def test_a_rule_with_squares_is_the_logistic_regression_of_features_and_squares(self):
        rng = np.random.default_rng(0)
        features = 3.0 + 2.0 * rng.normal(size=(4000, 2))
        features[0, 1] = 40.0  # more than five standard deviations
        slides = rng.random(4000) < 1 / (1 + np.exp(3 - np.abs(features[:, 0] - 3.0)))
        zeros = np.zeros(4000, dtype=np.int64)
        samples = TargetSamples(features, slides, zeros, zeros, 4000)
        head = fit_slip(samples, (), FEATURES[:2], is_any=False, squares=True)
        deviation = (features - features.mean(axis=0)) / features.std(axis=0)
        squares = np.minimum(np.abs(deviation), 5.0) ** 2
        rows = Samples(np.hstack([deviation, squares]), slides, np.zeros(4000, dtype=np.int64))
        expected = LogisticRegression().fit(rows, {"C": 1.0, "class_weight": None}, 0).rule
        found = z_of(head.rule, features)
        expected_odds = expected.slope * expected.decision(rows.features) + expected.offset
        np.testing.assert_allclose(found, expected_odds, atol=1e-9)
        assert head.rule.squares[0][0] > 0.3  # it slides on either side of the mean
        assert (head.name, head.features) == ("slip", FEATURES[:2])
        assert head.threshold == 0.5

    def test_without_a_list_the_rule_has_the_features_of_the_classifier(self, model):
        assert rule_of(model).features == FEATURES
        assert rule_of(model).rule.squares == ()

    def test_slips_may_come_from_labels(self, recordings):
        labelled = [replace(made, truth=None) for made in recordings]
        found = train(labelled, SETTING)
        assert rule_of(found.model) is not None
        assert found.cross_validation.slips.pooled.onsets == "labels"


class TestNoRule:
    def test_without_slips(self, grasps):
        warnings = []
        found = train(grasps, SETTING, warn=warnings.append)
        assert rule_of(found.model) is None
        assert found.cross_validation.slips is None
        assert found.model.training.sliding_samples is msgspec.UNSET
        assert not [text for text in warnings if "slip" in text]

    def test_with_too_few_sliding_samples_it_warns_once(self):
        few = [sliding_recording(0, ("thumb",), slips=(400,))]
        few += [sliding_recording(seed, ("thumb",), slips=()) for seed in (1, 2)]
        few = [made.with_labels(labels_of(tiny_recording(9, ("thumb",)))) for made in few]
        warnings = []
        found = train(few, SETTING, warn=warnings.append)
        assert rule_of(found.model) is None
        (text,) = [text for text in warnings if "slip" in text]
        assert f"10 samples that slide and {3 * 1300 - 40}" in text
        assert f"at least {MIN_SLIDING_SAMPLES}" in text

    @pytest.mark.parametrize("code", [STILL, NOT_HELD])
    def test_with_too_little_held_time(self, code):
        times, codes = np.arange(3000) / 100, np.full(3000, code, dtype=np.int8)
        truth = SlipTruth(codes, codes == STILL, (), "truth")
        never = SlipDecisions(times, np.full(3000, 1e-9), codes > STILL, 0.0, truth)
        chosen = choose_slip_threshold([{"thumb": slip_curve(never)}], [0], 0)
        minutes = "0.5" if code == STILL else "0"
        assert chosen.point is None
        assert chosen.reason.startswith(f"{minutes} min of held time given; ")
        assert "need at least 1 min" in chosen.reason
        assert not chosen.metrics.threshold_chosen

    def test_an_adapted_model_without_a_rule_gets_none(self, grasps, recordings):
        plain = train(grasps, SETTING).model
        adapted = train(recordings, Setting.adapting(plain, trials=0)).model
        assert all(part.slip is None for part in adapted.fingers.values())


def labels_of(recording):
    return {name: module.labels for name, module in recording.modules.items()}


class TestTuning:
    @pytest.mark.parametrize("rate", [1.0, 20.0])
    def test_the_detector_keeps_to_the_rate(self, model, others, rate):
        tuned = tune(model, others, rate, "slip")
        metrics = slips_of(tuned.model, others)
        assert metrics.false_alarms_per_minute["held"] <= rate
        assert metrics.raised_quiet <= MAX_RAISED_QUIET
        assert metrics == tuned.chosen.slips
        assert slips_of(model, others) == tuned.before.slips

    def test_a_model_without_a_rule(self, others):
        with pytest.raises(ModelError, match="slip rule"):
            tune(Model.load("builtin:noise-floor"), others, 1.0, "slip")

    def test_recordings_without_labels_or_truth(self, model):
        bare = tiny_recording(1, states=(None,) * 4)
        with pytest.raises(TrainingError, match="slips"):
            tune(model, [bare], 1.0, "slip")

    def test_labels_without_slips_have_false_alarms_only(self, model):
        quiet = tiny_recording(1, states=(ContactState.NO_CONTACT, *[ContactState.STABLE] * 3))
        tuned = tune(model, [quiet], 60.0, "slip")
        assert tuned.chosen.slips.n == 0
        assert rule_of(tuned.model).choice.found is None

    def test_a_held_time_that_is_too_short(self, model, others):
        with pytest.raises(TrainingError, match=r"0.28 min"):
            tune(model, others[:1], 1.0, "slip")
