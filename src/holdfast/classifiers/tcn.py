"""The temporal convolutional network of Grover et al. (2022), by torch."""

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
    balance_of,
    check_classes,
    unbalanced,
)
from holdfast.classifiers.linear import Array, rows_of
from holdfast.errors import MissingExtra

if TYPE_CHECKING:
    from optuna import Trial

Tensor = Any
Chance = Any
"""A generator of random numbers of torch: nothing here turns to the one that all share."""
Weights = Mapping[str, npt.NDArray[np.float32]]

N_FILTERS, KERNEL, HIDDEN = 12, 8, 24
N_BLOCKS = 4
"""Of two convolutions each; those of the next block see steps twice as far apart."""
EPSILON = 1e-3
"""Added to the variance where a layer is normalised."""
BATCH = 256
CHUNK = 4096
"""Rows judged at a time."""


@dataclass(frozen=True, eq=False)
class Network:
    """A fitted network: plain numbers, which torch multiplies.

    Attributes:
        weights: by name, of the shapes that `shapes` gives.
        mean: of each channel in training.
        scale: standard deviation of each channel in training.
        n_steps: of a window.
        balance: by how much balanced classes have multiplied the odds.
    """

    weights: Weights
    mean: Array
    scale: Array
    n_steps: int
    balance: float

    @property
    def n_features(self) -> int:
        """How many numbers a window has."""
        return self.n_steps * len(self.mean)

    @property
    def threshold(self) -> float:
        """The probability from which on a contact is called stable: even odds once balanced."""
        return 1.0 / (1.0 + self.balance)

    def probability(self, features: npt.ArrayLike) -> Array:
        """The probability of stability of each row of (n, n_features); NaN for rows with NaN.

        Raises:
            ValueError: another number of features.
            MissingExtra: torch is not installed.
        """
        torch = _torch()
        rows = rows_of(features, self.n_features)
        found = np.full(len(rows), np.nan)
        known = np.flatnonzero(~np.isnan(rows).any(axis=1))
        weights = {name: torch.from_numpy(array) for name, array in self.weights.items()}
        with _one_thread(torch), torch.no_grad():
            for chunk in np.split(known, range(CHUNK, len(known), CHUNK)):
                windows = torch.from_numpy(_windows(rows[chunk], self.mean, self.scale))
                scores = torch.softmax(forward(windows, weights).double(), dim=1)
                found[chunk] = unbalanced(scores[:, 1].numpy(), self.balance)
        return found


@dataclass(frozen=True)
class TemporalConvolution:
    """Grover's network: causal convolutions over a window, its last step to two classes.

    Adam, cross entropy; every epoch takes all of the rarer class and as many of the other, drawn
    anew. The probability is corrected by the factor that this puts on the odds, the decision
    stays where it puts it. One thread, so that a seed gives the same network on one machine and
    version of torch; another may round differently.

    Attributes:
        n_channels: numbers of each step of a window; a row has them step by step.
    """

    n_channels: int = 3
    name: str = "tcn"
    reference: Parameters = field(
        default_factory=lambda: {"n_epochs": 20, "learning_rate": 2e-3, "dropout": 0.2}
    )

    def suggest(self, trial: "Trial") -> Parameters:
        """How long and how fast it learns, and how much it forgets meanwhile."""
        return {
            "n_epochs": trial.suggest_int("n_epochs", 4, 40, log=True),
            "learning_rate": trial.suggest_float("learning_rate", 2e-4, 1e-2, log=True),
            "dropout": trial.suggest_float("dropout", 0.0, 0.5),
        }

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Network:
        """The network fitted to the samples.

        Raises:
            ValueError: rows that are not whole steps.
            TrainingError: only one class.
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
        scale[np.ptp(steps, axis=0) == 0] = 1.0
        windows = torch.from_numpy(_windows(samples.features, mean, scale))
        with _one_thread(torch):
            weights = _train(torch, windows, samples.stable, parameters, seed)
        n_steps = n_features // self.n_channels
        return Network(weights, mean, scale, n_steps, balance_of(samples.stable))


def shapes(n_channels: int) -> dict[str, tuple[int, ...]]:
    """The shape of every array of weights: 9974 numbers for the six channels of the source."""
    found: dict[str, tuple[int, ...]] = {"match": (N_FILTERS, n_channels, 1)}
    found["match/bias"] = (N_FILTERS,)
    for block in range(N_BLOCKS):
        for layer in range(2):
            width = N_FILTERS if block or layer else n_channels
            found[f"block{block}/{layer}"] = (N_FILTERS, width, KERNEL)
            for each in ("bias", "gain", "shift"):
                found[f"block{block}/{layer}/{each}"] = (N_FILTERS,)
    for k, (before, after) in enumerate(pairwise((N_FILTERS, HIDDEN, HIDDEN, 2))):
        found |= {f"dense{k}": (after, before), f"dense{k}/bias": (after,)}
    return found


def forward(
    windows: Tensor, weights: Mapping[str, Tensor], thin: Callable[[Tensor], Tensor] | None = None
) -> Tensor:
    """The scores of both classes at the last step of each window.

    A block whose convolutions see steps 2, 4 or 8 apart works on every 2nd, 4th or 8th step back
    from the last alone: what it gives there rests on no others. That is three times as fast.

    Args:
        windows: (n, n_channels, n_steps) standardised.
        weights: by name.
        thin: what leaves out some channels, (n, n_channels, n_steps) each, in training.

    Returns:
        (n, 2) not stable, stable; their softmax are probabilities.
    """
    from torch.nn import functional

    values = windows
    for block in range(N_BLOCKS):
        if block:
            values = values[:, :, (values.shape[2] - 1) % 2 :: 2]
        inner = values
        for layer in range(2):
            inner = _convolved(inner, weights, f"block{block}/{layer}")
            inner = inner if thin is None else thin(inner)
        if not block:
            values = functional.conv1d(values, weights["match"], weights["match/bias"])
        values = functional.selu(values + inner)
    values = values[:, :, -1]
    for k in range(2):
        values = functional.selu(
            functional.linear(values, weights[f"dense{k}"], weights[f"dense{k}/bias"])
        )
    return functional.linear(values, weights["dense2"], weights["dense2/bias"])


def _convolved(values: Tensor, weights: Mapping[str, Tensor], name: str) -> Tensor:
    """Causal convolution, normalised over the channels of each step, activated."""
    from torch.nn import functional

    found = functional.conv1d(
        functional.pad(values, (KERNEL - 1, 0)), weights[name], weights[f"{name}/bias"]
    )
    gain, shift = weights[f"{name}/gain"], weights[f"{name}/shift"]
    found = functional.layer_norm(found.transpose(1, 2), (N_FILTERS,), gain, shift, EPSILON)
    return functional.selu(found.transpose(1, 2))


def _train(
    torch: ModuleType,
    windows: Tensor,
    stable: npt.NDArray[np.bool_],
    parameters: Parameters,
    seed: int,
) -> Weights:
    chance = torch.Generator().manual_seed(seed)
    weights = {n: _drawn(chance, n, s) for n, s in shapes(windows.shape[1]).items()}
    optimiser = torch.optim.Adam(weights.values(), lr=parameters["learning_rate"])
    classes = torch.from_numpy(stable.astype(np.int64))
    rng = np.random.default_rng(seed)
    thin = partial(_thinned, dropout=parameters["dropout"], chance=chance)
    for _ in range(parameters["n_epochs"]):
        order = torch.from_numpy(_balanced(stable, rng))
        for rows in order.split(BATCH):
            optimiser.zero_grad()
            scores = forward(windows[rows], weights, thin)
            torch.nn.functional.cross_entropy(scores, classes[rows]).backward()
            optimiser.step()
    return {name: tensor.detach().numpy() for name, tensor in weights.items()}


def _thinned(values: Tensor, dropout: float, chance: Chance) -> Tensor:
    """Some channels of each window left out over all steps, the others made up for them."""
    import torch

    kept = torch.rand((*values.shape[:2], 1), generator=chance) >= dropout
    return values * kept / (1.0 - dropout)


def _drawn(chance: Chance, name: str, shape: tuple[int, ...]) -> Tensor:
    """Kernels by He's rule, normal with variance 2 / fan-in; gains of 1, the rest 0."""
    import torch

    if name.endswith(("bias", "shift", "gain")):
        start = torch.full(shape, float(name.endswith("gain")))
    else:
        start = torch.randn(shape, generator=chance) * math.sqrt(2.0 / math.prod(shape[1:]))
    return start.requires_grad_()


def _balanced(stable: npt.NDArray[np.bool_], rng: np.random.Generator) -> npt.NDArray[np.int64]:
    """Rows of an epoch, in random order: as many of either class as the rarer one has."""
    kinds = [rng.permutation(np.flatnonzero(stable == kind)) for kind in (False, True)]
    n = min(len(kind) for kind in kinds)
    return rng.permutation(np.concatenate([kind[:n] for kind in kinds]))


def _windows(rows: npt.NDArray[Any], mean: Array, scale: Array) -> npt.NDArray[np.float32]:
    """(n, n_channels, n_steps) standardised, out of rows that go step by step."""
    n_channels = len(mean)
    steps = (rows.reshape(len(rows), rows.shape[1] // n_channels, n_channels) - mean) / scale
    return np.ascontiguousarray(steps.swapaxes(1, 2), dtype=np.float32)


@contextmanager
def _one_thread(torch: ModuleType) -> Iterator[None]:
    """One thread meanwhile: sums in one order, and no waiting of threads for each other."""
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
