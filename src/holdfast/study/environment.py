"""How a study was made: versions, data and machine, without names of people."""

import os
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from holdfast.study.plan import Corpus, StudyPlan

PACKAGES = (
    "holdfast", "numpy", "scipy", "scikit-learn", "numba", "optuna", "mujoco", "msgspec",
    "matplotlib", "torch",
)  # fmt: skip
GIB = 2**30

ROLES = {
    "main": "used for training",
    "fresh": "the same objects with another seed and another skin; not used for training",
    "others": "objects that are not used for training",
    "gentle": "a gentler profile of the twin",
    "vigorous": "a more vigorous profile of the twin",
    "finger": "the protocol of holdfast 0.1, in which only a finger pushes",
    "noiseless": "the first grasps of main with whole counts and no other noise",
    "glitch-0": "other objects, without glitches of the hand's controller",
    "glitch-1": "other objects, with 1 glitch a minute",
    "glitch-7": "other objects, with 7 glitches a minute",
    "real": "recordings of a real hand or gripper",
}
"""What the recordings of each role are."""


def versions() -> dict[str, str | None]:
    """Return the versions of Python and of the packages; None if one is not installed."""
    return {"python": platform.python_version(), **{name: _version(name) for name in PACKAGES}}


def machine() -> dict[str, Any]:
    """Return what the time depends on: processor, usable cores, memory [GiB], system."""
    return {
        "processor": _processor(),
        "cores": _cores(),
        "memory": _memory(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def data(plan: StudyPlan) -> dict[str, dict[str, Any]]:
    """Return a description of each corpus of a plan, by its role."""
    corpora = plan.corpora | ({"real": plan.real} if plan.real is not None else {})
    return {role: _describe(corpus) for role, corpus in corpora.items()}


def report_facts(summary: Mapping[str, Any]) -> dict[str, object]:
    """Return the head of the report, from the contents of `study.json`."""
    host = summary["machine"]
    memory = "" if host["memory"] is None else f", {host['memory']:g} GiB"
    return {
        "data": {role: _corpus_text(corpus) for role, corpus in summary["data"].items()},
        "seed": summary["seed"],
        "versions": ", ".join(
            f"{name} {number or 'not installed'}" for name, number in summary["versions"].items()
        ),
        "machine": f"{host['processor']}, {host['cores']} cores{memory}, {host['system']}",
        "time": ", ".join(
            f"{name} {_duration(value)}" for name, value in summary["seconds"].items() if value
        ),
    }


def run_notes(summary: Mapping[str, Any]) -> list[str]:
    """Return sentences on what was run and what was left out."""
    notes = [
        f"{role}: {corpus['recordings']} recordings; {ROLES.get(role, 'others')}."
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
    return [*notes, *(f"Left out: {each}" for each in summary["left_out"])]


def _describe(corpus: Corpus) -> dict[str, Any]:
    return {
        "name": Path(corpus.folder).name,
        "digest": corpus.digest,
        "recordings": len(corpus.recordings),
        "samples": corpus.n_samples,
        "fingers": list(corpus.fingers),
        "rate": corpus.rate,
        "tare": corpus.tare,
    }


def _corpus_text(corpus: Mapping[str, Any]) -> str:
    return (
        f"{corpus['recordings']} recordings, {corpus['samples']:,} samples of single fingers, "
        f"{corpus['rate']:.0f} Hz, {', '.join(corpus['fingers'])}; digest {corpus['digest'][:12]}"
    )


def _duration(seconds: float) -> str:
    """Return a time as text.

    Example:
        >>> _duration(42.3), _duration(1500)
        ('42 s', '25 min')
    """
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text(errors="replace").splitlines() if cpuinfo.exists() else []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _memory() -> float | None:
    if "SC_PHYS_PAGES" not in getattr(os, "sysconf_names", {}):
        return None
    return round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / GIB, 1)
