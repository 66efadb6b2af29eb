"""False slip alarms by kind of impact, and a picture of one impact beside one slip.

    holdfast simulate impacts --profile coupled --cases 2 --repeats 3 --seed 702
    python benchmarks/impacts.py impacts mine.json builtin:twin --plot docs/img/impact.png

The columns: impacts of the hand; of those that move no finger by a slip, counted for each finger,
their number and the share with a slip alarm of that finger; alarms of four fingers for an impact.
With --beside, also the AUC of each feature of slips there and in another folder.
"""

import argparse
from collections import defaultdict
from dataclasses import replace

import numpy as np
from scipy.stats import rankdata, spearmanr
from train_slips import plan_of

from holdfast import Model, fingertip_force, load_dataset
from holdfast.detection.specs import SLIP_FEATURES
from holdfast.metrics.slip_truth import STILL_SPEED, finger_slips, truth_impacts
from holdfast.metrics.slips import count_slips
from holdfast.parallel import Engine
from holdfast.training.evaluation import compute_decisions
from holdfast.training.training_samples import gather_samples

AROUND = (0.15, 0.45)
"""Time before and after the event in the picture [s]."""


def kinds_of(truth):
    """Return the kind of each impact, by its begin and end."""
    kinds = truth.hand["impact"]
    return {
        span: str(kinds[np.searchsorted(truth.times, span[0])]) for span in truth_impacts(truth)
    }


def count(model, dataset):
    """Return by kind: impacts of the hand, of fingers, those with an alarm."""
    rows = defaultdict(lambda: np.zeros(3, dtype=int))
    for recording in dataset:
        kinds = kinds_of(recording.truth)
        decisions = compute_decisions(model, recording)
        for kind in kinds.values():
            rows[kind] += [1, 0, 0]
        for finger in decisions.fingers.values():
            for kind in set(kinds.values()):
                spans = tuple(span for span, name in kinds.items() if name == kind)
                truth = replace(finger.slip.truth, impacts=spans)
                counts = count_slips(replace(finger.slip, truth=truth))
                rows[kind] += [0, counts.n_impacts, counts.false_impacts]
    return rows


def draw(path, models, dataset):
    """Draw a knock without a slip, and a slip in a push, of one finger."""
    import matplotlib.pyplot as plt

    found = []
    for recording in dataset:
        for finger in recording.modules:
            times, speed = recording.truth.times, recording.truth.fingers[finger]["slip_speed"]
            force = np.linalg.norm(recording.truth.fingers[finger]["contact_force"], axis=1)
            slips = [
                slip.onset
                for slip in finger_slips(recording.truth, finger)
                if 3e-4 < slip.distance < 2e-3
            ]
            for (start, end), kind in kinds_of(recording.truth).items():
                rows = slice(*np.searchsorted(times, (start - 0.1, end + 0.3)))
                if kind == "knock" and slips and speed[rows].max() < STILL_SPEED:
                    found.append((np.ptp(force[rows]), recording, finger, start, slips[0]))
    _, recording, finger, *starts = max(found, key=lambda row: row[0])
    module, truth = recording.modules[finger], recording.truth
    force = fingertip_force(module.readings, module.sensor)
    shear = np.linalg.norm(force[:, 1:], axis=1)
    decided = {name: compute_decisions(m, recording).fingers[finger].slip for name, m in models}
    figure, axes = plt.subplots(3, 2, figsize=(11, 7), sharex="col", sharey="row")
    for column, (start, title) in enumerate(
        zip(starts, ("The hardest knock that moves nothing", "A slip"), strict=True)
    ):
        limits = start - AROUND[0], start + AROUND[1]
        shown = slice(*np.searchsorted(module.times, limits))
        axes[0, column].set_title(f"{title} ({recording.name}, {finger})", fontsize=10)
        axes[0, column].plot(1e3 * (module.times[shown] - start), shear[shown], color="#1f6fb2")
        speed = truth.fingers[finger]["slip_speed"]
        rows = slice(*np.searchsorted(truth.times, limits))
        axes[1, column].plot(1e3 * (truth.times[rows] - start), 1e3 * speed[rows], color="#c0392b")
        axes[1, column].axhline(1.0, color="grey", lw=0.8, ls="--")
        for (name, slip), style in zip(decided.items(), ("-", "--", ":"), strict=False):
            rows = slice(*np.searchsorted(slip.times, limits))
            axes[2, column].plot(
                1e3 * (slip.times[rows] - start), slip.probability[rows], style, label=name
            )
        axes[2, column].set_xlabel("time [ms]")
        for ax in axes[:, column]:
            ax.axvline(0, color="black", lw=0.8)
            ax.grid(alpha=0.3)
    for ax, label in zip(
        axes[:, 0], ("shear [count]", "slip speed [mm/s]", "probability of a slip"), strict=True
    ):
        ax.set_ylabel(label)
    axes[2, 0].legend(loc="upper right", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=100)


def print_slips(folder):
    """Print how slips begin: by an impact or not, how far they go, what slides before."""
    distances, shares, n_by_impact = [], [], 0
    for recording in load_dataset(folder):
        truth = recording.truth
        spans = [(start, end + 0.05) for start, end in truth_impacts(truth)]
        for arrays, finger in ((truth.fingers[name], name) for name in recording.modules):
            for slip in finger_slips(truth, finger):
                distances.append(1e3 * slip.distance)
                n_by_impact += any(start <= slip.onset < end for start, end in spans)
                before = np.searchsorted(truth.times, slip.onset - 0.02)
                shares.append(arrays["slipping_share"][before])
    slid, sliding = np.median(distances), np.mean(np.array(shares) > 0.1)
    print(f"{folder}: {len(distances)} slips, {n_by_impact} by an impact; {slid:.2f} mm (median); "
          f"{100 * sliding:.0f} % had a tenth of the load sliding 20 ms before")  # fmt: skip


def auc_by_feature(folder):
    """Return the AUC of each feature, sliding against still: of its size where that is better."""
    recordings, model = list(load_dataset(folder)), Model.load("builtin:any")
    samples = gather_samples(recordings, plan_of(model, recordings, SLIP_FEATURES), Engine(1))
    samples = samples.of("slip")["*"]
    n = samples.n_positive
    sums = np.array(
        [rankdata(values, axis=0)[samples.values > 0].sum(axis=0)
         for values in (samples.features, np.abs(samples.features))]
    )  # fmt: skip
    auc = (sums - n * (n + 1) / 2) / (n * (len(samples.values) - n))
    return np.maximum(auc, 1 - auc).max(axis=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("dataset")
    parser.add_argument("models", nargs="+")
    parser.add_argument("--plot", help="File of the picture.")
    parser.add_argument("--beside", help="Folder of recordings to compare features with.")
    options = parser.parse_args()
    dataset = load_dataset(options.dataset)
    models = [(name.removesuffix(".json"), Model.load(name)) for name in options.models]
    print("| model | kind | impacts | of a finger | with an alarm [%] | alarms for an impact |")
    for name, model in models:
        rows = count(model, dataset)
        rows["all"] = sum(rows.values(), np.zeros(3, dtype=int))
        for kind, (n, fingers, alarms) in rows.items():
            share = alarms / max(fingers, 1)
            print(f"| {name} | {kind} | {n} | {fingers} | {100 * share:.1f} | {4 * share:.2f} |")
    if options.beside:
        for folder in (options.dataset, options.beside):
            print_slips(folder)
        here, there = auc_by_feature(options.dataset), auc_by_feature(options.beside)
        print(f"{len(here)} features, rank correlation {spearmanr(here, there).statistic:.2f}")
        for k in np.argsort(-np.maximum(here, there)):
            print(f"{SLIP_FEATURES[k]} {here[k]:.3f} {there[k]:.3f}")
    if options.plot:
        draw(options.plot, models, dataset)


if __name__ == "__main__":
    main()
