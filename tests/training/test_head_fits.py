"""Fits of heads: the speed of a slip, and models with it."""

from dataclasses import replace

import numpy as np
import pytest

from detection.detector.build import z_of
from holdfast.detection import detect, parse_features
from holdfast.detection.specs import SLIP_FEATURES
from holdfast.training import Setting, train
from holdfast.training.head_fits import MIN_SPEED_SAMPLES, fit_speed
from holdfast.training.targets import TargetSamples, true_speed

from .build import sliding_recording

SETTING = Setting(
    window=6, features=parse_features("F_a,F_x,F_y,F_z,sigma", 6), trials=0, shared=True,
    own_slip_features=True,
)  # fmt: skip


def speeds_of(rule, highest, features):
    return np.minimum(np.maximum(z_of(rule, features), 0.0) ** 2, highest)


@pytest.fixture(scope="module")
def samples():
    """Speed is the square of 2 + u_0 + 0.5 u_1^2; one in five samples holds still."""
    rng = np.random.default_rng(0)
    features = rng.normal(size=(4000, 2))
    speed = np.maximum(2.0 + features[:, 0] + 0.5 * features[:, 1] ** 2, 0.01) ** 2
    still = np.zeros((800, 2)) + [-2.0, 0.0] + 0.01 * rng.normal(size=(800, 2))
    units = np.arange(4800) % 4
    speed = np.concatenate([speed, np.zeros(800)])
    return TargetSamples(np.vstack([features, still]), speed, units, units, 4800)


FEATURES = parse_features("F_x,F_y", 6)


def fit(samples, held):
    head = fit_speed(samples, held, FEATURES)
    return None if head is None else (head.rule, head.highest)


class TestFit:
    def test_it_finds_the_speed(self, samples):
        rule, highest = fit(samples, ())
        slides = samples.values > 0
        error = np.abs(speeds_of(rule, highest, samples.features) - samples.values)
        assert error[slides].mean() < 0.1
        assert error[~slides].max() < 0.1
        assert highest == samples.values.max()

    def test_mean_and_scale_are_those_of_the_samples_that_slide(self, samples):
        (rule, _), features = fit(samples, ()), samples.features[samples.values > 0]
        np.testing.assert_allclose(rule.mean, features.mean(axis=0))
        np.testing.assert_allclose(rule.scale, features.std(axis=0))

    def test_held_units_are_left_out(self, samples):
        strange = replace(samples, values=np.where(samples.units == 1, 50.0, samples.values))
        assert fit(strange, {1}) == fit(samples, {1})
        assert fit(strange, ()) != fit(samples, ())

    def test_too_few_samples_that_slide(self, samples):
        indices = np.flatnonzero(samples.values > 0)[: MIN_SPEED_SAMPLES - 1]
        rows = np.concatenate([indices, np.flatnonzero(samples.values == 0)])
        columns = (samples.features, samples.values, samples.units, samples.units)
        few = TargetSamples(*(column[rows] for column in columns), len(rows))
        assert few.n_positive == MIN_SPEED_SAMPLES - 1
        assert fit(few, ()) is None


@pytest.fixture(scope="module")
def trained(recordings):
    warnings = []
    return train(recordings, SETTING, warn=warnings.append), warnings


@pytest.mark.slow
class TestTrain:
    def test_the_slip_rule_has_features_of_its_own(self, trained):
        model, warnings = trained[0].model, trained[1]
        part = model.fingers["*"]
        assert part.stable.features == SETTING.features
        expected = tuple(spec for spec in SLIP_FEATURES if spec.min_taxels < 2)
        assert part.slip.features == expected
        assert len(part.slip.rule.squares[0]) == len(expected)
        (text,) = [text for text in warnings if "taxel" in text]
        assert text.startswith("centre_shift, divergence, relative_divergence, fast_own")
        assert trained[0].cross_validation.slips.pooled.incipient["0.1"] > 50

    def test_the_speed_is_that_of_the_truth(self, trained):
        model, made = trained[0].model, sliding_recording(20)
        for name, trace in detect(model, made).fingers.items():
            true = true_speed(made, name, trace.times)
            both = (true > 0) & (trace.slip_speed > 0)
            assert both.sum() > 50
            assert np.abs(trace.slip_speed - true)[both].mean() < 3  # of 10 mm/s

    def test_labels_give_no_speed(self, recordings):
        labelled = [replace(made, truth=None) for made in recordings]
        part = train(labelled, SETTING).model.fingers["*"]
        assert part.slip.features != part.stable.features
        assert part.slip.rule.squares
        assert part.head("slip_speed") is None

    def test_without_features_of_its_own_there_is_no_speed(self, recordings):
        plain = train(recordings, replace(SETTING, own_slip_features=False)).model
        part = plain.fingers["*"]
        assert part.slip.features == part.stable.features
        assert part.head("slip_speed") is None
