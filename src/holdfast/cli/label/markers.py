"""`holdfast label markers`: stickers by which a camera sees slips."""

from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.options import ForceOption, JsonOption
from holdfast.cli.terminal.console import print_json, print_line
from holdfast.errors import require_extras


def markers(
    sheet: Annotated[Path, typer.Argument(help="The PDF that is written.")],
    *,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Print stickers by which a camera sees slips.

    The sheet has one for the object (0) and one for each fingertip (1, 2, ... in the order of the
    recording). See docs/label-by-camera.md.

    Example:
      holdfast label markers sheet.pdf
    """
    require_extras("video")
    from holdfast.files import write_whole
    from holdfast.labelling.sticker_sheet import sticker_sheet

    if sheet.suffix.lower() != ".pdf":
        raise ValueError(f"a file with the suffix .pdf expected, {sheet.name!r} given")
    write_whole(sheet, sticker_sheet(), force=force)
    if as_json:
        print_json({"sheet": sheet})
    else:
        print_line(f"{sheet}: print it at 100 %, without scaling to the page")
