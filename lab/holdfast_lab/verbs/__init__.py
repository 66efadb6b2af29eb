"""The verbs `study` and `trial`, which the command line finds by entry points."""

from pathlib import Path
from typing import Annotated

import typer

OutOption = Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")]
QuickOption = Annotated[
    bool, typer.Option("--quick", help="Do less, in a few minutes: for a first look.")
]
