"""How a study was made: its recordings, and what was run."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from holdfast_lab.study.plan import StudyPlan

ROLES = {
    "main": "used for training",
    "fresh": "the same objects with another seed and another skin; not used for training",
    "others": "objects that are not used for training",
    "gentle": "a gentler profile of the twin",
    "vigorous": "a more vigorous profile of the twin",
    "glitch-0": "other objects, without glitches of the hand's controller",
    "glitch-1": "other objects, with 1 glitch a minute",
    "aged": "other objects, skins aged by four months",
    "impacts": "other objects; hand, arm and object are knocked",
    "slips": "other objects, slips that no push causes",
    "taught": "what teaches a model the slips of this hand",
    "taught-pushes": "the same, with pushes",
    "real": "recordings of a real hand or gripper",
}
"""Description of the recordings of each role."""


def data(plan: StudyPlan) -> dict[str, dict[str, Any]]:
    """Return a description of each corpus of a plan, by its role."""
    corpora = plan.corpora | ({"real": plan.real} if plan.real is not None else {})
    return {
        role: {
            "name": Path(corpus.folder).name,
            "digest": corpus.digest,
            "recordings": len(corpus.recordings),
            "samples": corpus.n_samples,
            "fingers": list(corpus.fingers),
            "rate": corpus.rate,
            "tare": corpus.tare,
        }
        for role, corpus in corpora.items()
    }


def run_notes(summary: Mapping[str, Any]) -> list[str]:
    """Return sentences on what was run and what was left out."""
    notes = [
        f"{role}: {corpus['recordings']} recordings, {corpus['samples']:,} samples of single "
        f"fingers at {corpus['rate']:.0f} Hz; {ROLES.get(role, 'others')}."
        for role, corpus in summary["data"].items()
    ]
    if summary["quick"]:
        notes.append(
            "This is a quick study. It uses fewer recordings, windows, methods and trials than "
            "the full one, and its intervals are wide. Quote the full study."
        )
    notes.append(
        f"{summary['tasks']} tasks with seed {summary['seed']}. Results that were stored by an "
        "earlier run are not counted in the time."
    )
    return [*notes, *(f"Left out: {sentence}" for sentence in summary["left_out"])]
