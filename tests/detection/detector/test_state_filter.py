"""The forward filter of the two states of a contact."""

import math

import numpy as np
import pytest
from msgspec.structs import replace

from holdfast.detection import ANY_FINGER, Debounce, Detector, FeatureSpec, Model, detect
from holdfast.detection.model_files import decode
from holdfast.errors import ModelError
from holdfast.synthetic import synthetic_recording
from holdfast.training.thresholds import ThresholdReplay

from .build import finger_model, linear, sensor

STAY_60 = -30 * math.log(0.6)
"""Rate of switching at which a state stays for 1/60 s with a probability of 0.8 [1/s]."""
MAX_DELAY = 0.015
UNIT = {"mean": np.zeros(1), "scale": np.ones(1), "weights": np.ones(1), "intercepts": 0.0}


def filtered(probabilities, times, threshold=0.5, switching=STAY_60):
    """Return the filtered probabilities, by a detector whose probability is that of F_x alone."""
    rate = 1 / (times[1] - times[0])
    which = sensor(1, "one", rate, (-1e4, 1e4), "N")
    part = finger_model((FeatureSpec("F_x"),), rule=linear(1, **UNIT), threshold=threshold)
    debounce = Debounce(switching=switching)
    made = Model(fingers={ANY_FINGER: part}, tare="none", window=2, rate=rate, debounce=debounce)
    detector = Detector(made, {"f": which}, rate)
    turn = which.rotations[0].T  # from the fingertip frame to that of the taxel
    detector.update({"f": [turn @ (0, 1, 0)]}, times[0] - 1 / rate)  # the window has two samples
    bounded = np.clip(probabilities, 1e-12, 1 - 1e-12)
    logits = np.log(bounded / (1 - bounded))
    return np.array([
        detector.update({"f": [turn @ (z, k % 7, 0)]}, time).fingers["f"].stable_probability
        for k, (z, time) in enumerate(zip(logits, times, strict=True))
    ])  # fmt: skip


def naive(probabilities, stay):
    """The forward algorithm, with the odds of each sample as its likelihood ratio."""
    found, before = [], None
    for p in probabilities:
        prior = 0.5 if before is None else stay * before + (1 - stay) * (1 - before)
        before = prior * p / (prior * p + (1 - prior) * (1 - p))
        found.append(before)
    return np.array(found)


def test_at_60_hz_it_is_the_forward_algorithm():
    probabilities = np.random.default_rng(0).uniform(0.02, 0.98, 200)
    times = np.arange(200) / 60
    assert Debounce(switching=STAY_60).stay(1 / 60) == pytest.approx(0.8)
    expected = naive(probabilities, 0.8)
    np.testing.assert_allclose(filtered(probabilities, times), expected, rtol=1e-9)


@pytest.mark.parametrize("rate", [60.0, 150.0, 500.0, 1000.0])
@pytest.mark.parametrize("end", [0.001, 0.05])
def test_a_clear_change_is_reported_within_15_ms(rate, end):
    times = np.arange(0, 2, 1 / rate)
    probabilities = np.where(times < 1 - 1e-9, 0.98, end)
    after = times[(filtered(probabilities, times) < 0.5) & (times >= 1 - 1e-9)]
    assert after[0] - 1.0 <= MAX_DELAY


def test_old_models_keep_their_bytes():
    model = Model.load("builtin:twin")
    assert b"switching" not in model.encoded()
    assert model.debounce.switching_rate == 0.0
    steady = replace(model, debounce=Debounce(hold=0.1, switching=15.3))
    assert decode(steady.encoded(), Model) == steady


@pytest.mark.parametrize("value", [-1.0, math.inf, math.nan])
def test_a_wrong_rate_is_refused(value):
    with pytest.raises(ModelError, match="switching"):
        Debounce(switching=value)


@pytest.fixture(scope="module")
def steady():
    model = Model.load("builtin:noise-floor")
    return replace(model, debounce=Debounce(hold=0.05, switching=STAY_60))


def test_the_detector_filters_the_probability_of_a_contact(steady):
    recording = synthetic_recording("grasp", 0, ("index",))
    raw = detect(replace(steady, debounce=Debounce()), recording).fingers["index"]
    trace = detect(steady, recording).fingers["index"]
    held = np.flatnonzero(raw.state >= 2)
    first = held[0]
    run = first + np.arange(int(np.argmax(np.append(np.diff(held) > 1, True))) + 1)
    expected = filtered(raw.stable_probability[run], raw.times[run])
    np.testing.assert_allclose(trace.stable_probability[run], expected, rtol=1e-9)


@pytest.mark.parametrize("threshold", [0.3, 0.5, 0.8])
def test_tuning_replays_it(steady, threshold):
    recording = synthetic_recording("grasp", 2, ("index",))
    replayed = ThresholdReplay.of(steady, recording).hand(threshold)
    trace = detect(steady.with_threshold("stable", threshold), recording)
    np.testing.assert_array_equal(replayed.states, trace.hand)
