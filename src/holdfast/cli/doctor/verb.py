"""`holdfast doctor`: check the installation and the live sources, or the modules of a source."""

from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import JsonOption, PlotOptions, check_seconds
from holdfast.cli.terminal.console import print_json, print_line, print_paragraph, print_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEALTHY = "nothing is wrong"


def doctor(
    source: Annotated[
        str | None, typer.Argument(help="Source or recording whose modules are checked.")
    ] = None,
    *,
    figure: PlotOptions,
    seconds: Annotated[float, typer.Option(help="Duration of the check [s].")] = 10.0,
    as_json: JsonOption = False,
) -> None:
    """Check the installation and the sources, or the modules of one.

    Report Python, the packages, the extras and how to install them, the kernel, the
    live sources that can be reached, which limits this system has for imports (time of the
    processor, memory), the plug-ins of other packages, and the folder in HOLDFAST_DATA. The
    exit code is always 0.

    With SOURCE, read ten seconds of the open hand, up to the first touch, and report for each
    module the rate, the jitter, the gaps, the noise by axis and of the loudest taxel, dead and
    stuck taxels, zeros, the range, and the magnetic field, if you turn the hand.

    Example:
      holdfast doctor
      holdfast doctor --json
      holdfast doctor xela://auto --plot health.png
    """
    if source is not None:
        check_modules(source, seconds, figure, as_json=as_json)
        return
    if figure.plot is not None:
        raise ValueError("--plot is for the modules of a source; SOURCE expected")
    from holdfast.cli.doctor.installation import installation, print_installation

    report = installation()
    print_json(report) if as_json else print_installation(report)


def check_modules(uri: str, seconds: float, figure: PlotOptions, *, as_json: bool) -> None:
    """Check the modules of a source, and print what is wrong.

    Args:
        uri: of the source, or path of a recording.
        seconds: duration of the check [s].
        figure: of the noise of each taxel.
        as_json: print JSON.

    Raises:
        SourceError: too few samples arrive, or a module is touched from the start.
    """
    from msgspec import to_builtins

    from holdfast.devices.sources import open_source
    from holdfast.live.health import check_health, findings_of, table_of

    def draw() -> "Figure":
        from holdfast.plots.sensors import plot_noise

        return plot_noise({name: module.noise for name, module in check.modules.items()})

    check_seconds(seconds)
    figure.check()  # before ten seconds are read
    with open_source(uri, speed=0) as source:
        check = check_health(source, seconds)
    findings = findings_of(check)
    figure.save(draw)
    if as_json:
        print_json(to_builtins(check) | {"findings": findings})
        return
    header = ("module", "rate [Hz]", "jitter [ms]", "gaps", "zeros", "noise x y z",
              "loudest (taxel)", "readings", "field")  # fmt: skip
    print_table(header, table_of(check.modules))
    print_line()
    for finding in findings or [HEALTHY]:
        print_paragraph(finding, "- ", "  ")
