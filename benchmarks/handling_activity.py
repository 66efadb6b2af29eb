"""Print the activity of held samples of randomized hands, without sliding and while they slide.

    python benchmarks/handling_activity.py HANDS [--model builtin:any]

HANDS is a folder that `holdfast simulate HANDS --randomize --repeats 300` made. `MAX_ACTIVITY` of
`holdfast.training.calibration`, above which own handling is refused as slip, is above the largest
activity without sliding. It is in units of the model's default handling: with another model,
measure it again.
"""

import argparse

import numpy as np

from holdfast.features.stream import extract
from holdfast.io import load_dataset
from holdfast.metrics.slip_truth import SLIDING, STILL, slip_truth
from holdfast.model import Model
from holdfast.recordings import Recording
from holdfast.training.calibration import MAX_ACTIVITY, activity

MIN_SAMPLES = 50
"""Minimum number of samples of a hand."""


def activities(model: Model, recording: Recording) -> tuple[float, float]:
    """Return the activity of the samples that do not slide and that do; NaN of too few."""
    sensors = model.fingers_of({name: m.sensor for name, m in recording.modules.items()})
    rows = extract(model.plan(sensors, recording.rate), recording)
    kept: dict[int, list[np.ndarray]] = {STILL: [], SLIDING: []}
    for name in sensors:
        truth = slip_truth(recording, name, recording.modules[name].times)
        features = rows[name].features
        usable = np.isfinite(features).all(axis=1)
        for code, parts in kept.items():
            if truth is not None:
                parts.append(features[usable & (truth.codes == code)])
    part = model.finger(next(iter(sensors)))
    still, sliding = (np.concatenate(parts) for parts in kept.values())
    return tuple(  # type: ignore[return-value]
        activity(part, samples) if len(samples) > MIN_SAMPLES else np.nan
        for samples in (still, sliding)
    )


def main(hands: str, name: str) -> None:
    model = Model.load(name)
    table = np.array([activities(model, recording) for recording in load_dataset(hands)])
    print(f"{len(table)} hands; above {MAX_ACTIVITY:g}:")
    for title, values in zip(("not sliding", "sliding"), table.T, strict=True):
        known = values[np.isfinite(values)]
        shares = ", ".join(f"{x:.2f}" for x in np.percentile(known, [0, 10, 50, 90, 100]))
        print(
            f"{title}: {len(known)} hands; least, tenth, median, nine tenths, largest {shares}; "
            f"{100 * np.mean(known > MAX_ACTIVITY):.0f} % above"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("hands")
    parser.add_argument("--model", default="builtin:any")
    arguments = parser.parse_args()
    main(arguments.hands, arguments.model)
