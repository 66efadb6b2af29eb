"""Training as a whole: held-out data, results and errors."""

from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import STABLE, UNSTABLE, ContactState
from holdfast.detection import Linear, Tare, parse_features
from holdfast.errors import TrainingError
from holdfast.metrics import summarise
from holdfast.recordings import Recording
from holdfast.training import Setting, compute_decisions, train, trainer
from holdfast.training.classifiers import recipe
from holdfast.training.classifiers.fitting import Fitted
from holdfast.training.dataset_scan import scan_dataset
from holdfast.training.model_fit import fit_model
from holdfast.training.splits import split_data

from .build import TINY, tiny_module, tiny_recording

pytestmark = pytest.mark.slow

SETTING = Setting(window=6, features=parse_features("F_a,F_x,sigma", 6), trials=0)
GRID = replace(SETTING, trials=None)
ONE_CLASS = (ContactState.NO_CONTACT, None, ContactState.UNSTABLE, None)


def by_name(metrics):
    return {each.name: each for each in metrics.recordings}


# --- honesty ---------------------------------------------------------------------------------


def fitted_by(recordings, setting, monkeypatch, **options):
    """The groups that each fit of the figures was given, with what was held out."""
    seen = []

    def spy(data, given, parameters, held):
        designs = data.fingers.values()
        seen.extend((set(held), set(each.without(held).groups.tolist())) for each in designs)
        return fit_model(data, given, parameters, held)

    monkeypatch.setattr(trainer, "fit_model", spy)
    train(recordings, setting, **options)
    return seen


@pytest.mark.parametrize("split", ["recording", "object"])
def test_no_model_is_evaluated_on_its_training_samples(grasps, split, monkeypatch):
    setting = replace(GRID, split=split)
    data_split = split_data(scan_dataset(grasps).recordings, split, 0)
    found = fitted_by(grasps, setting, monkeypatch)
    every = set(range(len(data_split.units)))
    assert [held for held, _ in found[::2]] == [{unit} for unit in sorted(every)]
    for held, groups in found:
        assert groups == every - held


@pytest.mark.parametrize("split", ["recording", "object"])
def test_no_choice_uses_the_units_that_are_evaluated(grasps, split, monkeypatch):
    """Parameters of a unit's model come from a choice without that unit."""
    chosen, evaluated = {}, {}

    def spy_choose(samples, folds, recipe, seed):
        token = float(len(chosen) + 1)
        chosen[token] = set(samples.groups.tolist())
        return {"C": token, "class_weight": None}

    def spy_fit(data, setting, parameters, held):
        evaluated[min(held)] = [given["C"] for given in parameters.values()]
        return fit_model(data, setting, parameters, held)

    monkeypatch.setattr(trainer, "choose_parameters", spy_choose)
    monkeypatch.setattr(trainer, "fit_model", spy_fit)
    train(grasps, replace(GRID, split=split))
    n_units = 6 if split == "recording" else 3
    n_choices = min(5, n_units)
    assert len(chosen) == 2 * (1 + n_choices)  # two fingers, and once for the model itself
    assert set(evaluated) == set(range(n_units))
    for unit, tokens in evaluated.items():
        for token in tokens:
            assert unit not in chosen[token]


def test_cross_validation_equals_separate_trainings(grasps):
    """Each recording is evaluated by a model that is trained on the others alone."""
    trained = train(grasps, SETTING)
    evaluated = []
    for index, recording in enumerate(grasps):
        others = [other for k, other in enumerate(grasps) if k != index]
        evaluated.append(compute_decisions(train(others, SETTING).model, recording))
    expected = summarise(evaluated)
    assert trained.cross_validation.pooled.confusion == expected.pooled.confusion
    assert trained.cross_validation.pooled.auc == pytest.approx(expected.pooled.auc)
    assert trained.cross_validation.events == expected.events


def test_a_random_sample_is_evaluated_by_the_model_without_it(grasps, monkeypatch):
    """The classifier of every fold has another constant probability."""
    calls = []

    class Marked:
        name, reference = "logreg", recipe("logreg").reference

        def fit(self, samples, parameters, seed):
            fit = recipe("logreg").fit(samples, parameters, seed)
            calls.append(len(samples.positive))
            number = len(calls) - 1  # two fingers of the whole, then two of each fold
            rule = Linear.of(*fit.rule.moments, np.zeros(3), 0.1 * number)
            return Fitted(rule, 0.5)

    monkeypatch.setattr(Setting, "recipe_of", lambda self, finger: Marked())
    given_decisions = []
    score = trainer.score_recording

    def keep(decisions, **options):
        given_decisions.append(decisions)
        return score(decisions, **options)

    monkeypatch.setattr(trainer, "score_recording", keep)
    train(grasps, replace(SETTING, split="random"))
    for index, decisions in enumerate(given_decisions):
        units = split_data(scan_dataset(grasps).recordings, "random", 0).units_of(index, 400)
        for k, finger in enumerate(decisions.fingers.values()):
            number = 2 + 2 * units + k
            expected = 1 / (1 + np.exp(-0.1 * number))
            known = np.isin(finger.states, (STABLE, UNSTABLE))
            assert known.sum() > 250
            np.testing.assert_allclose(finger.stable_probability[known], expected[known])
    assert [n / calls[0] for n in calls[2:]] == pytest.approx([0.8] * 10, abs=0.04)


# --- what comes out --------------------------------------------------------------------------


def test_the_model_has_its_provenance(grasps):
    trained = train(grasps, GRID)
    provenance = trained.model.training
    assert provenance.recordings == {each.name: each.readings_digest for each in grasps}
    assert (provenance.split, provenance.seed) == ("recording", 0)
    assert set(provenance.parameters) == {"thumb", "index"}
    assert provenance.figures["auc"] == trained.cross_validation.pooled.auc
    assert set(provenance.versions) == {"holdfast-tactile", "numpy", "scikit-learn"}
    assert trained.model.rate == pytest.approx(100.0)
    assert trained.model.sensors == {"tiny": TINY}


def test_the_same_seed_gives_the_same_model(grasps):
    given = grasps[:3]
    assert train(given, GRID) == train(given, GRID)


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        ({"contact_threshold": 7.5}, 7.5),
        ({"contact_threshold": 7.5, "tare": Tare.parse("first")}, 7.5),
        ({"contact_threshold": 0.0}, 0.0),
        ({"tare": Tare.parse("first")}, None),
        ({"tare": Tare.parse("none")}, None),
    ],
)
def test_the_contact_threshold_of_the_model(grasps, asked, found):
    model = train(grasps, replace(SETTING, **asked)).model
    assert {finger.contact_threshold for finger in model.fingers.values()} == {found}


def test_the_contact_threshold_of_a_fold_leaves_out_its_recordings(grasps):
    """One recording's tare stretch is far noisier; only its own fold may ignore that."""
    module = grasps[0].modules["thumb"]
    loud = module.readings.copy()
    loud[:50] += np.random.default_rng(0).normal(0, 500, size=(50, 1, 3))
    noisy = Recording("loud", {"thumb": replace(module, readings=loud)})
    calm = [tiny_recording(seed, ("thumb",)) for seed in range(1, 4)]
    found = scan_dataset([noisy, *calm])
    data_split = split_data(found.recordings, "recording", 0)
    plan = trainer.SamplesPlan(found, SETTING, data_split)
    data = trainer.TrainingData(found, data_split, trainer.gather_samples([noisy, *calm], plan))
    parameters = {"thumb": recipe("logreg").reference}
    thresholds = [
        fit_model(data, SETTING, parameters, {unit}).fingers["thumb"].contact_threshold
        for unit in range(4)
    ]
    assert thresholds[0] < 100 < min(thresholds[1:])


# --- what is missing -------------------------------------------------------------------------


def test_fewer_than_two_usable_folds_give_the_reference_setting_and_a_warning():
    warnings = []
    given = [tiny_recording(seed, ("thumb",)) for seed in range(2)]
    trained = train(given, GRID, warn=warnings.append)
    # Two recordings make two folds for the model itself, but one for each of the figures.
    assert len(warnings) == 1 and warnings[0].startswith("thumb: 0 of the folds")
    assert trained.cross_validation.pooled.n == 2 * 345


def test_a_finger_of_one_recording_is_trained_but_not_evaluated(grasps):
    warnings = []
    given = [*grasps[:3], tiny_recording(22, fingers=("thumb", "ring"))]
    trained = train(given, SETTING, warn=warnings.append)
    assert len(warnings) == 1 and "ring" in warnings[0] and "grasp-22" in warnings[0]
    assert set(trained.model.fingers) == {"thumb", "index", "ring"}
    assert set(by_name(trained.cross_validation)["grasp-22"].fingers) == {"thumb"}


def test_a_recording_whose_finger_no_other_recording_has(grasps):
    given = [*grasps[:3], tiny_recording(23, fingers=("ring",))]
    trained = train(given, SETTING, warn=lambda _: None)
    assert by_name(trained.cross_validation)["grasp-23"].fingers == {}


def test_a_recording_without_labels_is_not_evaluated(grasps):
    bare = tiny_recording(24, fingers=("palm/1",), states=[None] * 4)
    trained = train([*grasps[:3], bare], SETTING)
    assert by_name(trained.cross_validation)["grasp-24"].fingers == {}


def test_recordings_with_one_class_help_those_with_both(grasps):
    given = [*grasps[:2], tiny_recording(25, states=ONE_CLASS)]
    metrics = train(given, SETTING).cross_validation
    assert by_name(metrics)["grasp-25"].fingers["thumb"].auc is None
    assert metrics.pooled.auc is not None


@pytest.mark.parametrize(
    ("given", "split", "message"),
    [
        (
            [tiny_recording(seed, states=ONE_CLASS) for seed in range(2)],
            "recording",
            "thumb: 0 samples",
        ),
        ([tiny_recording(0)], "recording", "grasp-0"),
        ([tiny_recording(0), Recording("bare", {"thumb": tiny_module(1)})], "object", "'bare'"),
        (
            [tiny_recording(0, ("thumb",)), tiny_recording(1, ("index",))],
            "recording",
            "no finger",
        ),
    ],
)
def test_refusals(given, split, message):
    setting = replace(SETTING, split=split)
    with pytest.raises(TrainingError, match=message):
        train(given, setting)
