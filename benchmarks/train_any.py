"""Train builtin:any on randomized hands of the twin, and evaluate it on hands left out.

    holdfast simulate hands/ --randomize --repeats 300 --seed 0
    python benchmarks/train_any.py hands/ -o src/holdfast/models/any.json

`train_slips.py` and `train_causes.py` add the rules of slip and of causes.

Nothing here reads a real recording. Samples labelled no contact are left out: the threshold on
the load separates them.
"""

import argparse
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit
from sklearn.metrics import roc_auc_score

from holdfast.classifiers.linear import LinearClassifier
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, Cause
from holdfast.features import Tare, parse_features
from holdfast.features.stream import StreamPlan, extract
from holdfast.io import load_dataset
from holdfast.model import Debounce, FingerModel, Model, Training
from holdfast.recordings import Recording

FEATURES = parse_features("any")
MAX_RATE = 20.0
"""Samples per second that are kept of each recording [Hz]; neighbours are nearly copies."""
C = 1e-3
"""Weight of the samples against the penalty on the weights."""
LOAD_TO_NOISE_OF_CONTACT = 10.0
"""Threshold of contact, in multiples of the noise of the force: 6 standard deviations."""
HOLD = 0.1
N_FOLDS = 5


class HandSamples(NamedTuple):
    """Samples of one recording: features, labels (`cause` as text), and the kind of sensor."""

    features: np.ndarray
    stable: np.ndarray
    cause: np.ndarray
    kind: str

    @property
    def slip(self) -> np.ndarray:
        return self.cause == Cause.SLIP


def main(folder: Path, out: Path | None) -> None:
    recordings = load_dataset(folder)
    hands = [samples_of(recording) for recording in recordings]
    digests = {recording.name: recording.digest for recording in recordings}
    kinds = np.array([hand.kind for hand in hands])
    by_hand = np.random.default_rng(0).integers(N_FOLDS, size=len(hands))
    print(f"{len(hands)} hands, {sum(len(h.stable) for h in hands)} samples")
    print(
        "| left out | stable against unstable | stable against slip | calibration error | hands |"
    )
    print("|---|---|---|---|---|")
    pooled = report("a fifth of the hands", hands, by_hand)
    for kind in sorted(set(kinds)):
        chosen = kinds == kind
        report(f"{kind}, of a fifth of the hands", hands, by_hand, chosen)
        report(f"{kind}, all hands with it", hands, np.where(chosen, 0, -1), chosen)
    if out is not None:
        save(hands, digests, pooled, out)


def samples_of(recording: Recording) -> HandSamples:
    sensors = {n: m.sensor for n, m in recording.modules.items() if m.n_samples > 30}
    plan = StreamPlan(
        sensors, dict.fromkeys(sensors, FEATURES), 14, Tare.parse("first"), recording.rate
    )
    found = extract(plan, recording) if sensors else {}
    rows, stable, cause = [np.empty((0, len(FEATURES)))], [np.empty(0, bool)], [np.empty(0, "U12")]
    step = max(1, round(recording.rate / MAX_RATE))
    for name, finger in found.items():
        module = recording.modules[name]
        states = module.label_states
        causes = np.full(len(states), "", dtype="U12")
        for label in module.labels:
            inside = slice(*np.searchsorted(module.times, (label.start, label.end)))
            causes[inside] = label.cause or ""
        kept = np.arange(len(states)) % step == 1 % step
        kept &= (states != UNKNOWN) & (states != NO_CONTACT)
        kept &= np.isfinite(finger.features).all(axis=1)
        rows.append(finger.features[kept])
        stable.append(states[kept] == STABLE)
        cause.append(causes[kept])
    kind = str(recording.metadata.get("sensor_kind", ""))
    return HandSamples(np.concatenate(rows), np.concatenate(stable), np.concatenate(cause), kind)


def fit(hands: list[HandSamples], chosen: np.ndarray) -> LinearClassifier:
    """Fit a logistic regression in which more change is never more stable.

    The sign of every weight is fixed, except that of the ratio of load to noise. This costs
    next to nothing on randomized hands, and keeps features that correlate on them from
    cancelling where they do not.
    """
    used = [hands[k] for k in np.flatnonzero(chosen)]
    features = np.concatenate([hand.features for hand in used])
    sign = np.where(np.concatenate([hand.stable for hand in used]), 1.0, -1.0)
    mean, scale = features.mean(axis=0), features.std(axis=0)
    scale[scale == 0] = 1.0  # a feature that an ablation leaves out
    standardised = (features - mean) / scale

    def loss(weights: np.ndarray) -> tuple[float, np.ndarray]:
        margins = sign * (standardised @ weights[1:] + weights[0])
        slopes = -sign * expit(-margins)
        gradient = np.concatenate([[slopes.sum()], standardised.T @ slopes + weights[1:] / C])
        penalty = float(weights[1:] @ weights[1:]) / (2 * C)
        return float(np.logaddexp(0, -margins).sum()) + penalty, gradient

    free, falling = (None, None), (None, 0.0)
    bounds = [free, *(free if f.kind == "load_to_noise" else falling for f in FEATURES)]
    found = minimize(loss, np.zeros(1 + len(FEATURES)), jac=True, bounds=bounds, method="L-BFGS-B")
    return LinearClassifier(tuple(mean), tuple(scale), tuple(found.x[1:]), found.x[0])


def report(
    title: str, hands: list[HandSamples], folds: np.ndarray, shown: np.ndarray | None = None
) -> dict[str, float]:
    """Print the AUC of predictions out of fold; fold -1 is never left out."""
    shown = np.ones(len(hands), dtype=bool) if shown is None else shown
    probability, stable, slip = map(
        np.concatenate, zip(*out_of_fold(hands, folds, shown), strict=True)
    )
    contact = roc_auc_score(stable, probability)
    of_slip = roc_auc_score(stable[stable | slip], probability[stable | slip])
    error = calibration_error(probability, stable)
    print(f"| {title} | {contact:.3f} | {of_slip:.3f} | {error:.3f} | {shown.sum()} |", flush=True)
    return {"auc": float(contact), "auc_slip": float(of_slip)}


def calibration_error(probability: np.ndarray, stable: np.ndarray) -> float:
    """Mean distance of probability and share of stable samples over ten bins."""
    bins = np.minimum((10 * probability).astype(int), 9)
    return sum(
        abs(probability[bins == b].mean() - stable[bins == b].mean()) * (bins == b).mean()
        for b in np.unique(bins)
    )


def out_of_fold(hands, folds, shown) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    for fold in sorted(set(folds[shown]) - {-1}):
        classifier = fit(hands, folds != fold)
        for k in np.flatnonzero((folds == fold) & shown):
            if len(hands[k].stable):
                yield classifier.probability(hands[k].features), hands[k].stable, hands[k].slip


def model_of(classifier, training: Training | None = None) -> Model:
    finger = FingerModel(
        features=FEATURES,
        classifier=classifier,
        contact_load=LOAD_TO_NOISE_OF_CONTACT,
    )
    return Model(
        fingers={"*": finger},
        tare="first",
        debounce=Debounce(hold=HOLD),
        training=training,
        name="any",
    )


def save(
    hands: list[HandSamples],
    digests: dict[str, str],
    figures: dict[str, float],
    out: Path,
) -> None:
    classifier = fit(hands, np.ones(len(hands), dtype=bool))
    training = Training(
        recordings=digests,
        split="a fifth of the hands",
        parameters={"*": {"C": C, "class_weight": None}},
        figures=figures,
        versions={name: version(name) for name in ("holdfast", "numpy", "scikit-learn")},
    )
    model_of(classifier, training).save(out, force=True)
    print(f"{out} written")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--out", type=Path)
    given = parser.parse_args()
    main(given.folder, given.out)
