"""Train a model, each object left out once: train_and_evaluate.py [RECORDINGS] [MODEL.json]."""

import sys
from pathlib import Path

from holdfast import load_dataset, train
from holdfast.synthetic import synthetic_recording
from holdfast.training import Setting


def main(folder: str = "", model: str = "") -> None:
    """Train on a folder of labelled recordings, or on synthetic ones."""
    synthetic = [synthetic_recording(f"grasp-{seed}", seed) for seed in range(6)]
    recordings = load_dataset(folder) if folder else synthetic
    trained = train(recordings, Setting(trials=0, split="object"))

    metrics = trained.cross_validation
    print(f"{len(recordings)} recordings, each object left out once")
    for name, finger in metrics.fingers.items():
        print(f"  {name}: {finger.accuracy:.1f} % right, AUC in contact {finger.auc_contact:.3f}")
    hand = metrics.events.hand
    print(f"  {hand.n_events} events; missed within 0.1 s: {text(hand.missed['0.1'])} %")
    print(f"  {text(hand.false_alarms_per_minute)} false alarms per minute of stable label")
    if model:
        trained.model.save(Path(model))


def text(value: float | None) -> str:
    """Return a number with one digit; a dash if it is not known, as without events."""
    return "-" if value is None else f"{value:.1f}"


if __name__ == "__main__":
    main(*sys.argv[1:])
