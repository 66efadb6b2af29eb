"""Evaluate builtin:any on randomized hands by kind of sensor: order, calibration, events.

    holdfast simulate fresh/ --randomize --repeats 80 --seed 1
    python benchmarks/any_by_sensor.py fresh/

Events are those of the hand, of recordings that begin with an open hand.
"""

import argparse
from pathlib import Path

import numpy as np
from sklearn.metrics import roc_auc_score
from train_any import calibration_error

from holdfast import Model, Recording, evaluate
from holdfast.contact import STABLE, UNSTABLE
from holdfast.io import load_dataset


def main(folder: Path) -> None:
    model = Model.load("builtin:any")
    recordings = list(load_dataset(folder))
    kinds = sorted({str(each.metadata["sensor_kind"]) for each in recordings})
    print("| sensor | hands | AUC | calibration error | events | missed at 0.1 s % | 0.2 s % "
          "| median delay s | false alarms/min |")  # fmt: skip
    print("|---" * 9 + "|")
    for kind in (*kinds, "all"):
        own = [r for r in recordings if kind in (r.metadata["sensor_kind"], "all")]
        print(row(model, kind, own), flush=True)


def row(model: Model, kind: str, recordings: list[Recording]) -> str:
    found = [samples(model, each) for each in recordings]
    probability, stable = map(np.concatenate, zip(*found, strict=True))
    opened = [r for r in recordings if "starts_loaded" not in r.metadata]
    events = evaluate(model, opened).events.hand
    cells = (
        kind,
        len(recordings),
        f"{roc_auc_score(stable, probability):.3f}",
        f"{calibration_error(probability, stable):.3f}",
        events.n_events,
        f"{events.missed['0.1']:.0f}",
        f"{events.missed['0.2']:.0f}",
        f"{events.delay_median:.3f}",
        f"{events.false_alarms_per_minute:.1f}",
    )
    return f"| {' | '.join(map(str, cells))} |"


def samples(model: Model, recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Probability and stability of the labelled samples in contact, of all fingers."""
    found = []
    for name, probability in model.predict_proba(recording).items():
        states = recording.modules[name].label_states
        kept = np.isin(states, (STABLE, UNSTABLE)) & np.isfinite(probability)
        found.append((probability[kept], states[kept] == STABLE))
    probabilities, stable = zip(*found, strict=True)
    return np.concatenate(probabilities), np.concatenate(stable)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    main(parser.parse_args().folder)
