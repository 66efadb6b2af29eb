"""State of the installation, for `holdfast doctor`: packages, kernel, limits, sources, plug-ins."""

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from holdfast.cli.extensions import plugin_states
from holdfast.cli.terminal.console import print_line, print_table
from holdfast.errors import (
    DISTRIBUTION,
    EXTRA_PURPOSES,
    install_command,
    other_project,
    package_versions,
)
from holdfast.kernel.batch import usable_processors
from holdfast.removed import REMOVED


def installation() -> dict[str, Any]:
    """Return the state of the installation as JSON values."""
    from holdfast.devices.uri import source_states
    from holdfast.io.foreign import limits

    error = None
    try:  # load the kernel and run it once
        import numpy as np

        from holdfast.detection import haar_features

        haar_features(np.ones((16, 3)))
    except Exception as cause:  # any failure is reported
        error = f"{type(cause).__name__}: {cause}"
    packages = package_versions()
    data = os.environ.get("HOLDFAST_DATA")
    return {
        "holdfast": metadata.version(DISTRIBUTION),
        "conflict": other_project() or None,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpus": usable_processors(),
        "packages": packages.pop("", {}),  # those that every installation needs
        "extras": {
            extra: {
                "purpose": EXTRA_PURPOSES.get(extra, ""),
                "installed": None not in versions.values(),
                "packages": versions,
                "install": install_command(extra),
            }
            for extra, versions in sorted(packages.items())
        },
        "kernels": {"ok": error is None, "error": error},
        "limits": limits(),
        "data": {"path": data, "found": data is not None and Path(data).is_dir()},
        "sources": source_states(),
        "plugins": [plugin._asdict() for plugin in plugin_states()],
    }


def print_installation(report: dict[str, Any]) -> None:
    """Print tables of what `installation` returns."""
    kernels, data, limits = report["kernels"], report["data"], report["limits"]
    presence = "found" if data["found"] else "NOT FOUND"
    held = ", ".join(name for name, holds in limits.items() if holds)
    lacking = ", ".join(name for name, holds in limits.items() if not holds)
    rows = [(key, report[key]) for key in ("python", "platform", "cpus")]
    rows += [
        ("kernel", "works" if kernels["ok"] else kernels["error"]),
        ("limits of imports", (held or "none") + (f" (NOT {lacking})" if lacking else "")),
        ("HOLDFAST_DATA", "not set" if data["path"] is None else f"{data['path']} ({presence})"),
    ]
    packages = [(name, version or "MISSING") for name, version in report["packages"].items()]
    extras = [
        (name, extra["purpose"], "installed" if extra["installed"] else extra["install"])
        for name, extra in report["extras"].items()
    ]
    plugins = [
        (x["name"], x["kind"], x["package"], f"SKIPPED: {x['error']}" if x["error"] else "works")
        for x in report["plugins"]
        if x["kind"] not in REMOVED["plugins"]
    ]
    print_table(("holdfast", report["holdfast"]), rows)
    for header, table in (
        (("source", "state"), list(report["sources"].items())),
        (("package", "version"), packages),
        (("extra", "purpose", "state"), extras),
        (("plug-in", "kind", "package", "state"), plugins),
    ):
        if table:
            print_line()
            print_table(header, table)
    if report["conflict"]:
        print_line(report["conflict"])
    for x in report["plugins"]:
        if x["kind"] in REMOVED["plugins"]:
            print_line(f"plug-in {x['name']} of {x['package']} is skipped: {x['error']}")
