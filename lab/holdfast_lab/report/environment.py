"""How results were made: versions, machine and time, without names of people."""

import os
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from holdfast.errors import DISTRIBUTION
from holdfast.kernel.batch import usable_processors

REPORTED_PACKAGES = (
    DISTRIBUTION, "numpy", "scipy", "scikit-learn", "optuna", "mujoco", "msgspec",
    "matplotlib",
)  # fmt: skip
GIB = 2**30


def versions() -> dict[str, str | None]:
    """Return the versions of Python and of the packages; None if one is not installed."""
    return {
        "python": platform.python_version(),
        **{name: _version(name) for name in REPORTED_PACKAGES},
    }


def machine() -> dict[str, Any]:
    """Return what the time depends on: processor, usable cores, memory [GiB], system."""
    memory = physical_memory()
    # `platform.processor` is empty on many Linux systems; the kernel has the name of the model.
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text(errors="replace").splitlines() if cpuinfo.exists() else []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return {
        "processor": next(names, platform.processor() or platform.machine()),
        "cores": usable_processors(),
        "memory": None if memory is None else round(memory / GIB, 1),
        "system": f"{platform.system()} {platform.machine()}",
    }


def fact_texts(summary: Mapping[str, Any]) -> dict[str, str]:
    """Return the facts that all reports have: seed, versions, machine and time.

    Args:
        summary: with `seed`, `versions`, `machine`, and `seconds` by part of the work.
    """
    host = summary["machine"]
    memory = "" if host["memory"] is None else f", {host['memory']:g} GiB"
    return {
        "seed": str(summary["seed"]),
        "versions": ", ".join(
            f"{name} {number or 'not installed'}" for name, number in summary["versions"].items()
        ),
        "machine": f"{host['processor']}, {host['cores']} cores{memory}, {host['system']}",
        "time": ", ".join(
            f"{name} {_duration(value)}" for name, value in summary["seconds"].items() if value
        ),
    }


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


def physical_memory() -> int | None:
    """Return the memory of this machine [byte]; None if it does not say."""
    if "SC_PHYS_PAGES" not in getattr(os, "sysconf_names", {}):
        return None
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
