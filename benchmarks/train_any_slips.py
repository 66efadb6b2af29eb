"""Add the heads of slips to `builtin:any`, trained on randomized hands with a known truth.

    python benchmarks/slip_hands.py hands/ --hands 420
    python benchmarks/train_any_slips.py hands/ --cache samples/ -o src/holdfast/models/any.json
    python benchmarks/train_any_slips.py hands/ --cache samples/ --ablation

`slip` is fitted to recordings that begin with an open hand, `slip_changes` to those that begin in
contact, by slow changes alone. Both are linear in at most 32 features, and read them as they are:
they have no unit, and normalised by own handling they found fewer slips of hands left out (46 for
58 % before 1 mm at one false alarm a minute). Micro-slips under 0.1 mm are neither slips nor
negatives.

Both ship silent: a threshold from other hands gives 0.2 to 23 false alarms a minute on another one.
`calibrate` sets it, and needs to know what a threshold finds: `slip_scores`, quantiles of the
highest scores before 1 mm of the slips of hands that were left out.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from scipy.signal import lfilter
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score
from slip_samples import FingerSamples, read_all

from holdfast.detection import FeatureSpec, Head, Linear, Model
from holdfast.detection.specs import SLIDING_CHOICE, SLIDING_FEATURES, ZERO_KINDS
from holdfast.metrics.slip_curves import LOG_ODDS
from holdfast.metrics.slip_truth import SlipDecisions
from holdfast.metrics.slips import SlipCounter, SlipCounts, slip_metrics
from holdfast.training.head_fits import SLIP_HOLD_TIME, SLIP_SMOOTHING

C = 1e-3
"""Weight of the samples against the penalty on the weights of standardised features."""
QUIET_STEP = 4
"""Every fourth sample of quiet hold is used, with four times its weight."""
EARLY = 0.1
"""Time from the onset of a slip whose samples train `slip` [s]: later it is found (48 for 42 %
before 1 mm on hands left out). `slip_changes` learns all that slides, which real recordings need:
tugs .91 for .87."""
RAISED = 0.005
N_FOLDS = 5
N_QUANTILES = 41
FALSE_ALARMS = 1.0, 1.5, 3.0
EARLIEST = 0.5
"""Time before the onset from which a score counts as that of a slip [s], as in the metrics."""


class Rule(NamedTuple):
    """A linear function of some of the features.

    Attributes:
        columns: in `SLIDING_FEATURES`.
        linear: of these.
    """

    columns: list[int]
    linear: Linear

    def scores(self, samples: FingerSamples) -> np.ndarray:
        """Return (n,) smoothed log odds, as the detector has them; NaN where nothing is held."""
        z = self.linear.decision(samples.features[:, self.columns].astype(float))
        period = float(np.median(np.diff(samples.times)))
        gain = -np.expm1(-period / SLIP_SMOOTHING)
        out = np.full(len(z), np.nan)
        edges = np.flatnonzero(np.diff(np.pad(samples.held.astype(int), 1)))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            first = [(1 - gain) * z[start]]
            out[start:end] = lfilter([gain], [1, gain - 1], z[start:end], zi=first)[0]
        return out


def fit(samples: Sequence[FingerSamples], columns: list[int], early: float | None) -> Rule:
    """Fit a logistic regression to what slides and what holds still, with balanced classes.

    Args:
        samples: of the training.
        columns: of the features.
        early: time from the onset of a slip whose samples are used [s]; None for all that slides.
    """
    features, slides, weights = [], [], []
    for hand in samples:
        sliding = hand.slides & hand.begins(early)
        used = hand.held & (sliding | hand.still)
        is_quiet = hand.truth.quiet & ~sliding
        kept = np.flatnonzero(used & ~is_quiet), np.flatnonzero(used & is_quiet)[::QUIET_STEP]
        rows = np.concatenate(kept)
        features.append(hand.features[rows][:, columns])
        slides.append(sliding[rows])
        weights.append(np.repeat([1.0, QUIET_STEP], [len(kept[0]), len(kept[1])]))
    x, y, weight = (np.concatenate(parts) for parts in (features, slides, weights))
    mean, scale = x.mean(axis=0, dtype=float), x.std(axis=0, dtype=float)
    share = (weight * y).sum() / weight.sum()
    weight = weight * np.where(y, 0.5 / share, 0.5 / (1 - share))
    fitted = LogisticRegression(C=C, max_iter=300).fit((x - mean) / scale, y, sample_weight=weight)
    return Rule(columns, Linear.of(mean, scale, fitted.coef_[0], float(fitted.intercept_[0])))


class Left(NamedTuple):
    """Scores of samples by a rule that was fitted without their hands."""

    samples: FingerSamples
    scores: np.ndarray


def out_of_fold(
    samples: Sequence[FingerSamples], columns: list[int], early: float | None
) -> list[Left]:
    """Return the scores of all samples, by rules that are fitted without a fifth of the hands."""
    hands = {hand: k % N_FOLDS for k, hand in enumerate(sorted({x.hand for x in samples}))}
    left = []
    for fold in range(N_FOLDS):
        rule = fit([x for x in samples if hands[x.hand] != fold], columns, early)
        left += [Left(x, rule.scores(x)) for x in samples if hands[x.hand] == fold]
    return left


def report(name: str, left: Sequence[Left]) -> float:
    """Print what is found at some rates of false alarms, as of calibrated hands; return the AUC.

    The scores of a hand are shifted until 0.5 % of its held samples that do not slide are above 0:
    its own handling sets its threshold.
    """
    by_hand: dict[str, list[np.ndarray]] = {}
    for x, scores in left:
        by_hand.setdefault(x.hand, []).append(scores[x.held & x.still])
    shifts = {
        hand: np.quantile(np.concatenate(parts), 1 - RAISED)
        for hand, parts in by_hand.items()
        if sum(map(len, parts)) > 1 / RAISED
    }
    counts, slides, ranks = [], [], []
    for x, scores in left:
        if x.hand not in shifts:
            continue
        shifted = scores - shifts[x.hand]
        probability = np.where(x.held, 1 / (1 + np.exp(-shifted)), 0.0)
        raised = np.zeros(len(probability), bool)
        decisions = SlipDecisions(x.times, probability, raised, SLIP_HOLD_TIME, x.truth)
        counter = SlipCounter.of(decisions)
        counts.append(counter.count(decisions.raised_at(1 / (1 + np.exp(-LOG_ODDS[::2])))))
        used = x.held & (x.slides | x.still)
        slides.append(x.slides[used])
        ranks.append(shifted[used])
    total = SlipCounts.total(counts)
    metrics = [slip_metrics(total[k]) for k in range(len(total))]
    auc = float(roc_auc_score(np.concatenate(slides), np.concatenate(ranks)))
    cells = []
    for rate in FALSE_ALARMS:
        few = np.array([(m.false_alarms_per_minute["held"] or 0.0) <= rate for m in metrics])
        first = len(few) - int(np.logical_and.accumulate(few[::-1]).sum())
        best = metrics[min(first, len(few) - 1)]
        cells.append(f"{best.before_1mm:.0f} / {best.incipient['0.1']:.0f}")
    print(f"| {name} | {auc:.3f} | {' | '.join(cells)} |", flush=True)
    return auc


def highest_scores(left: Sequence[Left]) -> np.ndarray:
    """Return the highest score of each slip over 1 mm before it has slid 1 mm."""
    highest = []
    for hand, scores in left:
        for slip in hand.truth.slips:
            inside = (hand.times >= slip.onset - EARLIEST) & (hand.times <= slip.reached[0])
            if np.isfinite(slip.reached[0]) and np.isfinite(scores[inside]).any():
                highest.append(float(np.nanmax(scores[inside])))
    return np.array(highest)


def main(options: argparse.Namespace) -> None:
    samples = [s for s in read_all(options.folders, options.cache) if s.held.any()]
    begun = {
        "slip": [s for s in samples if not s.loaded],
        "slip_changes": [s for s in samples if s.loaded],
    }
    print("before 1 mm / within 0.1 s [%] at so many false alarms a minute of held time")
    print(
        "| left out: a fifth of the hands | AUC | "
        + " | ".join(f"{x:g}" for x in FALSE_ALARMS)
        + " |"
    )
    print("|---|---|" + "---|" * len(FALSE_ALARMS))
    changes = tuple(
        x for x in SLIDING_CHOICE
        if x.kind not in (*ZERO_KINDS, "shear_by_load") and not x.kind.startswith("fast")
    )  # fmt: skip
    chosen = {"slip": (SLIDING_CHOICE, EARLY), "slip_changes": (changes, None)}
    if options.ablation:
        for name, specs in ablations().items():
            report(name, out_of_fold(begun["slip"], columns_of(specs), EARLY))
        return
    heads, figures = [], {}
    for name, (specs, early) in chosen.items():
        parts, columns = begun[name], columns_of(specs)
        left = out_of_fold(parts, columns, early)
        hands, slips = len({s.hand for s in parts}), sum(len(s.truth.slips) for s in parts)
        text = f"{name}: {hands} hands, {slips} slips, {len(specs)} features"
        figures[f"auc_{name}"] = report(text, left)
        scores = np.quantile(highest_scores(left), np.linspace(0, 1, N_QUANTILES))
        heads.append(
            Head(
                name=name, link="logit", features=specs, rule=fit(parts, columns, early).linear,
                threshold=1.0, smoothing=SLIP_SMOOTHING, hold=SLIP_HOLD_TIME,
                slip_scores=tuple(scores.round(3).tolist()),
            )
        )  # fmt: skip
    if options.out is not None:
        save(Model.load(options.model), heads, figures, options.out)


def columns_of(specs: Sequence[FeatureSpec]) -> list[int]:
    return [SLIDING_FEATURES.index(spec) for spec in specs]


def ablations() -> dict[str, tuple[FeatureSpec, ...]]:
    """Return lists of features: all, the choice, and both without each family."""
    fast = tuple(x for x in SLIDING_CHOICE if x.kind.startswith("fast"))
    lists = {"all": SLIDING_FEATURES, "the choice": SLIDING_CHOICE}
    families = {
        "absolute ratio and margin": ZERO_KINDS, "fast energy": tuple({x.kind for x in fast}),
        "divergence of shear": ("divergence", "relative_divergence"),
        "centre of pressure": ("centre_shift",), "alignment": ("alignment",),
        "shares of taxels": ("falling_share", "rising_share"),
        "changes by the load": ("shear_by_load", "normal_by_load", "force_by_load"),
    }  # fmt: skip
    for family, kinds in families.items():
        lists[f"the choice without {family}"] = tuple(
            x for x in SLIDING_CHOICE if x.kind not in kinds
        )
    return lists


def save(model: Model, heads: Sequence[Head], figures: dict[str, float], out: Path) -> None:
    part = model.finger("*").without_heads("slip").with_heads(*heads)
    changed = msgspec.structs.replace(model, fingers={"*": part}, name=out.stem)
    if model.training is not None:
        before = model.training.figures | figures
        training = msgspec.structs.replace(model.training, figures=before)
        changed = msgspec.structs.replace(changed, training=training)
    changed.save(out, force=True)
    print(f"{out} written")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--cache", type=Path, required=True)
    parser.add_argument("--model", default="builtin:any", help="gets the heads")
    parser.add_argument("--ablation", action="store_true", help="compare lists of features")
    parser.add_argument("-o", "--out", type=Path)
    main(parser.parse_args())
