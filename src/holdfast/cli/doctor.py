"""`holdfast doctor`: check the installation and the live sources."""

import os
import platform
import re
import socket
import subprocess
from contextlib import suppress
from functools import partial
from importlib import import_module, metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from holdfast.children import python_command
from holdfast.cli.options import JsonOption
from holdfast.cli.terminal.console import print_json, print_line, print_table
from holdfast.errors import install_command, is_installed
from holdfast.plugins import GROUP_PLUGINS, PluginGroup
from holdfast.threads import usable_processors

if TYPE_CHECKING:
    from holdfast.cli.config import Config
    from holdfast.plugins import Plugin

EXTRA_PURPOSES = {
    "all": "all of the others but deep",
    "parquet": "recordings as Parquet files",
    "train": "holdfast train, evaluate and tune",
    "twin": "holdfast simulate and the source twin:",
    "plot": "figures, --plot",
    "label": "holdfast label",
    "onnx": "classifiers as ONNX files",
    "cluster": "a Dask cluster, --engine dask:ADDRESS",
    "deep": "the neural network of holdfast study",
    "ros": "topics of ROS without a ROS 2 installation, and bags",
    "serial": "sensors on a serial port",
    "hdf5": "import of HDF5 recordings",
    "grip": "holdfast hold: control of the grip force of a hand",
    "interop": "LeRobot, Foxglove, Label Studio and public data sets",
}
"""Purpose of each extra."""
PROBE_TIMEOUT = 0.3
"""Time in which a server must accept a connection [s]."""

PLUGIN_GROUPS = {
    "sensors": ("sensors", "SENSOR_PLUGINS"),
    "sources": ("devices.uri", "SOURCE_PLUGINS"),
    "importers": ("io.importers", "IMPORTER_PLUGINS"),
    "labels": ("labelling.exchange.read_labels", "LABEL_PLUGINS"),
    "classifiers": ("classifiers", "CLASSIFIER_PLUGINS"),
    "verbs": ("cli.app", "VERB_PLUGINS"),
    "exporters": ("cli.extensions", "EXPORTER_PLUGINS"),
    "publishers": ("cli.extensions", "PUBLISHER_PLUGINS"),
    "panels": ("cli.extensions", "PANEL_PLUGINS"),
    "players": ("cli.extensions", "PLAYER_PLUGINS"),
    "simulators": ("cli.extensions", "SIMULATOR_PLUGINS"),
}
"""Module and name of each group of plug-ins, by kind; a child imports one of them. Packages may
have kinds of their own, see `GROUP_PLUGINS`."""
PLUGIN_TIMEOUT = 60.0
"""Time in which a plug-in must be imported [s]."""

_ANSWER = "answer of the plug-in: "
_CHILD = (
    "from holdfast.cli.doctor import plugin_error, source_state\n"
    f"print({_ANSWER!r} + %s(*sys.argv[1:]), end='')"
)
_REQUIREMENT = re.compile(r"(?P<package>[\w.-]+)(?:.*extra\s*==\s*['\"](?P<extra>[\w-]+)['\"])?")


def doctor(context: typer.Context, as_json: JsonOption = False) -> None:
    """Check the installation and the reachable sources.

    Report Python, the packages, the extras and how to install them, the kernel, the
    live sources that can be reached, which limits hold for imports (time, time of the processor,
    memory), the plug-ins of other packages, the configuration file of
    the hand, and the folder in HOLDFAST_DATA. The exit code is always 0.

    Example:
      holdfast doctor
      holdfast doctor --json
    """
    report = _report(context)
    if as_json:
        print_json(report)
    else:
        _print(report)


def _report(context: typer.Context) -> dict[str, Any]:
    from holdfast.io.foreign import limits

    packages = _packages()
    return {
        "holdfast": metadata.version("holdfast"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpus": usable_processors(),
        "packages": packages.pop("", {}),
        "extras": {extra: _extra(extra, versions) for extra, versions in sorted(packages.items())},
        "kernels": _kernels(),
        "limits": limits(),
        "data": _data(),
        "config": _config(context.obj),
        "sources": check_sources(),
        "plugins": [plugin._asdict() for plugin in _plugins()],
    }


def _plugins() -> "list[Plugin]":
    """Return the plug-ins of other packages, and why some of them are skipped."""
    kinds = (*PLUGIN_GROUPS, *GROUP_PLUGINS.load_all())
    ask = partial(_ask_child, "plugin_error")
    return [plugin for kind in kinds for plugin in plugin_group(kind).states(ask)]


def plugin_error(kind: str, name: str) -> str:
    """Return why a plug-in is skipped; empty if it can be used."""
    return plugin_group(kind).error(name)


def source_state(name: str) -> str:
    """Return what a source of a plug-in finds, or why it is skipped; empty without a state."""
    from holdfast.devices.uri import source_module

    return plugin_error("sources", name) or getattr(source_module(name), "state", str)()


def _ask_child(function: str, *words: str) -> str:
    """Return what a function gives in a child process, which a plug-in may end or block."""
    try:
        done = subprocess.run(
            python_command(_CHILD % function, *words), stdin=subprocess.DEVNULL,
            capture_output=True, text=True, errors="replace", timeout=PLUGIN_TIMEOUT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"its import takes longer than {PLUGIN_TIMEOUT:.0f} s"
    _, answered, answer = done.stdout.rpartition(_ANSWER)
    return answer if answered else f"its import ends the process (exit code {done.returncode})"


def plugin_group(kind: str) -> "PluginGroup[Any]":
    """Return the plug-ins of a kind."""
    if kind not in PLUGIN_GROUPS:
        return GROUP_PLUGINS.require(kind, f"the kind {kind} of plug-ins")
    module, name = PLUGIN_GROUPS[kind]
    group: PluginGroup[Any] = getattr(import_module(f"holdfast.{module}"), name)
    return group


def _packages() -> dict[str, dict[str, str | None]]:
    """Return the version of each required package, by extra ("" without one); None if missing."""
    versions: dict[str, dict[str, str | None]] = {}
    for requirement in metadata.requires("holdfast") or []:
        match = _REQUIREMENT.match(requirement)
        if match is not None and match["package"] != "holdfast":
            group = versions.setdefault(match["extra"] or "", {})
            group[match["package"]] = _version(match["package"])
    # "all" requires other extras of this package, not packages
    others = (versions.get(extra, {}) for extra in EXTRA_PURPOSES if extra not in ("all", "deep"))
    return versions | {"all": {name: found for group in others for name, found in group.items()}}


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _extra(extra: str, packages: dict[str, str | None]) -> dict[str, Any]:
    return {
        "purpose": EXTRA_PURPOSES.get(extra, ""),
        "installed": None not in packages.values(),
        "packages": packages,
        "install": install_command(extra),
    }


def _kernels() -> dict[str, Any]:
    """Load the kernel and run it once."""
    error = None
    try:
        import numpy as np

        from holdfast.features import haar_features

        haar_features(np.ones((16, 3)))
    except Exception as cause:  # any failure is reported
        error = f"{type(cause).__name__}: {cause}"
    return {"ok": error is None, "error": error}


def _data() -> dict[str, Any]:
    path = os.environ.get("HOLDFAST_DATA")
    return {"path": path, "found": path is not None and Path(path).is_dir()}


def _config(config: "Config | None") -> dict[str, Any]:
    """Return the path, content and error of the configuration file."""
    import msgspec

    from holdfast.cli.config import find_config, load_config

    path, error = None, None
    try:
        path = find_config()
        config = config or (None if path is None else load_config(path))
    except ValueError as cause:
        error = str(cause)
    content = {} if config is None else msgspec.to_builtins(config)
    return {
        "path": None if path is None else str(path),
        "content": {key: value for key, value in content.items() if value},
        "error": error,
    }


def _config_text(config: dict[str, Any]) -> str:
    if config["error"]:
        return f"WRONG: {config['error']}"
    if not config["content"]:
        return "none: holdfast.toml in this folder, or HOLDFAST_CONFIG"
    return ", ".join(f"{key} {value}" for key, value in config["content"].items())


def _print(report: dict[str, Any]) -> None:
    kernels, data = report["kernels"], report["data"]
    rows = [(key, report[key]) for key in ("python", "platform", "cpus")]
    rows += [
        ("kernel", "works" if kernels["ok"] else kernels["error"]),
        ("limits of imports", _limits_text(report["limits"])),
        ("HOLDFAST_DATA", _data_text(data)),
        ("your hand", _config_text(report["config"])),
    ]
    print_table(("holdfast", report["holdfast"]), rows)
    print_line()
    print_table(("source", "state"), list(report["sources"].items()))
    print_line()
    print_table(
        ("package", "version"),
        [(name, version or "MISSING") for name, version in report["packages"].items()],
    )
    print_line()
    print_table(
        ("extra", "purpose", "state"),
        [(name, x["purpose"], _extra_text(x)) for name, x in report["extras"].items()],
    )
    if report["plugins"]:
        print_line()
        print_table(("plug-in", "kind", "package", "state"), map(_plugin_row, report["plugins"]))


def _plugin_row(plugin: dict[str, str]) -> tuple[str, ...]:
    error = plugin["error"]
    state = f"SKIPPED: {error}" if error else "works"
    return plugin["name"], plugin["kind"], plugin["package"], state


def _limits_text(limits: dict[str, bool]) -> str:
    held = [name for name, holds in limits.items() if holds]
    lacking = [name for name, holds in limits.items() if not holds]
    return (", ".join(held) or "none") + (f" (NOT {', '.join(lacking)})" if lacking else "")


def _data_text(data: dict[str, Any]) -> str:
    if data["path"] is None:
        return "not set"
    return f"{data['path']} ({'found' if data['found'] else 'NOT FOUND'})"


def _extra_text(extra: dict[str, Any]) -> str:
    return "installed" if extra["installed"] else extra["install"]


def check_sources() -> dict[str, str]:
    """Return a short description of the state of each kind of live source."""
    from holdfast.devices.uri import SOURCE_PLUGINS

    others = {name: _ask_child("source_state", name) for name in SOURCE_PLUGINS.names()}
    known = {name: state for name, state in others.items() if state}
    return {"xela": _xela(), **known, "serial": _serial()}


def _xela() -> str:
    from holdfast.devices.sources.xela.places import places
    from holdfast.devices.uri import parse

    addresses = places(parse("xela://auto")[1])
    for address in addresses:
        with suppress(OSError), socket.create_connection(address, PROBE_TIMEOUT):
            return f"a server listens at {address}"
    return f"no server listens at {' or '.join(map(str, addresses))}"


def _serial() -> str:
    if not is_installed("serial"):
        return f"not installed: {install_command('serial')}"
    from serial.tools.list_ports import comports

    return ", ".join(port.device for port in comports()) or "no serial port"
