"""`holdfast sensors`: the built-in sensors and hands, and files of sensors of one's own."""

from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import JsonOption, PlotOptions
from holdfast.cli.terminal.console import print_json, print_line, print_lines, print_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def sensors(
    name: Annotated[
        str | None,
        typer.Argument(help="Name of a built-in sensor or hand, or a .json or .urdf file."),
    ] = None,
    base: Annotated[
        str | None, typer.Option(help="Link of the .urdf file that is the fingertip frame.")
    ] = None,
    template: Annotated[
        str | None,
        typer.Option(
            metavar="ROWSxCOLUMNS", help="Print the JSON file of a flat grid, to be edited."
        ),
    ] = None,
    pitch: Annotated[
        float, typer.Option(help="With --template: distance between neighbouring taxels [mm].")
    ] = 5.0,
    rate: Annotated[float, typer.Option(help="With --template: nominal sample rate [Hz].")] = 100.0,
    unit: Annotated[
        str, typer.Option(help="With --template: unit of the readings, count or N.")
    ] = "count",
    *,
    figure: PlotOptions,
    as_json: JsonOption = False,
) -> None:
    """List the known sensors and hands, or show one of them.

    For a sensor: its taxels, unit, rate, range and normal. For a hand: its modules and their
    indices in the flat packet, from 0. The figure shows the taxels with their numbers, from 1.

    --template prints the file of a sensor of your own: a flat grid, row by row from the top left,
    with z along the outward normal (docs/sensors.md).

    Example:
      holdfast sensors
      holdfast sensors allegro-uskin --plot hand.svg
      holdfast sensors fingertip.urdf --base tip_link --json
      holdfast sensors --template 3x3 --pitch 4.7 > sensor.json
    """
    from holdfast.sensors import Sensor
    from holdfast.sensors.files import find_layout, grid_file, pose_rows, sensor_rows
    from holdfast.sensors.taxel_numbers import index_ranges

    def draw() -> "Figure":
        from holdfast.plots.sensors import plot_hand, plot_sensor

        return plot_sensor(layout) if isinstance(layout, Sensor) else plot_hand(layout)

    if template is not None:
        if name is not None:
            raise ValueError(f"--template makes a new sensor; {name!r} given as well")
        print_lines(grid_file(template, pitch, rate, unit).split("\n"))
        return
    if name is None:
        if figure.plot is not None or base is not None:
            raise ValueError(
                "--plot and --base need the name of a sensor; holdfast sensors lists them"
            )
        print_all(as_json=as_json)
        return
    layout = find_layout(name, base)
    figure.check()  # only now: an unknown name is the worse mistake
    figure.save(draw)
    if as_json:
        facts = layout.to_dict()
        print_json(facts | {"n_taxels": layout.n_taxels} if isinstance(layout, Sensor) else facts)
    elif isinstance(layout, Sensor):
        print_table(("sensor", layout.name), sensor_rows(layout))
        print_line()
        header = ("taxel", "x [mm]", "y [mm]", "z [mm]", "n_x", "n_y", "n_z")
        print_table(header, pose_rows(layout))
    else:
        rows = [
            (name, m.sensor.name, m.sensor.n_taxels, m.link, index_ranges(m.flat_indices.tolist()))
            for name, m in layout.modules.items()
        ]
        print_table(("module", "sensor", "taxels", "link", "flat indices, from 0"), rows)


def print_all(*, as_json: bool) -> None:
    """Print the name, taxels, unit, rate and maker of all sensors, and all hands."""
    from holdfast.sensors.built_in import HANDS, SENSORS_BY_MAKER

    skins = [
        (make(), maker) for maker, makers in SENSORS_BY_MAKER.items() for make in makers.values()
    ]
    hands = [make() for make in HANDS.values()]
    if as_json:
        fields = ("name", "n_taxels", "unit", "rate", "range", "normal")
        facts = [{n: getattr(skin, n) for n in fields} | {"maker": maker} for skin, maker in skins]
        print_json({"sensors": facts, "hands": [hand.to_dict() for hand in hands]})
        return
    rows = [(x.name, x.n_taxels, x.unit, f"{x.rate:g} Hz", maker) for x, maker in skins]
    print_table(("sensor", "taxels", "unit", "rate", "maker"), rows)
    print_line()
    counts = [(hand.name, hand.n_taxels, len(hand.modules)) for hand in hands]
    print_table(("hand", "taxels", "modules"), counts)
