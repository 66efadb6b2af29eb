"""The formats of the package among all formats."""

import pytest

from holdfast.io.importers import FORMATS, IMPORTER_PLUGINS, importer
from holdfast_interop.lerobot.exporter import export

FOLDERS = {
    "uskin_pick_move": "uskin-pick-move", "eflesh_slip": "eflesh", "gtac": "gtac",
    "gtac_v2": "gtac",
}  # fmt: skip
"""Format of each folder of the real recordings."""


def claims(path):
    """Return all formats that recognise a path, so that their order does not matter."""
    names = (*FORMATS, *IMPORTER_PLUGINS.names())
    return [name for name in names if importer(name).can_read(path)]


@pytest.mark.parametrize("name", FOLDERS)
def test_one_format_recognises_real_recordings(name, data_folder):
    assert claims(data_folder / name) == [FOLDERS[name]]


def test_one_format_recognises_a_data_set(make_recording, tmp_path):
    export([make_recording()], tmp_path / "set")
    assert claims(tmp_path / "set") == ["lerobot"]
