from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, ContactState
from holdfast.detection import Model
from holdfast.errors import TrainingError
from holdfast.metrics import FingerDecisions
from holdfast.recordings import Label
from holdfast.synthetic import synthetic_recording
from holdfast.training import Setting, compute_decisions, train
from holdfast_lab.study.comparison import real_models
from holdfast_lab.study.comparison.real_models import SHIPPED, model_estimates
from holdfast_lab.study.plan import scan_corpus
from study.example_recordings import save_all

pytestmark = pytest.mark.slow

FINGERS = ("finger1", "finger2")


def part(seed, *, stable_only=False):
    """Three seconds around the shaking, without the object's name."""
    made = synthetic_recording(f"r{seed}", seed, FINGERS)
    stable = [Label(4.0, 5.3, ContactState.STABLE)]
    modules = {
        name: module.slice(600, 1050) if not stable_only
        else replace(module.slice(600, 1050), labels=stable)
        for name, module in made.modules.items()
    }  # fmt: skip
    return replace(made, modules=modules, metadata={})


@pytest.fixture(scope="module")
def recordings():
    return [part(0), part(1), part(2, stable_only=True)]


@pytest.fixture(scope="module")
def corpus(recordings, tmp_path_factory):
    folder = save_all(tmp_path_factory.mktemp("real") / "real", recordings)
    return scan_corpus("real", folder, tare="first")


def same(estimates, model, recording):
    decided = compute_decisions(model, recording)
    for name, finger in decided.fingers.items():
        own = estimates.fingers[name]
        np.testing.assert_array_equal(own.states.array, finger.states)
        np.testing.assert_array_equal(own.probability.array, finger.stable_probability)
    np.testing.assert_array_equal(estimates.hand.states.array, decided.hand.states)
    np.testing.assert_array_equal(estimates.alarm_states.array, decided.hand.states)


def test_untouched_is_what_the_detector_gives(corpus, recordings):
    for each, recording in zip(model_estimates("untouched", corpus, 0), recordings, strict=True):
        same(each, Model.load(SHIPPED), recording)


def test_adapted_to_all_others_is_what_train_gives(corpus, recordings):
    found = model_estimates("adapted to all", corpus, 0)
    setting = Setting.adapting(Model.load(SHIPPED))
    for index, recording in enumerate(recordings):
        others = [each for k, each in enumerate(recordings) if k != index]
        same(found[index], train(others, setting).model, recording)


def test_where_others_cannot_train_the_model_stays_as_it_ships(corpus, monkeypatch):
    def fail(*_):
        raise TrainingError("one class only")

    untouched = model_estimates("untouched", corpus, 0)
    monkeypatch.setattr(real_models, "train", fail)
    assert model_estimates("adapted to all", corpus, 0) == untouched
    assert model_estimates("adapted to one", corpus, 0) == untouched
    for each in model_estimates("from nothing", corpus, 0):
        assert not each.known.array.any()
        assert np.isnan(each.fingers["finger1"].probability.array).all()


class TestHand:
    TIMES = np.arange(4) * 0.01

    def finger(self, states, probability):
        return FingerDecisions(self.TIMES, np.zeros(4), states, probability)

    def test_the_score_is_the_smallest_of_the_touching_fingers(self):
        fingers = [
            self.finger([STABLE, STABLE, NO_CONTACT, UNKNOWN], [0.9, 0.8, 0.2, np.nan]),
            self.finger([STABLE, UNSTABLE, STABLE, STABLE], [0.7, 0.1, 0.6, 0.5]),
            self.finger([STABLE, STABLE, STABLE, STABLE], [0.8, 0.8, 0.8, 0.8]),
        ]
        assert real_models.smallest_probability(fingers).tolist() == [0.7, 0.1, 0.6, 0.5]

    def test_a_decision_lasts_until_the_next(self):
        decided = FingerDecisions([0.01, 0.03], [0, 0], [STABLE, UNSTABLE], [0.9, 0.1])
        latest = real_models.latest_decisions(decided, np.array([0.0, 0.01, 0.02, 0.03, 0.04]))
        assert latest.states.tolist() == [UNKNOWN, STABLE, STABLE, UNSTABLE, UNSTABLE]
        assert latest.stable_probability.tolist()[1:] == [0.9, 0.9, 0.1, 0.1]
