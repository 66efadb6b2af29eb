"""Train builtin:any on randomized hands of the twin, and evaluate it on hands left out.

    holdfast simulate hands/ --randomize --measured scan,filter,noise,vibration \\
        --repeats 150 --grasps 3 --seed 0
    python benchmarks/train_any.py hands/ -o any.json
    python benchmarks/train_slips.py any.json hands/ -o any.json
    python benchmarks/train_causes.py any.json hands/ -o src/holdfast/models/any.json

The features of a grasp are normalised by the other grasps of the same hand, as a user's are by own
handling. Class 1 is labelled stable. Class 0 slides, or is unstable for at most 0.2 s: what is
disturbed for longer may look as still as a hold, and is left out. Both classes weigh alike. Default
handling is that of all hands. The threshold is the one at which 95 % of the stable samples of hands
left out are called stable, with default handling. Nothing here reads a real recording.
"""

import argparse
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
from hand_handling import (
    NORMALISED_BY,
    HandGrasp,
    Moments,
    default_handling,
    folds_of,
    moments_by,
    moments_of_others,
    read_grasp,
)
from scipy.optimize import minimize
from scipy.special import expit
from sklearn.metrics import roc_auc_score

from holdfast.detection import (
    Debounce,
    FeatureSpec,
    FingerModel,
    Head,
    Linear,
    Model,
    Training,
    parse_features,
)
from holdfast.errors import DISTRIBUTION
from holdfast.io import load_dataset

FEATURES = parse_features("any")
C = 1e-3
"""Weight of the samples against the penalty on the weights."""
LOAD_TO_NOISE_OF_CONTACT = 10.0
"""Threshold of contact, in multiples of the noise of the force: 6 standard deviations."""
HOLD = 0.1
SWITCHING = 15.3
"""Rate of the forward filter of the states [1/s]: 0.8 to stay as it is for 1/60 s."""
STABLE_SHARE = 0.95
N_FOLDS = 5


def main(folder: Path, out: Path | None, normalised_by: str) -> None:
    recordings = load_dataset(folder)
    reader = model_of(untrained())
    grasps = [read_grasp(reader, recording) for recording in recordings]
    others = moments_of_others(grasps)
    moments = moments_by(normalised_by, grasps)
    folds = folds_of(grasps, N_FOLDS)
    kinds = np.array([grasp.kind for grasp in grasps])
    print(f"{len(grasps)} grasps of {len({grasp.hand for grasp in grasps})} hands")
    print("| left out | own handling: AUC | default handling: AUC | unstable found |")
    print("|---|---|---|---|")
    figures, threshold = report("a fifth of the hands", grasps, moments, folds, others)
    for kind in sorted(set(kinds)):
        chosen = kinds == kind
        report(f"all hands with {kind}", grasps, moments, np.where(chosen, 0, -1), others)
    if out is not None:
        digests = {recording.name: recording.digest for recording in recordings}
        save(fit(grasps, moments), threshold, digests, figures, out)


def fit(
    grasps: Sequence[HandGrasp],
    moments: Sequence[Moments | None],
    features: Sequence[FeatureSpec] = FEATURES,
) -> Linear:
    """Fit a logistic regression in which more change is never more stable.

    The sign of every weight is fixed, except that of the ratio of load to noise. This costs
    next to nothing on randomized hands, and keeps features that correlate on them from
    cancelling where they do not.

    Returns:
        The classifier, whose mean and scale are those of default handling.
    """
    values, stable = training_samples(grasps, moments)
    sign = np.where(stable, 1.0, -1.0)
    weight = np.where(stable, 0.5 / stable.mean(), 0.5 / (~stable).mean())
    mean, spread = values.mean(axis=0), values.std(axis=0)
    spread[spread == 0] = 1.0  # a feature that an ablation leaves out
    standard = (values - mean) / spread

    def loss(weights: np.ndarray) -> tuple[float, np.ndarray]:
        margins = sign * (standard @ weights[1:] + weights[0])
        slopes = -sign * weight * expit(-margins)
        gradient = np.concatenate([[slopes.sum()], standard.T @ slopes + weights[1:] / C])
        penalty = float(weights[1:] @ weights[1:]) / (2 * C)
        return float(weight @ np.logaddexp(0, -margins)) + penalty, gradient

    free, falling = (None, None), (None, 0.0)
    bounds = [free, *(free if f.kind == "load_to_noise" else falling for f in features)]
    fitted = minimize(loss, np.zeros(1 + len(features)), jac=True, bounds=bounds, method="L-BFGS-B")
    coefficients = fitted.x[1:] / spread
    location, scale = default_handling(grasps)
    return Linear.of(location, scale, coefficients, fitted.x[0] - coefficients @ mean)


def training_samples(
    grasps: Sequence[HandGrasp], moments: Sequence[Moments | None]
) -> tuple[np.ndarray, np.ndarray]:
    """Return normalised features and whether they are stable, of the grasps with own handling."""
    values, stable = [], []
    for grasp, moment in zip(grasps, moments, strict=True):
        if moment is not None:
            used = is_used(grasp)
            values.append(grasp.normalised(moment).features[used])
            stable.append(is_stable(grasp)[used])
    return np.concatenate(values), np.concatenate(stable)


def is_used(grasp: HandGrasp) -> np.ndarray:
    """Return (n,) which samples train: in contact, sliding, at an onset or labelled stable."""
    return grasp.held & (grasp.slides | grasp.onset | is_stable(grasp))


def is_stable(grasp: HandGrasp) -> np.ndarray:
    """Return (n,) which samples are of class 1."""
    return grasp.stable & grasp.still


def report(
    title: str,
    grasps: Sequence[HandGrasp],
    moments: Sequence[Moments | None],
    folds: np.ndarray,
    handling: Sequence[Moments | None],
) -> tuple[dict[str, float], float]:
    """Print the metrics of predictions out of fold; fold -1 is never left out.

    Returns:
        The metrics by name, and the threshold.
    """
    parts = zip(*out_of_fold(grasps, moments, folds, handling), strict=True)
    handled, default, stable = (np.concatenate(part) for part in parts)
    names, values = ("auc", "auc_default"), (handled, default)
    figures = {name: float(roc_auc_score(stable, p)) for name, p in zip(names, values, strict=True)}
    threshold = float(np.quantile(default[stable], 1 - STABLE_SHARE))
    share = float((default[~stable] < threshold).mean())
    print(
        f"| {title} | {figures['auc']:.3f} | {figures['auc_default']:.3f} | {share:.2f} |",
        flush=True,
    )
    return figures, threshold


def out_of_fold(
    grasps, moments, folds, handling
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield probabilities with own and default handling, and the class, of each grasp."""
    for fold in sorted(set(folds) - {-1}):
        training = np.flatnonzero(folds != fold)
        classifier = fit([grasps[k] for k in training], [moments[k] for k in training])
        middle = np.array(classifier.mean), np.array(classifier.scale)
        for k in np.flatnonzero(folds == fold):
            handling_moments, used = handling[k], is_used(grasps[k])
            if handling_moments is None or not used.any():
                continue
            # The same classifier with another location and scale.
            calibrated = grasps[k].normalised(handling_moments).features * middle[1] + middle[0]
            yield (
                classifier.probability(calibrated[used]),
                classifier.probability(grasps[k].features[used]),
                is_stable(grasps[k])[used],
            )


def untrained() -> Linear:
    """Return a rule that knows nothing, for features and contact."""
    zeros = np.zeros(len(FEATURES))
    return Linear.of(zeros, zeros + 1.0, zeros, 0.0)


def model_of(rule: Linear, threshold: float = 0.5, training: Training | None = None) -> Model:
    stable = Head(name="stable", link="logit", features=FEATURES, rule=rule, threshold=threshold)
    finger = FingerModel(heads=(stable,), contact_load=LOAD_TO_NOISE_OF_CONTACT, normalised=True)
    return Model(
        fingers={"*": finger},
        tare="first",
        debounce=Debounce(hold=HOLD, switching=SWITCHING),
        training=training,
        name="any",
    )


def save(
    classifier: Linear,
    threshold: float,
    digests: dict[str, str],
    figures: dict[str, float],
    out: Path,
) -> None:
    training = Training(
        recordings=digests,
        split="a fifth of the hands",
        parameters={"*": {"C": C, "class_weight": "balanced"}},
        figures=figures,
        versions={name: version(name) for name in (DISTRIBUTION, "numpy", "scikit-learn")},
    )
    model_of(classifier, threshold, training).save(out, force=True)
    print(f"threshold {threshold:.3f}; {out} written")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--out", type=Path)
    parser.add_argument("--normalised-by", choices=NORMALISED_BY, default="others")
    options = parser.parse_args()
    main(options.folder, options.out, options.normalised_by)
