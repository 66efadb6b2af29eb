"""What a noise floor of its own for each lag would give `builtin:any`; twin and real.

    holdfast simulate hands/ --randomize --measured scan,filter,noise,vibration \\
        --repeats 150 --grasps 3 --seed 0
    python benchmarks/noise_by_lag.py hands/ --real "$HOLDFAST_DATA"

The features subtract the noise of a change as if it were white: twice that of a sample, over every
lag. Where a sensor averages its readings, the noise of a change grows with the lag. Here that is
measured from the stream, as the noise of a sample is: the least mean square of a change over blocks
that are complete, at least that of white noise, at most that of a random walk. The changes of
force, shear and taxels are made again with it, offline; then the weights are fitted and judged as
in `ablation_any.py`. The first table has the noise of the force over a lag in that of white noise.
"""

import argparse
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from ablation_any import COLUMNS, EVERYTHING, RealFinger, RealSets, real_fingers
from hand_handling import HandGrasp, folds_of, moments_of_others, read_grasp
from real_slips import boxes, tugs
from sklearn.metrics import roc_auc_score
from train_any import FEATURES, N_FOLDS, fit, model_of, out_of_fold, untrained

from holdfast.io import load_dataset
from holdfast.io.importers import import_recordings
from holdfast.recordings import Recording, Tactile

# As in kernel/motion.c.
NOISE_BLOCK_SECONDS, MIN_BLOCK_STEPS = 0.2, 5
LEAST_CHANGE, NOISE_SQUARES, TWO_AXES = 0.005, 4.0, 2.0 / 3.0

SHARES = {
    "force_change": 1.0, "shear_change": TWO_AXES, "residual": 1.0, "shear_residual": TWO_AXES,
}  # fmt: skip
"""Kinds of features that are corrected, and the share of the squared noise in their axes."""
OF_FORCE = "force_change", "shear_change"
LAGS = sorted({feature.seconds for feature in FEATURES})


def turned(module: Tactile) -> np.ndarray:
    """Return (n, n_taxels, 3) the readings in the frame of the finger, from the first one on."""
    readings = np.asarray(module.readings, dtype=np.float64)
    rotations = np.asarray(module.sensor.rotations)
    return np.einsum("tij,ntj->nti", rotations, readings - np.nan_to_num(readings[0]))


def noise_growth(values: np.ndarray, period: float, seconds: float) -> np.ndarray:
    """Return (n,) the square of the noise of a change over a lag, in that of white noise.

    Args:
        values: (n, n_values), of which the change is taken.
        period: of the samples [s].
        seconds: the lag.
    """
    lag = max(1, round(seconds / period))
    return np.clip(
        least_squares(values, lag, period) / least_squares(values, 1, period), 1.0, float(lag)
    )


def least_squares(values: np.ndarray, lag: int, period: float) -> np.ndarray:
    """Return (n,) the least mean square change over a lag of the blocks complete by then."""
    n = len(values)
    squares = np.full(n, np.nan)
    squares[lag:] = ((values[lag:] - values[:-lag]) ** 2).sum(axis=1)
    size = max(MIN_BLOCK_STEPS, round(NOISE_BLOCK_SECONDS / period), lag)
    n_blocks = n // size
    means = squares[: n_blocks * size].reshape(n_blocks, size).mean(axis=1)
    means = np.where(means > 0, means, np.nan)
    least = np.fmin.accumulate(means) if n_blocks else np.empty(0)
    return np.concatenate([np.full(size, np.nan), np.repeat(least, size)])[:n]


def corrected(features: np.ndarray, module: Tactile) -> np.ndarray:
    """Return the features of a finger, with the noise of each lag."""
    forces = turned(module)
    flat = forces.reshape(len(forces), -1)
    load_to_noise = features[:, [f.kind for f in FEATURES].index("load_to_noise")]
    changed = features.copy()
    for place, feature in enumerate(FEATURES):
        if feature.kind not in SHARES:
            continue
        values = forces.sum(axis=1) if feature.kind in OF_FORCE else flat
        growth = np.nan_to_num(noise_growth(values, module.period, feature.seconds), nan=1.0)
        more = NOISE_SQUARES * SHARES[feature.kind] * (growth - 1.0) * np.exp(-2 * load_to_noise)
        square = np.exp(2 * features[:, place]) - LEAST_CHANGE**2
        changed[:, place] = 0.5 * np.log(np.maximum(square - more, 0.0) + LEAST_CHANGE**2)
    return changed


def growths(recordings: Iterable[Recording]) -> np.ndarray:
    """Return the median growth of the noise of the force by lag, over fingers."""
    rows = []
    for recording in recordings:
        for module in recording.modules.values():
            if module.n_samples * module.period > 2 * max(LAGS):
                force = turned(module).sum(axis=1)
                rows.append([noise_growth(force, module.period, lag)[-1] for lag in LAGS])
    return np.sqrt(np.nanmedian(np.array(rows), axis=0))


def corrected_fingers(recording: Recording, fingers: Sequence[RealFinger]) -> list[RealFinger]:
    modules = recording.modules.values()
    return [
        x._replace(features=corrected(x.features, module))
        for x, module in zip(fingers, modules, strict=True)
    ]


def main(folder: Path, real: Path) -> None:
    print_growths(folder, real)
    reader = model_of(untrained())
    sets = RealSets.read(real, reader)
    print(f"| floor | {' | '.join(COLUMNS)} |\n|---{'|--:' * len(COLUMNS)}|")
    print_figures("of white noise", [read_grasp(reader, x) for x in load_dataset(folder)], sets)
    grasps = [read_grasp(reader, x, corrected) for x in load_dataset(folder)]
    carried = boxes(real / "uskin_pick_move")
    pulled = tugs(real / "eflesh_slip")
    sets = RealSets(
        [y for x in carried for y in corrected_fingers(x, real_fingers(reader, x))],
        [(corrected_fingers(x, real_fingers(reader, x)), slipped) for x, slipped in pulled],
    )
    print_figures("of each lag", grasps, sets)


def print_growths(folder: Path, real: Path) -> None:
    streams = {
        "hands": load_dataset(folder),
        "boxes": boxes(real / "uskin_pick_move"),
        "tugs": [recording for recording, _ in tugs(real / "eflesh_slip")],
        "GTac V2": import_recordings(real / "gtac_v2"),
    }
    heads = " | ".join(f"{lag:g} s" for lag in LAGS)
    print(f"| noise over the lag | {heads} |\n|---{'|--:' * len(LAGS)}|")
    for name, recordings in streams.items():
        print(f"| {name} | {' | '.join(f'{x:.2f}' for x in growths(recordings))} |", flush=True)
    print()


def print_figures(title: str, grasps: Sequence[HandGrasp], sets: RealSets) -> None:
    """Print the figures of `ablation_any.py` for some features."""
    moments, folds = moments_of_others(grasps), folds_of(grasps, N_FOLDS)
    parts = zip(*out_of_fold(grasps, moments, folds, moments), strict=True)
    own, default, stable = map(np.concatenate, parts)
    figures = [float(roc_auc_score(stable, values)) for values in (own, default)]
    figures += sets.figures(fit(grasps, moments), EVERYTHING)
    print(f"| {title} | {' | '.join(f'{figure:.3f}' for figure in figures)} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="grasps of randomized hands, three of each")
    parser.add_argument("--real", type=Path, required=True, help="real recordings")
    arguments = parser.parse_args()
    main(arguments.folder, arguments.real)
