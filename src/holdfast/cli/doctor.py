"""`holdfast doctor`: what is installed, and whether it works."""

import os
import platform
import re
import socket
import time
from contextlib import suppress
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer

from holdfast.cli.terminal.console import print_json, print_table, show

PURPOSES = {
    "bags": "importing bags of ROS 1 and ROS 2",
    "bench": "peers to compare speed with in holdfast bench",
    "cluster": "work on a Dask cluster, --engine dask:ADDRESS",
    "deep": "the network among the methods of holdfast study",
    "ros2": "ROS 2 topics, without a ROS installation",
    "serial": "sensors at a serial port",
    "hdf5": "importing recordings kept in HDF5",
}
"""What each extra is for."""

_REQUIREMENT = re.compile(r"(?P<package>[\w.-]+)(?:.*extra\s*==\s*['\"](?P<extra>[\w-]+)['\"])?")


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")] = False,
) -> None:
    """Shows what is installed and what works.

    Python, packages, extras and how to get them, the compiled kernels, which live sources can be
    reached, and where HOLDFAST_DATA points. It reports, and always exits with 0.

    Example:
      holdfast doctor
      holdfast doctor --json
    """
    report = _report()
    if as_json:
        print_json(report)
    else:
        _print(report)


def _report() -> dict[str, Any]:
    packages = _packages()
    return {
        "holdfast": metadata.version("holdfast"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpus": len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count(),
        "packages": packages.pop("", {}),
        "extras": {extra: _extra(extra, found) for extra, found in sorted(packages.items())},
        "kernels": _kernels(),
        "data": _data(),
        "sources": reachable(),
    }


def _packages() -> dict[str, dict[str, str | None]]:
    """Version of each required package, None where it is missing, by extra ("" is the core)."""
    found: dict[str, dict[str, str | None]] = {}
    for requirement in metadata.requires("holdfast") or []:
        match = _REQUIREMENT.match(requirement)
        if match is not None and match["package"] != "holdfast":
            group = found.setdefault(match["extra"] or "", {})
            group[match["package"]] = _version(match["package"])
    return found


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _extra(extra: str, packages: dict[str, str | None]) -> dict[str, Any]:
    return {
        "purpose": PURPOSES.get(extra, ""),
        "installed": None not in packages.values(),
        "packages": packages,
        "install": f'pip install "holdfast[{extra}]"',
    }


def _kernels() -> dict[str, Any]:
    """Compiles the feature kernel, or loads it from its cache, and runs it once."""
    begin = time.perf_counter()
    error = None
    try:
        import numpy as np

        from holdfast.features import haar_features

        haar_features(np.ones((16, 3)))
    except Exception as cause:  # the doctor tells what is broken, whatever it is
        error = f"{type(cause).__name__}: {cause}"
    return {
        "ok": error is None,
        "seconds": round(time.perf_counter() - begin, 3),
        "cache": os.environ.get("NUMBA_CACHE_DIR", "beside the package"),
        "error": error,
    }


def _data() -> dict[str, Any]:
    given = os.environ.get("HOLDFAST_DATA")
    return {"path": given, "found": given is not None and Path(given).is_dir()}


def _print(report: dict[str, Any]) -> None:
    kernels, data = report["kernels"], report["data"]
    works = f"work ({kernels['seconds']:.1f} s to load)" if kernels["ok"] else kernels["error"]
    rows = [(key, report[key]) for key in ("python", "platform", "cpus")]
    rows += [
        ("kernels", works),
        ("kernel cache", kernels["cache"]),
        ("HOLDFAST_DATA", _where(data)),
    ]
    print_table(("holdfast", report["holdfast"]), rows)
    show()
    print_table(("source", "state"), list(report["sources"].items()))
    show()
    print_table(
        ("package", "version"),
        [(name, version or "MISSING") for name, version in report["packages"].items()],
    )
    show()
    print_table(
        ("extra", "for", "state"),
        [(name, x["purpose"], _state(x)) for name, x in report["extras"].items()],
    )


def _where(data: dict[str, Any]) -> str:
    if data["path"] is None:
        return "not set"
    return f"{data['path']} ({'found' if data['found'] else 'NOT FOUND'})"


def _state(extra: dict[str, Any]) -> str:
    return "installed" if extra["installed"] else extra["install"]


KNOCK = 0.3
"""How long a server has to answer [s]."""


def reachable() -> dict[str, str]:
    """How each kind of live source stands, in a few words."""
    return {"xela": _xela(), "ros1": _ros1(), "ros2": _ros2(), "serial": _serial()}


def _xela() -> str:
    from holdfast.sources.uri import parse
    from holdfast.sources.xela.places import places

    tried = places(parse("xela://auto")[1])
    for place in tried:
        with suppress(OSError), socket.create_connection(place, KNOCK):
            return f"something listens at {place}"
    return f"nothing listens at {' or '.join(map(str, tried))}"


def _ros1() -> str:
    from holdfast.errors import HoldfastError
    from holdfast.ros.rospy_node import check_master, master_uri, rospy_module

    try:
        rospy_module()
        check_master(master := master_uri(None))
    except (HoldfastError, ValueError) as missing:  # a ValueError: ROS_MASTER_URI is none
        return str(missing)
    return f"rospy, and a master at {master}"


def _ros2() -> str:
    if find_spec("cyclonedds") is None:
        return 'not installed: pip install "holdfast[ros2]"'
    return f"cyclonedds, domain {os.environ.get('ROS_DOMAIN_ID', '0')}"


def _serial() -> str:
    if find_spec("serial") is None:
        return 'not installed: pip install "holdfast[serial]"'
    from serial.tools.list_ports import comports

    return ", ".join(port.device for port in comports()) or "no port"
