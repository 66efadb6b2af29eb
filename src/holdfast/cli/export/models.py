"""`holdfast export MODEL OUT`: a model as a C99 header."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.options import RARE
from holdfast.cli.terminal.console import print_json, print_line


@dataclass(frozen=True)
class HeaderOptions:
    """Group of options: the hand and the numbers of a C header."""

    like: Annotated[
        Path | None,
        typer.Option(help="A recording with the fingers, sensors and rate of the hand."),
    ] = None
    sensor: Annotated[
        str | None, typer.Option(help="Sensor of every finger, without a recording.")
    ] = None
    fingers: Annotated[
        str | None,
        typer.Option(help="Number of fingers, or their names with commas between them."),
    ] = None
    single: Annotated[
        bool,
        typer.Option(
            "--float", help="Numbers of single precision in the header; times stay double."
        ),
    ] = False
    in_contact: Annotated[
        bool | None,
        typer.Option(
            "--in-contact/--open-hand",
            help="Whether the object is held at the first sample.",
            show_default="as the recording says, else open",
        ),
        RARE,
    ] = None


def export_model(
    model: str, out: Path, options: HeaderOptions, *, force: bool, as_json: bool
) -> None:
    """Write a model as a C99 header.

    Args:
        model: a model file or builtin:NAME.
        out: `model.h`.
        options: the hand, and the numbers of the header.
        force: replace an existing file.
        as_json: print JSON.

    Raises:
        ValueError: options contradict each other.
        HoldfastError: the model cannot be exported.
    """
    from holdfast.detection import Model
    from holdfast.exporters import export as write
    from holdfast.exporters import fingers_of_sensor
    from holdfast.io import load_recording

    sensor, fingers = options.sensor, options.fingers
    if (sensor is None) != (fingers is None) or (sensor is not None and options.like is not None):
        raise ValueError(
            "either --like RECORDING or both --sensor NAME and --fingers N expected, or none of "
            "them for a model that names its fingers"
        )
    # A model for any finger has no hand of its own: the header needs that of a recording or of
    # the options.
    named = fingers_of_sensor(sensor, fingers) if sensor and fingers else None
    like = None if options.like is None else load_recording(options.like)
    written = write(
        Model.load(model), out, like, fingers=named, single=options.single,
        in_contact=options.in_contact, force=force,
    )  # fmt: skip
    header = written.header
    if as_json:
        document = {
            "out": written.path,
            "fingers": written.fingers,
            "size": written.size,
            "state_size": header.state_size,
            "constants_size": header.constants_size,
            "double_fields": header.double_fields,
        }
        print_json(document)
    else:
        print_line(f"{written.path}: the detector of {', '.join(written.fingers)}")
        print_line(f"  state      {header.state_size:9} bytes, one for each hand")
        print_line(f"  constants  {header.constants_size:9} bytes")
        if header.double_fields:
            print_line(f"  double     {', '.join(header.double_fields)}: they hold times")
