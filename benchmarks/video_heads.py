"""What a head of slips learns from a video, against true onsets: for docs/label-by-camera.md.

holdfast simulate filmed/ --seed 523 --profile slips --cases 2 --repeats 1 --video
holdfast label auto tracking filmed/
holdfast simulate others/ --seed 31 --profile slips --cases 2 --repeats 2
python benchmarks/video_heads.py filmed/ others/

Both heads are fitted to the same fingers of the same recordings, and compared on all fingers of the
others, each at the threshold that gives the same rate of false alarms there.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from holdfast import Model
from holdfast.io import load_dataset
from holdfast.labelling.rules.video import VIDEO_RULE
from holdfast.metrics.slip_thresholds import choose_threshold, slip_curve
from holdfast.metrics.slips import SlipCurve, slip_metrics
from holdfast.training.evaluation import compute_decisions
from holdfast.training.teaching import WANTED_FALSE_ALARMS, teach


def labelled_fingers(recording, with_truth):
    """Return the fingers that the camera sees, with the slips of the truth or of the labels."""
    seen = {
        finger: replace(module, labels=()) if with_truth else module
        for finger, module in recording.modules.items()
        if any(label.author == VIDEO_RULE for label in module.labels)
    }
    return replace(recording, modules=seen, truth=recording.truth if with_truth else None)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("filmed", type=Path)
    parser.add_argument("others", type=Path)
    arguments = parser.parse_args()
    filmed, others = load_dataset(arguments.filmed), load_dataset(arguments.others)
    found = {}
    for onsets in ("truth", "video"):
        given = [labelled_fingers(recording, onsets == "truth") for recording in filmed]
        model = teach(Model.load("builtin:any"), given)
        curves = []
        for recording in others:
            fingers = compute_decisions(model, recording).fingers.values()
            curves += [slip_curve(finger.slip) for finger in fingers if finger.slip]
        total = SlipCurve.total(curves)
        at = choose_threshold(total, WANTED_FALSE_ALARMS)
        metrics = slip_metrics(total[at])
        found[onsets] = (metrics.incipient["0.1"], metrics.before_1mm, metrics.auc)
        print(
            f"{onsets}: within 0.1 s {found[onsets][0]:.0f} %, before 1 mm {found[onsets][1]:.0f} %"
            f" of {metrics.n} slips, AUC {metrics.auc:.3f}, "
            f"{metrics.false_alarms_per_minute['held']:.2f} false alarms a minute",
            flush=True,
        )
    ratios = [video / true for video, true in zip(found["video"], found["truth"], strict=True)]
    print(f"video / truth: {ratios[0]:.2f}, {ratios[1]:.2f}, {ratios[2]:.2f}")


if __name__ == "__main__":
    main()
