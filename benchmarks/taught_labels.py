"""What the labels of a camera teach, beside the truth: the table of docs/teach.md.

holdfast simulate filmed/ --cases 2 --repeats 1 --seed 7201 --video
holdfast label auto tracking filmed/
holdfast simulate fresh/ --cases 2 --repeats 3 --seed 7201
python benchmarks/taught_labels.py filmed/ fresh/

One seed is one hand; grasps that were filmed are left out of the fresh ones. The same filmed grasps
teach four times: with what the camera does not see as no slip; with its three kinds of time; with
no true slip among what it does not see; with the truth.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.detection import Model
from holdfast.io import load_recording
from holdfast.metrics.masks import runs
from holdfast.metrics.slip_curves import (
    SLIP_THRESHOLDS,
    ThresholdChoice,
    choose_threshold,
    slip_curve,
)
from holdfast.metrics.slip_truth import SLIDING, STILL, finger_slips, slip_truth
from holdfast.metrics.slips import SlipCounts, count_slips, slip_metrics
from holdfast.recordings import Label
from holdfast.training.evaluation import compute_decisions
from holdfast.training.teaching import teach_with_report

WANTED = 1.5
UNSEEN_MARGIN = 0.1
"""Time around a true slip that is left out with it [s]."""


def with_labels(recording, made):
    modules = {
        name: replace(module, labels=made(name, module))
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules)


def unknown_is_still(camera):
    """Return the labels of a camera with all held time outside its slips as no slip."""

    def made(name, module):
        if not module.labels:
            return ()
        codes = slip_truth(replace(camera, truth=None), name, module.times).codes
        unknown = ~np.isin(codes, (STILL, SLIDING)) & (codes >= 0)
        filled = [
            Label(module.times[a], module.times[b - 1], "UNSTABLE", "disturbance", author="rule")
            for a, b in runs(unknown)
            if b - a > 1
        ]
        kept = [x for x in module.labels if x.cause or x.state != ContactState.UNSTABLE]
        return tuple(sorted([*kept, *filled], key=lambda x: x.start))

    return with_labels(camera, made)


def unseen_is_unknown(camera, truth):
    """Return the same labels without the true slips that the camera did not see."""

    def made(name, module):
        seen = [x for x in module.labels if x.cause == Cause.SLIP]
        cut = list(module.labels)
        for slip in finger_slips(truth, name):
            if any(x.start < slip.end and x.end > slip.onset for x in seen):
                continue
            start, end = slip.onset - UNSEEN_MARGIN, slip.end + UNSEEN_MARGIN
            parts = [(x, x.start, min(x.end, start)) for x in cut if x.cause != Cause.SLIP]
            parts += [(x, max(x.start, end), x.end) for x in cut if x.cause != Cause.SLIP]
            slips = [x for x in cut if x.cause == Cause.SLIP]
            cut = slips + [replace(x, start=a, end=b) for x, a, b in parts if a < b]
        return tuple(sorted(cut, key=lambda x: x.start))

    return with_labels(camera, made)


def figures(counts):
    metrics = slip_metrics(counts)
    rate = metrics.false_alarms_per_minute["held"]
    return f"{metrics.incipient['0.1']:.0f}, {metrics.before_1mm:.0f} at {rate:.2g}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("filmed", type=Path)
    parser.add_argument("fresh", type=Path)
    arguments = parser.parse_args()
    paths = [p.with_suffix(".parquet") for p in sorted(arguments.filmed.glob("*.labels.json"))]
    paths = [p.with_name(p.name.replace(".labels", "")) for p in paths]
    films, truths = (
        [load_recording(p) for p in paths],
        [load_recording(p, labels=False) for p in paths],
    )
    filmed = {path.name for path in arguments.filmed.glob("*.parquet")}
    fresh = sorted(p for p in arguments.fresh.glob("*.parquet") if p.name not in filmed)
    fresh = [load_recording(path) for path in fresh]
    old = [unknown_is_still(x) for x in films]
    variants = {
        "what is not seen is no slip": old,
        "camera": films,
        "no unseen slip among the rest": [
            unseen_is_unknown(x, t.truth) for x, t in zip(old, truths, strict=True)
        ],
        "truth": truths,
    }
    print("| labels | slips | out of fold | next grasps, its threshold | best at 1.5 |")
    for name, recordings in variants.items():
        try:
            taught = teach_with_report(Model.load("builtin:any"), recordings, false_alarms=WANTED)
        except Exception as refusal:  # a table goes on
            print(f"| {name} | {refusal} |", flush=True)
            continue
        known = [compute_decisions(taught.model, x).known_slips.values() for x in fresh]
        slips = [x for fingers in known for x in fingers]
        total = SlipCounts.total(slip_curve(x) for x in slips)
        best = choose_threshold(total, ThresholdChoice(WANTED))
        best = len(total) - 1 if best is None else best
        printed, rate = taught.slips.pooled, taught.slips.pooled.false_alarms_per_minute["held"]
        cells = (
            f"{printed.incipient['0.1']:.0f} at {rate:.2g} ({taught.features})",
            figures(SlipCounts.total(count_slips(x) for x in slips)),
            f"{figures(total[best])} ({SLIP_THRESHOLDS[best]:.3f})",
        )
        print(f"| {name} | {printed.n} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
