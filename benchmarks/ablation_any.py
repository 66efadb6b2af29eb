"""Leave families of features out of builtin:any, or use one alone: hands left out, and real data.

    holdfast simulate hands/ --randomize --repeats 300 --seed 0
    python benchmarks/ablation_any.py hands/ --real "$HOLDFAST_DATA"

The weights are fitted as in train_any.py, on four fifths of the hands for the simulated figures,
and on all hands for the real ones. AUC is of stable against slip. The real recordings choose
nothing: the table is the only thing that is made of them.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from sklearn.metrics import roc_auc_score
from train_any import FEATURES, N_FOLDS, HandSamples, fit, samples_of

from holdfast.io import load_dataset
from holdfast.io.importers import import_recordings

KINDS = np.array([feature.kind for feature in FEATURES])
LAGS = np.array([feature.seconds for feature in FEATURES])
FAMILIES = {
    "change of the force": np.isin(KINDS, ("force_change", "shear_change")),
    "taxels against their mean": np.isin(KINDS, ("residual", "shear_residual")),
    "centre of pressure": KINDS == "pressure_shift",
    "moment about the normal": KINDS == "moment_change",
    "ratio of load to noise": KINDS == "load_to_noise",
    "lags up to 67 ms": (LAGS < 0.1) & (KINDS != "load_to_noise"),
    "lags from 133 ms on": LAGS > 0.1,
}
SCALE = KINDS == "load_to_noise"
"""Kept beside every family that is used alone: what a change means depends on it."""


def main(folder: Path, real: Path | None) -> None:
    hands = [samples_of(recording) for recording in load_dataset(folder)]
    folds = np.random.default_rng(0).integers(N_FOLDS, size=len(hands))
    fingers = list(real_fingers(real)) if real else []
    names = " | ".join(name for name, _, _ in fingers)
    print(f"| features | hands left out | {names} |")
    print("|---" * (2 + len(fingers)) + "|")
    everything = np.ones(len(FEATURES), dtype=bool)
    row("all", everything, hands, folds, fingers)
    for name, own in FAMILIES.items():
        row(f"without {name}", ~own, hands, folds, fingers)
        if name != "ratio of load to noise":
            row(f"{name} alone", own | SCALE, hands, folds, fingers)


def row(title: str, used: np.ndarray, hands: list[HandSamples], folds: np.ndarray, fingers) -> None:
    cut = [hand._replace(features=np.where(used, hand.features, 0.0)) for hand in hands]
    probability, stable, slip = [], [], []
    for fold in range(N_FOLDS):
        classifier = fit(cut, folds != fold)
        for k in np.flatnonzero(folds == fold):
            probability.append(classifier.probability(cut[k].features))
            stable.append(hands[k].stable)
            slip.append(hands[k].slip)
    simulated = auc(*map(np.concatenate, (probability, stable, slip)))
    whole = fit(cut, np.ones(len(hands), dtype=bool))
    figures = [simulated]
    figures += [auc(whole.probability(np.where(used, f, 0.0)), s, ~s) for _, f, s in fingers]
    print(f"| {title} | {' | '.join(f'{each:.3f}' for each in figures)} |", flush=True)


def auc(probability: np.ndarray, stable: np.ndarray, slip: np.ndarray) -> float:
    chosen = stable | slip
    return float(roc_auc_score(stable[chosen], probability[chosen]))


def real_fingers(folder: Path) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield name, features and stable of each finger of the real recordings with a slip."""
    for recording in import_recordings(folder / "uskin_pick_move"):
        for name, module in recording.modules.items():
            found = samples_of(replace(recording, modules={name: module}))
            if found.stable.any() and not found.stable.all():
                yield f"{recording.name[-14:]} {name}", found.features, found.stable


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--real", type=Path)
    given = parser.parse_args()
    main(given.folder, given.real)
