"""The published split of a public set: a model of the other recordings, sample by sample."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from holdfast.contact import STABLE, UNSTABLE
from holdfast.errors import RecordingError
from holdfast.io import load_dataset
from holdfast.training import Setting, train


def score_split(folder: Path, test: Sequence[str]) -> dict[str, dict[str, float]]:
    """Train on the recordings of a folder but for some, and score slip by sample on these.

    Args:
        folder: imported recordings of the set.
        test: names of the recordings to test on.

    Returns:
        `accuracy`, `ap` (average precision) and `auc` of the model, of the answer that nothing
        ever slips, and of chance.

    Raises:
        RecordingError: a recording of the test is missing.
    """
    from sklearn.metrics import average_precision_score, roc_auc_score

    recordings = {recording.name: recording for recording in load_dataset(folder)}
    if missing := [name for name in test if name not in recordings]:
        raise RecordingError(f"{folder} has no recording {missing[0]!r}, which the split tests on")
    others = [one for name, one in recordings.items() if name not in test]
    model = train(others, Setting(trials=0)).model
    pairs = []
    for name in test:
        stable = model.predict_proba(recordings[name])
        for finger, module in recordings[name].modules.items():
            states, known = module.label_states, np.isfinite(stable[finger])
            known &= np.isin(states, (STABLE, UNSTABLE))
            pairs.append((1 - stable[finger][known], states[known] == UNSTABLE))
    slip, slips = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    share = float(slips.mean())
    return {
        "model": {
            "accuracy": float(np.mean((slip > 0.5) == slips)),
            "ap": float(average_precision_score(slips, slip)),
            "auc": float(roc_auc_score(slips, slip)),
        },
        "always no slip": {"accuracy": 1 - share, "ap": share, "auc": 0.5},
        "chance": {"accuracy": share**2 + (1 - share) ** 2, "ap": share, "auc": 0.5},
    }
