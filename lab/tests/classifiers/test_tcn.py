"""Grover's network against a slow one written out step by step."""

import importlib.util
import math
import sys

import numpy as np
import pytest

from holdfast.classifiers import Samples
from holdfast.errors import MissingExtra, TrainingError, install_command
from holdfast_lab.classifiers.tcn import (
    EarlyStopping,
    Network,
    TemporalConvolution,
    validation_rows,
    weight_shapes,
)

RECIPE = TemporalConvolution()
SHORT = {**RECIPE.reference, "n_epochs": 2}
deep = pytest.mark.skipif(importlib.util.find_spec("torch") is None, reason="torch is an extra")


def waves(n=600, steps=20, seed=0, share=0.5):
    """Stable where the first of three channels is still; a wave of any phase elsewhere."""
    rng = np.random.default_rng(seed)
    stable = rng.random(n) < share
    phase = rng.uniform(0, 2 * np.pi, size=(n, 1)) + np.arange(steps) * 2.1
    rows = rng.normal(size=(n, steps, 3)) * [0.3, 1.0, 1.0]
    rows[:, :, 0] += np.where(stable[:, None], 0.0, 2.0 * np.sin(phase))
    rows = rows * [100.0, 1.0, 0.01] + [5000.0, 0.0, 1.0]
    return Samples(rows.reshape(n, -1).astype(np.float32), stable, np.arange(n) % 5)


def drawn(n_channels, seed=0):
    rng = np.random.default_rng(seed)
    return {
        name: rng.normal(scale=0.3, size=shape).astype(np.float32)
        for name, shape in weight_shapes(n_channels).items()
    }


def selu(x):
    scale, alpha = 1.0507009873554805, 1.6732632423543772
    return scale * np.where(x > 0, x, alpha * (np.exp(np.minimum(x, 0)) - 1))


def naive_layer(values, weights, name, dilation):
    """(n_steps, n_channels) -> (n_steps, 12), one step and one tap at a time."""
    found = np.zeros((len(values), 12))
    for k in range(len(values)):
        total = weights[f"{name}/bias"].astype(float)
        for tap in range(8):
            back = (7 - tap) * dilation
            if k >= back:
                total = total + weights[name][:, :, tap] @ values[k - back]
        mean, variance = total.mean(), total.var()
        normal = (total - mean) / math.sqrt(variance + 1e-3)
        found[k] = selu(normal * weights[f"{name}/gain"] + weights[f"{name}/shift"])
    return found


def naive_scores(window, weights):
    """(n_channels, n_steps) -> the scores at every step (n_steps, 2)."""
    values = window.T.astype(float)
    for block, dilation in enumerate((1, 2, 4, 8)):
        inner = naive_layer(values, weights, f"block{block}/0", dilation)
        inner = naive_layer(inner, weights, f"block{block}/1", dilation)
        if block == 0:
            values = values @ weights["match"][:, :, 0].T + weights["match/bias"]
        values = selu(values + inner)
    for k in range(2):
        values = selu(values @ weights[f"dense{k}"].T + weights[f"dense{k}/bias"])
    return values @ weights["dense2"].T + weights["dense2/bias"]


def torch_scores(windows, weights):
    import torch

    from holdfast_lab.classifiers.tcn import forward

    tensors = {name: torch.from_numpy(array) for name, array in weights.items()}
    return forward(torch.from_numpy(windows.astype(np.float32)), tensors).numpy()


@pytest.mark.parametrize(("n_channels", "n_weights"), [(6, 9974), (3, 9650), (1, 9434)])
def test_the_number_of_parameters_is_that_of_the_source(n_channels, n_weights):
    assert sum(math.prod(shape) for shape in weight_shapes(n_channels).values()) == n_weights


@deep
@pytest.mark.parametrize("n_steps", [1, 2, 7, 33, 100, 101])
@pytest.mark.parametrize("n_channels", [3, 6])
def test_forward_equals_the_slow_network(n_steps, n_channels):
    weights = drawn(n_channels)
    windows = np.random.default_rng(1).normal(size=(2, n_channels, n_steps))
    slow = [naive_scores(window, weights)[-1] for window in windows]
    assert torch_scores(windows, weights) == pytest.approx(np.array(slow), rel=1e-3, abs=1e-3)


@deep
def test_no_step_depends_on_later_steps():
    """The result at a step of a long window is that of the window that ends there."""
    weights = drawn(3)
    window = np.random.default_rng(2).normal(size=(3, 60))
    at_each_step = naive_scores(window, weights)
    for k in (0, 1, 6, 30, 44, 59):
        alone = torch_scores(window[None, :, : k + 1], weights)[0]
        assert alone == pytest.approx(at_each_step[k], rel=1e-3, abs=1e-3)


@deep
def test_probability_is_the_softmax_corrected_for_balancing():
    weights = drawn(3)
    mean, scale = np.array([1.0, 2.0, 3.0]), np.array([2.0, 1.0, 0.5])
    network = Network(weights, mean, scale, n_steps=10, class_ratio=3.0)
    rows = np.random.default_rng(3).normal(size=(4, 10, 3))
    scores = [naive_scores(((row - mean) / scale).T, weights)[-1] for row in rows]
    odds = np.exp([two - one for one, two in scores]) / 3.0
    assert network.n_features == 30
    assert network.threshold == 0.25
    assert network.probability(rows.reshape(4, 30)) == pytest.approx(odds / (1 + odds), abs=1e-4)


@deep
def test_nan_features_have_no_probability():
    network = Network(drawn(3), np.zeros(3), np.ones(3), n_steps=10, class_ratio=1.0)
    rows = np.zeros((3, 30))
    rows[1, 7] = np.nan
    assert np.isnan(network.probability(rows)).tolist() == [False, True, False]
    assert np.isnan(network.probability(rows[1:2])).all()
    assert network.probability(np.empty((0, 30))).shape == (0,)
    with pytest.raises(ValueError) as raised:
        network.probability(np.zeros((2, 31)))
    assert str(raised.value) == "features of shape (n, 30) expected, (2, 31) given"


def test_a_fifth_of_the_recordings_finds_the_end_of_training():
    samples = waves(600)
    held = validation_rows(samples, seed=0)
    assert len(set(samples.groups[held])) == 1
    assert not set(samples.groups[held]) & set(samples.groups[~held])
    assert {tuple(validation_rows(samples, seed)) for seed in range(9)} != {tuple(held)}


def test_both_classes_are_on_both_sides_of_the_validation():
    """Only group 3 has both classes, and it alone can be held out."""
    groups = np.repeat([0, 1, 2, 3], 10)
    stable = np.repeat([True, False, True, True], 10)
    stable[35:] = False
    samples = Samples(np.zeros((40, 3)), stable, groups)
    for seed in range(4):
        assert set(groups[validation_rows(samples, seed)]) == {3}
    assert not validation_rows(samples.take(groups < 3), 0).any()
    assert not validation_rows(samples.take(groups == 3), 0).any()


def test_training_is_over_when_the_loss_has_stopped_falling():
    stopping = EarlyStopping(patience=3)
    losses = [5.0, 4.0, 4.5, 4.2, 3.0, 3.5, 3.5, 3.0]
    assert [stopping.update(loss) for loss in losses] == [
        True, True, False, False, True, False, False, False,
    ]  # fmt: skip
    assert stopping.is_over


@deep
def test_the_weights_of_the_smallest_loss_are_kept():
    """A patience of one epoch with steps that are far too large ends training early."""
    wild = {"n_epochs": 40, "learning_rate": 1.0, "dropout": 0.0, "patience": 1}
    one, two = (RECIPE.fit(waves(600), {**wild, "n_epochs": n}, 0) for n in (40, 39))
    for name, array in one.weights.items():
        assert np.array_equal(array, two.weights[name])


@deep
def test_it_learns():
    quick = {"n_epochs": 10, "learning_rate": 1e-2, "dropout": 0.0}
    network = RECIPE.fit(waves(2000), quick, 0)
    test = waves(seed=1)
    right = (network.probability(test.features) >= network.threshold) == test.positive
    assert right.mean() > 0.9


@deep
def test_a_seed_gives_the_same_network_and_leaves_torch_as_it_was():
    import torch

    given = waves(300)
    before = torch.get_num_threads()
    state = torch.get_rng_state()
    one, two, other = (RECIPE.fit(given, SHORT, seed) for seed in (3, 3, 4))
    assert all(np.array_equal(one.weights[name], two.weights[name]) for name in one.weights)
    assert not np.array_equal(one.weights["match"], other.weights["match"])
    assert np.array_equal(one.probability(given.features), two.probability(given.features))
    assert torch.get_num_threads() == before
    assert torch.equal(torch.get_rng_state(), state)


@deep
def test_mean_scale_and_shapes_after_training():
    given = waves(400, share=0.2)
    network = RECIPE.fit(given, SHORT, 0)
    steps = given.features.reshape(-1, 3).astype(float)
    assert network.mean == pytest.approx(steps.mean(axis=0), rel=1e-6)
    assert network.scale == pytest.approx(steps.std(axis=0), rel=1e-4)
    assert network.n_features == given.features.shape[1]
    assert network.threshold == pytest.approx(given.positive.mean())
    assert {n: w.shape for n, w in network.weights.items()} == weight_shapes(3)


@deep
def test_an_epoch_has_as_many_of_either_class():
    from holdfast_lab.classifiers.tcn import balanced_rows

    stable = np.array([True] * 3 + [False] * 9)
    epochs = [balanced_rows(stable, np.random.default_rng(seed)) for seed in range(20)]
    for rows in epochs:
        assert len(set(rows.tolist())) == 6
        assert stable[rows].sum() == 3
    assert set(np.concatenate(epochs).tolist()) == set(range(12))


@deep
def test_dropout_leaves_out_whole_channels_and_scales_the_others():
    import torch

    from holdfast_lab.classifiers.tcn import drop_channels

    chance = torch.Generator().manual_seed(0)
    thinned = drop_channels(torch.ones((500, 12, 5)), 0.2, chance).numpy()
    assert (thinned == thinned[:, :, :1]).all()
    assert set(np.unique(thinned).tolist()) == {0.0, 1.25}
    assert (thinned == 0).mean() == pytest.approx(0.2, abs=0.02)


@deep
def test_kernels_begin_by_hes_rule():
    import torch

    from holdfast_lab.classifiers.tcn import initial_weights

    chance = torch.Generator().manual_seed(0)
    kernel = initial_weights(chance, "block1/0", (400, 12, 8)).detach().numpy()
    assert kernel.var() == pytest.approx(2 / 96, rel=0.05)
    for name, value in (("bias", 0.0), ("gain", 1.0), ("shift", 0.0)):
        assert (initial_weights(chance, f"block1/0/{name}", (12,)).detach().numpy() == value).all()


@deep
def test_a_constant_channel():
    given = waves(200)
    rows = given.features.reshape(200, -1, 3).copy()
    rows[:, :, 2] = 7.0
    network = RECIPE.fit(given._replace(features=rows.reshape(200, -1)), SHORT, 0)
    assert np.isfinite(network.probability(rows.reshape(200, -1))).all()


@deep
def test_refusals():
    given = waves(50)
    with pytest.raises(ValueError) as raised:
        RECIPE.fit(given._replace(features=given.features[:, :-1]), SHORT, 0)
    assert str(raised.value) == "steps of 3 channels expected, 59 features given"
    with pytest.raises(TrainingError) as refused:
        RECIPE.fit(given._replace(positive=np.ones(50, dtype=bool)), SHORT, 0)
    assert str(refused.value) == (
        "50 samples labelled stable and 0 labelled not stable given; both classes are needed to "
        "train"
    )


def test_without_torch_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingExtra) as raised:
        RECIPE.fit(waves(50), SHORT, 0)
    assert str(raised.value) == (
        f"this needs the package torch, which is not installed: {install_command('deep')}"
    )
    network = Network(drawn(3), np.zeros(3), np.ones(3), n_steps=10, class_ratio=1.0)
    with pytest.raises(MissingExtra):
        network.probability(np.zeros((1, 30)))


def test_a_search_begins_with_the_reference():
    import optuna

    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    study.enqueue_trial(dict(RECIPE.reference))
    assert RECIPE.suggest(study.ask()) == RECIPE.reference
    assert set(RECIPE.suggest(study.ask())) == set(RECIPE.reference)
