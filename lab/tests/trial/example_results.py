"""Invented results of trials, for tests that need no simulation."""

import math

from holdfast_lab.trial.run import TrialResult
from holdfast_lab.trial.trials import draw_trial


def invented(trial, law, model="builtin:any"):
    """A fixed grip loses two of three objects, pr2 one of three; holdfast holds all."""
    lost = trial.number % 3 < {"fixed": 2, "pr2": 1}.get(law, 0)
    return TrialResult(
        number=trial.number, law=law, object=trial.grasp.object, unseen=trial.unseen,
        kind=trial.load.kind.value, n_fingers=trial.n_fingers, held=trial.number != 4,
        dropped=lost, drop_reason="slip" if lost else "",
        slip=math.inf if lost else 0.001 * (1 + trial.number % 2), slipped=True,
        reaction=math.inf if law == "fixed" else 0.03, force_ratio=1.4, static_ratio=1.8,
        coulomb_ratio=1.9, peak_ratio=1.1,
        quiet_time=2.0, n_false=int(law == "pr2"),
    )  # fmt: skip


def results_of(laws=("fixed", "pr2", "holdfast"), n=12):
    return {law: [invented(draw_trial(k), law) for k in range(n)] for law in laws}
