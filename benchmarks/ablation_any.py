"""Ablation of builtin:any: target, normalisation and families of features; twin and real.

    holdfast simulate hands/ --randomize --measured scan,filter,noise,vibration \\
        --repeats 150 --grasps 3 --seed 0
    python benchmarks/ablation_any.py hands/ --real "$HOLDFAST_DATA"

The weights are fitted as in `train_any.py`, on four fifths of the hands for the simulated figures,
and on all hands for the real ones. On hands: AUC of stable against sliding, with own handling (the
other grasps of the hand) and with default handling. On real recordings, with own handling and with
default handling: AUC of stable against slip of the two boxes that slip (own handling: the boxes
that do not), and AUC by sequence of the largest score of the tugs (own handling: the first half
second of the other half of the sequences).
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import starmap
from pathlib import Path
from typing import NamedTuple

import numpy as np
from hand_handling import (
    NORMALISED_BY,
    HandGrasp,
    Moments,
    folds_of,
    moments_by,
    moments_of_others,
    read_grasp,
)
from real_sets import TUG_START, fingers_of, slips_in
from real_slips import auc, boxes, tugs
from sklearn.metrics import roc_auc_score
from train_any import FEATURES, N_FOLDS, fit, model_of, out_of_fold, untrained

from holdfast.classifiers import Linear
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN
from holdfast.features.stream import extract
from holdfast.io import load_dataset
from holdfast.model import Model
from holdfast.recordings import Recording
from holdfast.training.calibration import location_and_scale

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
COLUMNS = (
    "hands, own",
    "hands, default",
    "boxes, own",
    "boxes, default",
    "tugs, own",
    "tugs, default",
)
SHIPPED = "others"
"""What the features are normalised by in the training of the model that ships."""
EVERYTHING = np.ones(len(FEATURES), dtype=bool)

Normalisation = Callable[[Sequence[HandGrasp]], list[Moments | None]]


class RealFinger(NamedTuple):
    """Features of one finger of one real recording, and what is known of it."""

    recording: str
    features: np.ndarray
    held: np.ndarray
    stable: np.ndarray
    slips: np.ndarray
    times: np.ndarray


@dataclass(frozen=True)
class RealSets:
    """Features of the real recordings."""

    boxes: list[RealFinger]
    tugs: list[tuple[list[RealFinger], bool]]

    @classmethod
    def read(cls, folder: Path, model: Model) -> "RealSets":
        return cls(
            [x for item in boxes(folder / "uskin_pick_move") for x in real_fingers(model, item)],
            [(real_fingers(model, x), slipped) for x, slipped in tugs(folder / "eflesh_slip")],
        )

    def figures(self, classifier: Linear, used: np.ndarray) -> list[float]:
        """Return the AUC of boxes and tugs, each with own and default handling."""
        slipping = {finger.recording for finger in self.boxes if finger.slips.any()}
        calm = [finger for finger in self.boxes if finger.recording not in slipping]
        own = location_and_scale(np.concatenate([x.features[x.held] for x in calm]))
        figures = []
        for moments in (own, None):
            parts = [
                (score(classifier, x.features, used, moments), x)
                for x in self.boxes
                if x.recording in slipping
            ]
            aucs = [
                auc(*(
                    np.concatenate([values[mask(x)] for values, x in parts if x.recording == name])
                    for mask in (lambda x: x.slips, lambda x: x.stable)
                ))
                for name in sorted(slipping)
            ]  # fmt: skip
            figures.append(float(np.mean(aucs)))
        return [*figures, self.tug_auc(classifier, used, own=True), self.tug_auc(classifier, used)]

    def tug_auc(self, classifier: Linear, used: np.ndarray, *, own: bool = False) -> float:
        largest: tuple[list[float], list[float]] = [], []
        for half in (0, 1):
            moments = None
            if own:
                starts = [
                    x.features[x.held & (x.times < TUG_START)]
                    for fingers, _ in self.tugs[half::2]
                    for x in fingers
                ]
                moments = location_and_scale(np.concatenate(starts))
            for fingers, slipped in self.tugs[1 - half :: 2]:
                late = [x.features[x.times >= TUG_START] for x in fingers]
                values = [score(classifier, rows, used, moments) for rows in late]
                largest[int(slipped)].append(max(float(np.nanmax(part)) for part in values))
        held, slips = largest
        return auc(np.array(slips), np.array(held))


def main(folder: Path, real: Path) -> None:
    reader = model_of(untrained())
    grasps = list(starmap(read_grasp, ((reader, item) for item in load_dataset(folder))))
    sets, folds = RealSets.read(real, reader), folds_of(grasps, N_FOLDS)
    print(f"| {len(grasps)} grasps | {' | '.join(COLUMNS)} |\n|---{'|--:' * len(COLUMNS)}|")

    others = moments_of_others(grasps)

    def row(title: str, moments: list[Moments | None], used: np.ndarray = EVERYTHING) -> None:
        cut = [grasp._replace(features=np.where(used, grasp.features, 0.0)) for grasp in grasps]
        parts = (None if own is None else only(own, used) for own in moments)
        kept = list(parts)
        handling = [own and only(own, used) for own in others]
        parts = zip(*out_of_fold(cut, kept, folds, handling), strict=True)
        own, default, stable = map(np.concatenate, parts)
        figures = [float(roc_auc_score(stable, values)) for values in (own, default)]
        figures += sets.figures(fit(cut, kept), used)
        print(f"| {title} | {' | '.join(f'{figure:.3f}' for figure in figures)} |", flush=True)

    for name in NORMALISED_BY:
        row(f"normalised by: {name}", moments_by(name, grasps))
    for name, family in FAMILIES.items():
        row(f"without {name}", moments_by(SHIPPED, grasps), ~family)


def only(moments: Moments, used: np.ndarray) -> Moments:
    """Return the moments; 0 and 1 of features that are left out."""
    return np.where(used, moments[0], 0.0), np.where(used, moments[1], 1.0)


def score(
    classifier: Linear, features: np.ndarray, used: np.ndarray, moments: Moments | None
) -> np.ndarray:
    """Return one minus the probability of stability, with own or default handling."""
    if moments is not None:
        location, scale = moments
        values = (features - location) / scale * np.array(classifier.scale)
        features = values + np.array(classifier.mean)
    return 1.0 - classifier.probability(np.where(used, features, 0.0))


def real_fingers(model: Model, recording: Recording) -> list[RealFinger]:
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    rows = extract(model.plan(sensors, recording.rate), recording)
    parts = zip(rows.items(), fingers_of(model, recording), strict=True)
    return [
        RealFinger(
            recording.name,
            finger.features,
            np.isfinite(finger.features).all(axis=1)
            & (known.trace.state != NO_CONTACT)
            & (known.trace.state != UNKNOWN),
            known.labels == STABLE,
            known.slips & slips_in(recording),
            known.trace.times,
        )
        for (_, finger), known in parts
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--real", type=Path, required=True)
    options = parser.parse_args()
    main(options.folder, options.real)
