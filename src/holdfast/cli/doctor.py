"""`holdfast doctor`: check the installation and the live sources, or the modules of a source."""

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.extensions import plugin_states
from holdfast.cli.options import JsonOption, PlotOptions, check_seconds
from holdfast.cli.terminal.console import print_json, print_line, print_paragraph, print_table
from holdfast.errors import EXTRA_PURPOSES, install_command, package_versions
from holdfast.threads import usable_processors

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def doctor(
    context: typer.Context,
    source: Annotated[
        str | None, typer.Argument(help="Source or recording whose modules are checked.")
    ] = None,
    *,
    figure: PlotOptions,
    seconds: Annotated[float, typer.Option(help="Duration of the check [s].")] = 10.0,
    history: Annotated[
        Path | None,
        typer.Option(help="File of the checks of this source; by default in the state folder."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Check the installation and the sources, or the modules of one.

    Report Python, the packages, the extras and how to install them, the kernel, the
    live sources that can be reached, which limits hold for imports (time, time of the processor,
    memory), the plug-ins of other packages, the configuration file of
    the hand, and the folder in HOLDFAST_DATA. The exit code is always 0.

    With SOURCE, read ten seconds of the open hand, which nothing touches, and report for each
    module the rate, the jitter, the gaps, the noise by axis and of the loudest taxel, dead and
    stuck taxels, zeros, the range, and the magnetic field, if you turn the hand. The check is
    kept, and compared with the last one.

    Example:
      holdfast doctor
      holdfast doctor --json
      holdfast doctor xela://auto --plot health.png
    """
    if source is not None:
        _check_modules(source, seconds, history, figure, as_json)
        return
    if figure.plot is not None or history is not None:
        raise ValueError("--plot and --history are for the modules of a source; SOURCE expected")
    from holdfast.cli.config import config_state
    from holdfast.devices.uri import source_states
    from holdfast.io.foreign import limits

    packages = package_versions()
    data = os.environ.get("HOLDFAST_DATA")
    report = {
        "holdfast": metadata.version("holdfast"),
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
        "kernels": _kernels(),
        "limits": limits(),
        "data": {"path": data, "found": data is not None and Path(data).is_dir()},
        "config": config_state(context.obj),
        "sources": source_states(),
        "plugins": [plugin._asdict() for plugin in plugin_states()],
    }
    if as_json:
        print_json(report)
    else:
        _print(report)


def _check_modules(
    uri: str, seconds: float, history: Path | None, figure: PlotOptions, as_json: bool
) -> None:
    from holdfast.devices.sources import open_source
    from holdfast.live.health import (
        changes_since,
        check_health,
        history_path,
        keep,
        read_history,
        table_of,
    )

    def draw() -> "Figure":
        from holdfast.plots.sensors import plot_noise

        return plot_noise({name: module.noise for name, module in check.modules.items()})

    check_seconds(seconds)
    figure.check()  # before ten seconds are read
    path = history_path(uri) if history is None else history
    earlier = read_history(path)
    with open_source(uri, speed=0) as source:
        check = check_health(source, seconds)
    last = earlier[-1] if earlier else None
    findings = changes_since(check, last)
    keep(path, earlier, check)
    figure.save(draw)
    if as_json:
        from msgspec import to_builtins

        report = to_builtins(check) | {"last": last and last.date, "findings": findings}
        print_json(report | {"history": str(path)})
    else:
        header = ("module", "rate [Hz]", "jitter [ms]", "gaps", "zeros", "noise x y z",
                  "loudest (taxel)", "readings", "field")  # fmt: skip
        print_table(header, table_of(check.modules))
        print_line()
        healthy = "nothing is wrong, and nothing is worse than at the last check"
        for finding in findings or [healthy]:
            print_paragraph(finding, "- ", "  ")


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


def _print(report: dict[str, Any]) -> None:
    kernels, data, limits = report["kernels"], report["data"], report["limits"]
    found = "found" if data["found"] else "NOT FOUND"
    held = ", ".join(name for name, holds in limits.items() if holds)
    lacking = ", ".join(name for name, holds in limits.items() if not holds)
    config = report["config"]
    hand = ", ".join(f"{key} {value}" for key, value in config["content"].items())
    hand = hand or "none: holdfast.toml in this folder, or HOLDFAST_CONFIG"
    hand = f"WRONG: {config['error']}" if config["error"] else hand
    rows = [(key, report[key]) for key in ("python", "platform", "cpus")]
    rows += [
        ("kernel", "works" if kernels["ok"] else kernels["error"]),
        ("limits of imports", (held or "none") + (f" (NOT {lacking})" if lacking else "")),
        ("HOLDFAST_DATA", "not set" if data["path"] is None else f"{data['path']} ({found})"),
        ("your hand", hand),
    ]
    packages = [(name, version or "MISSING") for name, version in report["packages"].items()]
    extras = [
        (name, extra["purpose"], "installed" if extra["installed"] else extra["install"])
        for name, extra in report["extras"].items()
    ]
    plugins = [
        (x["name"], x["kind"], x["package"], f"SKIPPED: {x['error']}" if x["error"] else "works")
        for x in report["plugins"]
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
