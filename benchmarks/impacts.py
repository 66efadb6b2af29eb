"""False slip alarms by kind of impact, and a picture of one impact beside one slip.

    holdfast simulate impacts --profile coupled --cases 2 --repeats 3 --seed 702
    python benchmarks/impacts.py impacts mine.json builtin:twin --plot docs/img/impact.png

The columns: impacts of a finger without a slip near them, the share with a slip alarm of that
finger, and slip alarms of all fingers for each impact of the hand.
"""

import argparse
from collections import defaultdict
from dataclasses import replace

import numpy as np

from holdfast import Model, fingertip_force, load_dataset
from holdfast.metrics.slip_truth import finger_slips, truth_impacts
from holdfast.metrics.slips import count_slips
from holdfast.training.evaluation import compute_decisions

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

    for recording in dataset:
        for finger in recording.modules:
            slips = [x for x in finger_slips(recording.truth, finger) if 3e-4 < x.distance < 2e-3]
            taken = [(x.onset, x.end) for x in finger_slips(recording.truth, finger)]
            knocks = [
                start
                for (start, _), kind in kinds_of(recording.truth).items()
                if kind == "knock" and all(not a - 0.6 < start < b + 0.3 for a, b in taken)
            ]
            if slips and knocks:
                break
        else:
            continue
        break
    module, truth = recording.modules[finger], recording.truth
    force = fingertip_force(module.readings, module.sensor)
    shear = np.linalg.norm(force[:, 1:], axis=1)
    decided = {name: compute_decisions(m, recording).fingers[finger].slip for name, m in models}
    figure, axes = plt.subplots(3, 2, figsize=(11, 7), sharex="col", sharey="row")
    for column, (start, title) in enumerate(
        ((knocks[0], "A knock that moves nothing"), (slips[0].onset, "A slip in a disturbance"))
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


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("dataset")
    parser.add_argument("models", nargs="+")
    parser.add_argument("--plot", help="File of the picture.")
    options = parser.parse_args()
    dataset = load_dataset(options.dataset)
    models = [(name.removesuffix(".json"), Model.load(name)) for name in options.models]
    print("| model | kind | impacts of a finger | with an alarm [%] | alarms for an impact |")
    for name, model in models:
        rows = count(model, dataset)
        rows["all"] = sum(rows.values(), np.zeros(3, dtype=int))
        for kind, (n, fingers, alarms) in rows.items():
            share = 100 * alarms / max(fingers, 1)
            print(f"| {name} | {kind} | {fingers} | {share:.1f} | {alarms / max(n, 1):.2f} |")
    if options.plot:
        draw(options.plot, models, dataset)


if __name__ == "__main__":
    main()
