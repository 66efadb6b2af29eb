"""What the figures of a study depend on: versions, data and machine, without names of people."""

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


def versions() -> dict[str, str | None]:
    """Of Python and of the packages that figures come from; None of what is not installed."""
    return {"python": platform.python_version(), **{name: _version(name) for name in PACKAGES}}


def machine() -> dict[str, Any]:
    """What the time depends on: processor, cores that may be used, memory [GiB], system."""
    return {
        "processor": _processor(),
        "cores": _cores(),
        "memory": _memory(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def data(plan: StudyPlan) -> dict[str, dict[str, Any]]:
    """What is in each corpus of a plan, by its role."""
    return {role: _told(corpus) for role, corpus in corpora(plan).items()}


def corpora(plan: StudyPlan) -> Mapping[str, Corpus]:
    """All that a plan has, by role."""
    return {**plan.corpora, **({"real": plan.real} if plan.real is not None else {})}


def _told(corpus: Corpus) -> dict[str, Any]:
    return {
        "name": Path(corpus.folder).name,
        "digest": corpus.digest,
        "recordings": len(corpus.recordings),
        "samples": corpus.n_samples,
        "fingers": list(corpus.fingers),
        "rate": corpus.rate,
        "tare": corpus.tare,
    }


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
