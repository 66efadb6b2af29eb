"""How far a model is adapted: chosen by folds, in doubt not at all."""

import msgspec
import numpy as np
import pytest

from holdfast.detection import Linear
from holdfast.training.adaptation import choose_adaptation, choose_nearest
from holdfast.training.classifiers import Samples
from holdfast.training.classifiers.logreg import CALIBRATION, NONE, WEIGHTS
from holdfast.training.finger_samples import FingerSamples

RIGHT = Linear((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), ((2.0, -1.0, 0.0),), (0.5,))


def hand(n_recordings, rule=RIGHT, *, seed=0, n=400):
    """Samples of recordings of a hand for which `rule` is true."""
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(n_recordings * n, 3))
    stable = rng.random(len(features)) < rule.probability(features)
    recordings = np.repeat(np.arange(n_recordings), n)
    times = np.tile(np.arange(n) * 0.05, n_recordings)
    samples = Samples(features, stable, recordings)
    return FingerSamples(None, samples, recordings, recordings, times, np.zeros((1, 3)))


def chosen(own, prior=RIGHT, held=()):
    return choose_adaptation(own, prior, held).parameters["change"]


@pytest.mark.parametrize("n_recordings", [1, 2, 8])
def test_a_model_that_is_right_is_kept(n_recordings):
    kept = [chosen(hand(n_recordings, seed=seed)) for seed in range(5)]
    assert kept.count(NONE) >= 3


def test_a_model_whose_calibration_is_off_is_calibrated():
    off = msgspec.structs.replace(RIGHT, offset=-1.5, slope=0.5)
    for n_recordings in (1, 2):
        assert chosen(hand(n_recordings), off) != NONE
    assert chosen(hand(2, n=40), off) == CALIBRATION


def test_with_enough_recordings_wrong_weights_are_replaced():
    wrong = msgspec.structs.replace(RIGHT, weights=((0.2, 1.0, 1.0),))
    found = choose_adaptation(hand(8), wrong)
    assert found.parameters["change"] == WEIGHTS
    assert found.parameters["C"] >= 1e-3
    assert found.loss_after < found.loss_before - 0.1


def test_held_out_units_have_no_influence():
    own = hand(4)
    noise = np.random.default_rng(1).random(400) < 0.5
    other = own.samples._replace(positive=np.concatenate([own.samples.positive[:-400], noise]))
    changed = FingerSamples(None, other, own.units, own.recordings, own.times, own.at_rest)
    assert choose_adaptation(own, RIGHT, {3}) == choose_adaptation(changed, RIGHT, {3})
    assert choose_adaptation(own, RIGHT) != choose_adaptation(changed, RIGHT)


def test_one_class_in_a_fold_keeps_the_model():
    own = hand(2)
    stable = own.recordings == 0
    alone = FingerSamples(
        None,
        own.samples._replace(positive=stable),
        own.units,
        own.recordings,
        own.times,
        own.at_rest,
    )
    assert chosen(alone) == NONE


@pytest.mark.parametrize(
    ("losses", "row"),
    [
        ([[1.0, 1.0, 1.0], [0.5, 0.5, 0.5]], 1),
        ([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]], 0),
        ([[1.0, 1.0, 1.0], [0.0, 1.6, 1.1]], 0),
        ([[1.0], [0.5]], 0),
    ],
)
def test_the_nearest_within_one_standard_error(losses, row):
    assert choose_nearest(np.array(losses)) == row
