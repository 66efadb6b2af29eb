"""Temporal convolutional network of Grover et al. (2022), with torch."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.fitting import (
    Parameters,
    Samples,
    check_classes,
    class_ratio,
    undo_balancing,
)
from holdfast.classifiers.folds import shuffled
from holdfast.classifiers.linear import feature_rows
from holdfast.errors import MissingExtra
from holdfast.sensors.types import Array

if TYPE_CHECKING:
    from optuna import Trial

Tensor = Any
TorchGenerator = Any
"""Random generator of torch; the global generator is not used."""
Weights = Mapping[str, npt.NDArray[np.float32]]

N_FILTERS, KERNEL_SIZE, N_HIDDEN = 12, 8, 24
N_BLOCKS = 4
"""Number of blocks of two convolutions; the dilation doubles from block to block."""
EPSILON = 1e-3
"""Added to the variance in the normalisation of a layer."""
BATCH_SIZE = 256
PREDICTION_CHUNK_SIZE = 4096
"""Number of rows whose probabilities are computed at a time."""
VALIDATION_SHARE = 0.2
"""Share of the groups that are held out to find the end of training."""


@dataclass(frozen=True, eq=False)
class Network:
    """Fitted network.

    Attributes:
        weights: by name, with the shapes of `weight_shapes`.
        mean: of each channel in training.
        scale: standard deviation of each channel in training.
        n_steps: number of samples of a window.
        class_ratio: factor by which the balanced classes multiplied the odds.
    """

    weights: Weights
    mean: Array
    scale: Array
    n_steps: int
    class_ratio: float

    @property
    def n_features(self) -> int:
        """Number of values of a window."""
        return self.n_steps * len(self.mean)

    @property
    def threshold(self) -> float:
        """Probability from which on a contact is stable: even odds with balanced classes."""
        return 1.0 / (1.0 + self.class_ratio)

    def probability(self, features: npt.ArrayLike) -> Array:
        """Return the probability of stability of each row of (n, n_features); NaN if it has NaN.

        Raises:
            ValueError: the number of features is not `n_features`.
            MissingExtra: torch is not installed.
        """
        torch = _torch()
        rows = feature_rows(features, self.n_features)
        probabilities = np.full(len(rows), np.nan)
        known = np.flatnonzero(~np.isnan(rows).any(axis=1))
        weights = {name: torch.from_numpy(array) for name, array in self.weights.items()}
        with _one_thread(torch), torch.no_grad():
            for chunk in np.split(
                known, range(PREDICTION_CHUNK_SIZE, len(known), PREDICTION_CHUNK_SIZE)
            ):
                windows = torch.from_numpy(_windows(rows[chunk], self.mean, self.scale))
                scores = torch.softmax(forward(windows, weights).double(), dim=1)
                probabilities[chunk] = undo_balancing(scores[:, 1].numpy(), self.class_ratio)
        return probabilities


@dataclass(frozen=True)
class TemporalConvolution:
    """Grover's network: causal convolutions over a window; its last step gives two classes.

    It is fitted by Adam with cross entropy. Every epoch uses all samples of the rarer class and
    the same number of the other class, drawn again for each epoch. This multiplies the odds by a
    factor. The probability is corrected by it; the decision is not changed by the correction.
    With a `patience` above 0, a fifth of the groups (recordings) is held out, and training stops
    when their loss has not fallen for that many epochs; the weights with the smallest loss are
    kept. The fit uses one thread, so that a seed gives the same network on the same machine and
    version of torch.

    Attributes:
        n_channels: number of values of each step of a window; a row has them step by step.
    """

    n_channels: int = 3
    name: str = "tcn"
    reference: Parameters = field(
        default_factory=lambda: {
            "n_epochs": 200,
            "patience": 15,
            "learning_rate": 2e-3,
            "dropout": 0.2,
        }
    )

    def suggest(self, trial: "Trial") -> Parameters:
        """Draw the number of epochs, the learning rate and the dropout."""
        return {
            "n_epochs": trial.suggest_int("n_epochs", 4, 200, log=True),
            "patience": trial.suggest_int("patience", 5, 40, log=True),
            "learning_rate": trial.suggest_float("learning_rate", 2e-4, 1e-2, log=True),
            "dropout": trial.suggest_float("dropout", 0.0, 0.5),
        }

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Network:
        """Fit the network to the samples.

        Raises:
            ValueError: the number of features is not a multiple of `n_channels`.
            TrainingError: the samples have only one class.
            MissingExtra: torch is not installed.
        """
        torch = _torch()
        check_classes(samples)
        n_features = samples.features.shape[1]
        if n_features % self.n_channels:
            raise ValueError(
                f"steps of {self.n_channels} channels expected, {n_features} features given"
            )
        steps = samples.features.reshape(-1, self.n_channels)
        mean, scale = steps.mean(axis=0, dtype=np.float64), steps.std(axis=0, dtype=np.float64)
        # A channel that never changes would be divided by zero.
        scale[np.ptp(steps, axis=0) == 0] = 1.0
        windows = torch.from_numpy(_windows(samples.features, mean, scale))
        with _one_thread(torch):
            weights = _train(torch, windows, samples, parameters, seed)
        n_steps = n_features // self.n_channels
        return Network(weights, mean, scale, n_steps, class_ratio(samples.positive))


def weight_shapes(n_channels: int) -> dict[str, tuple[int, ...]]:
    """Return the shape of every array of weights: 9974 numbers for Grover's six channels."""
    shapes: dict[str, tuple[int, ...]] = {"match": (N_FILTERS, n_channels, 1)}
    shapes["match/bias"] = (N_FILTERS,)
    for block in range(N_BLOCKS):
        for layer in range(2):
            width = N_FILTERS if block or layer else n_channels
            shapes[f"block{block}/{layer}"] = (N_FILTERS, width, KERNEL_SIZE)
            for part in ("bias", "gain", "shift"):
                shapes[f"block{block}/{layer}/{part}"] = (N_FILTERS,)
    for k, (before, after) in enumerate(pairwise((N_FILTERS, N_HIDDEN, N_HIDDEN, 2))):
        shapes |= {f"dense{k}": (after, before), f"dense{k}/bias": (after,)}
    return shapes


def forward(
    windows: Tensor,
    weights: Mapping[str, Tensor],
    dropout: Callable[[Tensor], Tensor] | None = None,
) -> Tensor:
    """Return the scores of both classes at the last step of each window.

    A block with a dilation of 2, 4 or 8 computes only every 2nd, 4th or 8th step back from the
    last step, because its result there depends on no other steps. That is three times as fast.

    Args:
        windows: (n, n_channels, n_steps) standardised.
        weights: by name.
        dropout: sets some channels of (n, n_channels, n_steps) to 0 in training; None for none.

    Returns:
        (n, 2) not stable, stable; their softmax is the probability.
    """
    from torch.nn import functional

    values = windows
    for block in range(N_BLOCKS):
        if block:
            values = values[:, :, (values.shape[2] - 1) % 2 :: 2]
        inner = values
        for layer in range(2):
            inner = _convolve(inner, weights, f"block{block}/{layer}")
            inner = inner if dropout is None else dropout(inner)
        if not block:  # the input has another number of channels than the filters
            values = functional.conv1d(values, weights["match"], weights["match/bias"])
        values = functional.selu(values + inner)
    values = values[:, :, -1]
    for k in range(2):
        values = functional.selu(
            functional.linear(values, weights[f"dense{k}"], weights[f"dense{k}/bias"])
        )
    return functional.linear(values, weights["dense2"], weights["dense2/bias"])


def _convolve(values: Tensor, weights: Mapping[str, Tensor], name: str) -> Tensor:
    """Apply a causal convolution, the normalisation over channels and the activation."""
    from torch.nn import functional

    filtered = functional.conv1d(
        functional.pad(values, (KERNEL_SIZE - 1, 0)), weights[name], weights[f"{name}/bias"]
    )
    gain, shift = weights[f"{name}/gain"], weights[f"{name}/shift"]
    filtered = functional.layer_norm(filtered.transpose(1, 2), (N_FILTERS,), gain, shift, EPSILON)
    return functional.selu(filtered.transpose(1, 2))


class EarlyStopping:
    """Memory of the smallest validation loss, which ends training once the loss stops falling.

    Args:
        patience: epochs without a smaller loss after which training is over.

    Example:
        >>> stopping = EarlyStopping(patience=2)
        >>> [stopping.update(loss) for loss in (3.0, 2.0, 2.5)], stopping.is_over
        ([True, True, False], False)
        >>> stopping.update(2.0), stopping.is_over
        (False, True)
    """

    def __init__(self, patience: int) -> None:
        self._patience = patience
        self._smallest = math.inf
        self._n_since = 0

    @property
    def is_over(self) -> bool:
        """Whether the loss has not fallen for `patience` epochs."""
        return self._n_since >= self._patience

    def update(self, loss: float) -> bool:
        """Add the loss of an epoch. Return whether it is the smallest so far."""
        is_smallest = loss < self._smallest
        self._n_since = 0 if is_smallest else self._n_since + 1
        self._smallest = min(loss, self._smallest)
        return is_smallest


def validation_rows(samples: Samples, seed: int) -> npt.NDArray[np.bool_]:
    """Return which samples are held out to find the end of training, (n,).

    They are those of a fifth of the groups, drawn at random. No sample is held out if there is
    no such choice that leaves both classes on both sides.
    """
    names = np.unique(samples.groups)
    groups = names[shuffled(len(names), seed)]
    n_left_out = max(1, round(VALIDATION_SHARE * len(groups)))
    # The groups in a ring: the next choice is tried where a class is missing on one side.
    for start in range(len(groups) if len(groups) > n_left_out else 0):
        left_out = np.isin(samples.groups, np.roll(groups, -start)[:n_left_out])
        if not samples.take(left_out).one_class and not samples.take(~left_out).one_class:
            return left_out
    return np.zeros(len(samples.positive), dtype=np.bool_)


def _train(
    torch: ModuleType, windows: Tensor, samples: Samples, parameters: Parameters, seed: int
) -> Weights:
    generator = torch.Generator().manual_seed(seed)
    weights = {
        n: initial_weights(generator, n, s) for n, s in weight_shapes(windows.shape[1]).items()
    }
    optimiser = torch.optim.Adam(weights.values(), lr=parameters["learning_rate"])
    classes = torch.from_numpy(samples.positive.astype(np.int64))
    rng = np.random.default_rng(seed)
    dropout = partial(drop_channels, fraction=parameters["dropout"], generator=generator)
    patience = parameters.get("patience", 0)
    left_out = validation_rows(samples, seed) if patience else np.zeros(len(samples.positive), bool)
    fitted, stopping = np.flatnonzero(~left_out), EarlyStopping(patience)
    # Copied, because the optimiser changes the tensors in place.
    best = {name: tensor.detach().numpy().copy() for name, tensor in weights.items()}
    for _ in range(parameters["n_epochs"]):
        order = torch.from_numpy(fitted[balanced_rows(samples.positive[fitted], rng)])
        for rows in order.split(BATCH_SIZE):
            optimiser.zero_grad()
            scores = forward(windows[rows], weights, dropout)
            torch.nn.functional.cross_entropy(scores, classes[rows]).backward()
            optimiser.step()
        # Without held-out groups there is no loss to compare: the last weights are kept.
        if not left_out.any() or stopping.update(_loss(torch, windows, classes, weights, left_out)):
            best = {name: tensor.detach().numpy().copy() for name, tensor in weights.items()}
        if left_out.any() and stopping.is_over:
            break
    return best


def _loss(
    torch: ModuleType,
    windows: Tensor,
    classes: Tensor,
    weights: Mapping[str, Tensor],
    left_out: npt.NDArray[np.bool_],
) -> float:
    """Return the mean cross entropy of the left-out windows, with both classes weighing alike."""
    rows = torch.from_numpy(np.flatnonzero(left_out))
    with torch.no_grad():
        scores = torch.cat(
            [forward(windows[part], weights) for part in rows.split(PREDICTION_CHUNK_SIZE)]
        )
    losses = torch.nn.functional.cross_entropy(scores, classes[rows], reduction="none")
    stable = classes[rows] == 1
    return float((losses[stable].mean() + losses[~stable].mean()) / 2)


def drop_channels(values: Tensor, fraction: float, generator: TorchGenerator) -> Tensor:
    """Set a random fraction of the channels of each window to 0, and scale up the others."""
    import torch

    kept = torch.rand((*values.shape[:2], 1), generator=generator) >= fraction
    return values * kept / (1.0 - fraction)


def initial_weights(generator: TorchGenerator, name: str, shape: tuple[int, ...]) -> Tensor:
    """Draw kernels by He's rule, normal with variance 2 / fan-in; gains are 1, the others 0."""
    import torch

    if name.endswith(("bias", "shift", "gain")):
        start = torch.full(shape, float(name.endswith("gain")))
    else:
        start = torch.randn(shape, generator=generator) * math.sqrt(2.0 / math.prod(shape[1:]))
    return start.requires_grad_()


def balanced_rows(stable: npt.NDArray[np.bool_], rng: np.random.Generator) -> npt.NDArray[np.int64]:
    """Return the rows of an epoch in random order: as many of each class as the rarer one has."""
    kinds = [rng.permutation(np.flatnonzero(stable == kind)) for kind in (False, True)]
    n = min(len(kind) for kind in kinds)
    return rng.permutation(np.concatenate([kind[:n] for kind in kinds]))


def _windows(rows: npt.NDArray[Any], mean: Array, scale: Array) -> npt.NDArray[np.float32]:
    """Return (n, n_channels, n_steps) standardised, from rows with the values step by step."""
    n_channels = len(mean)
    steps = (rows.reshape(len(rows), rows.shape[1] // n_channels, n_channels) - mean) / scale
    return np.ascontiguousarray(steps.swapaxes(1, 2), dtype=np.float32)


@contextmanager
def _one_thread(torch: ModuleType) -> Iterator[None]:
    """Limit torch to one thread: the order of sums is fixed, and threads never wait."""
    n_threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(n_threads)


def _torch() -> ModuleType:
    try:
        import torch
    except ImportError as cause:
        raise MissingExtra("torch", "deep") from cause
    module: ModuleType = torch
    return module
