"""`holdfast sensors`: the built-in sensors and hands, and files of sensors of one's own."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.options import JsonOption, PlotOptions
from holdfast.cli.terminal.console import print_json, print_line, print_lines, print_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from holdfast.sensors import Hand, Sensor


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
    from holdfast import sensors as known

    def draw() -> "Figure":
        from holdfast.plots.sensors import plot_hand, plot_sensor

        return plot_sensor(layout) if isinstance(layout, known.Sensor) else plot_hand(layout)

    if template is not None:
        if name is not None:
            raise ValueError(f"--template makes a new sensor; {name!r} given as well")
        _print_template(template, pitch, rate, unit)
        return
    if name is None:
        if figure.plot is not None or base is not None:
            raise ValueError(
                "--plot and --base need the name of a sensor; holdfast sensors lists them"
            )
        _print_all(as_json)
        return
    layout = _find(name, base)
    figure.check()
    figure.save(draw)
    if isinstance(layout, known.Sensor):
        facts = layout.to_dict() | {"n_taxels": layout.n_taxels}
        print_json(facts) if as_json else _print_sensor(layout)
    elif as_json:
        print_json(_hand_facts(layout))
    else:
        rows = [
            (name, m.sensor.name, m.sensor.n_taxels, m.link, _ranges(m.flat_indices.tolist()))
            for name, m in layout.modules.items()
        ]
        print_table(("module", "sensor", "taxels", "link", "flat indices, from 0"), rows)


def find_sensor(name: str) -> "Sensor":
    """Return a built-in sensor by its name, or the sensor in a JSON file.

    Raises:
        ValueError: the name is unknown, or the file is not valid.
        OSError: the file cannot be read.
    """
    from holdfast import sensors as known

    if Path(name).suffix.lower() == ".json":
        return known.Sensor.from_json(name)
    if name in (names := known.sensor_names()):
        return known.sensor(name)
    raise ValueError(
        f"unknown sensor {name!r}; built in are {', '.join(names)}; or give a "
        ".json file (`holdfast sensors --template 3x3 > sensor.json` makes one)"
    )


def _print_template(grid: str, pitch: float, rate: float, unit: str) -> None:
    """Print the JSON of a flat grid, one line for each taxel."""
    import json

    from holdfast.sensors import flat_sensor

    rows, _, columns = grid.lower().partition("x")
    if not (rows.isdecimal() and columns.isdecimal() and int(rows) * int(columns)):
        raise ValueError(f"--template: ROWSxCOLUMNS such as 3x3 expected, {grid!r} given")
    if not 0 < pitch < math.inf:
        raise ValueError(f"--pitch: a distance above 0 mm expected, {pitch:g} given")
    if unit not in ("count", "N"):
        raise ValueError(f"--unit: count or N expected, {unit!r} given")
    made = flat_sensor(
        f"grid-{grid.lower()}", int(rows), int(columns), 1e-3 * pitch,
        rate=rate, unit="N" if unit == "N" else "count",
    )  # fmt: skip
    fields = []
    for key, value in made.to_dict().items():
        text = json.dumps(value)
        if isinstance(value, list) and isinstance(value[0], list):
            text = "[\n    " + ",\n    ".join(map(json.dumps, value)) + "\n  ]"
        fields.append(f"{json.dumps(key)}: {text}")
    print_lines(("{\n  " + ",\n  ".join(fields) + "\n}").split("\n"))


def _find(name: str, base: str | None) -> "Sensor | Hand":
    from holdfast import sensors as known

    suffix = Path(name).suffix.lower()
    if suffix == ".urdf":
        if base is None:
            raise ValueError(f"{name} needs --base LINK: the link that is the fingertip frame")
        return known.Sensor.from_urdf(name, base)
    if base is not None:
        raise ValueError(f"--base belongs to a .urdf file; {name!r} given")
    if suffix == ".json":
        return known.Sensor.from_json(name)
    if name in known.built_in_hands():
        return known.hand(name)
    if name in (names := known.sensor_names()):
        return known.sensor(name)
    raise ValueError(
        f"unknown sensor or hand {name!r}; built in are "
        f"{', '.join(names + known.built_in_hands())}; "
        "or give a .json or .urdf file"
    )


def _print_all(as_json: bool) -> None:
    from holdfast import sensors as known

    all_sensors = [known.sensor(name) for name in known.built_in_sensors()]
    all_sensors += known.SENSOR_PLUGINS.load_all().values()
    all_hands = [known.hand(name) for name in known.built_in_hands()]
    if as_json:
        fields = ("name", "n_taxels", "unit", "rate", "range", "normal")
        facts = [{field: getattr(s, field) for field in fields} for s in all_sensors]
        print_json({"sensors": facts, "hands": [_hand_facts(hand) for hand in all_hands]})
        return
    rows = [(s.name, s.n_taxels, s.unit, f"{s.rate:g} Hz") for s in all_sensors]
    print_table(("sensor", "taxels", "unit", "rate"), rows)
    print_line()
    print_table(
        ("hand", "taxels", "modules"), [(h.name, h.n_taxels, len(h.modules)) for h in all_hands]
    )


def _hand_facts(hand: "Hand") -> dict[str, Any]:
    modules = {
        name: {
            "sensor": module.sensor.name,
            "n_taxels": module.sensor.n_taxels,
            "link": module.link,
            "flat_indices": module.flat_indices,
        }
        for name, module in hand.modules.items()
    }
    return {"name": hand.name, "n_taxels": hand.n_taxels, "modules": modules}


def _print_sensor(sensor: "Sensor") -> None:
    from holdfast.sensors import taxel_number

    ends = "unknown" if sensor.range is None else "{:g} to {:g}".format(*sensor.range)
    normal = ", ".join(f"{value:.3g}" for value in sensor.normal)
    print_table(
        ("sensor", sensor.name),
        [
            ("taxels", sensor.n_taxels),
            ("unit", sensor.unit),
            ("rate", f"{sensor.rate:g} Hz"),
            ("range", ends),
            ("normal", f"({normal}) in the fingertip frame"),
        ],
    )
    print_line()
    rows = [
        (
            taxel_number(k),
            *(f"{1e3 * p:.1f}" for p in position),
            *(f"{z:.2f}" for z in rotation[:, 2]),
        )
        for k, (position, rotation) in enumerate(
            zip(sensor.positions, sensor.rotations, strict=True)
        )
    ]
    print_table(("taxel", "x [mm]", "y [mm]", "z [mm]", "n_x", "n_y", "n_z"), rows)


def _ranges(indices: list[int]) -> str:
    """Return indices as ranges: "0-8, 18-26"."""
    runs: list[list[int]] = []
    for index in sorted(indices):
        if runs and index == runs[-1][1] + 1:
            runs[-1][1] = index
        else:
            runs.append([index, index])
    return ", ".join(f"{a}-{b}" if a < b else f"{a}" for a, b in runs)
