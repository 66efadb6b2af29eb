import os

import pytest

from holdfast.errors import RecordingError
from holdfast.io import FORMATS, import_recordings
from holdfast.io.importers import IMPORTER_PLUGINS, read_poses

NAMES = (*FORMATS, *IMPORTER_PLUGINS.names())
"""Formats of holdfast, and of the packages that are installed."""
FOLDERS = ("uskin-pick-move", "lerobot")
"""Formats of folders only."""


def test_unknown_formats(tmp_path):
    with pytest.raises(ValueError, match="'bag'; there are xela-log, "):
        import_recordings(tmp_path, "bag")


def test_a_file_of_no_known_format(tmp_path):
    (tmp_path / "a.txt").write_text("hello")
    for path in (tmp_path, tmp_path / "a.txt"):
        with pytest.raises(RecordingError, match=rf"{path} .*{', '.join(FORMATS)}.*--sensor"):
            import_recordings(path)


def test_a_missing_path(tmp_path):
    with pytest.raises(RecordingError, match="none does not exist"):
        import_recordings(tmp_path / "none", "csv")


@pytest.mark.parametrize("name", NAMES)
def test_a_folder_without_a_file_of_the_format(tmp_path, name):
    with pytest.raises(RecordingError, match="is empty"):
        list(import_recordings(tmp_path, name))
    (tmp_path / "a.txt").write_text("hello")
    with pytest.raises(RecordingError, match=r"^(no|.* has no) .* expected"):
        list(import_recordings(tmp_path, name))


@pytest.mark.parametrize("name", [name for name in NAMES if name not in FOLDERS])
def test_an_empty_file(tmp_path, name):
    (tmp_path / "a.csv").write_text("")
    with pytest.raises(RecordingError, match=r"a\.csv is empty"):
        list(import_recordings(tmp_path / "a.csv", name))


def test_a_pointer_of_git_lfs_is_named(tmp_path):
    path = tmp_path / "a.h5"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:a2aef56b\n")
    for source, form in ((path, "arrays"), (path, None), (tmp_path, None)):
        with pytest.raises(RecordingError, match=rf"{path} .*git lfs pull"):
            list(import_recordings(source, form))


def test_a_pipe_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "a.csv")
    with pytest.raises(RecordingError, match=r"a\.csv: it is a pipe"):
        import_recordings(tmp_path / "a.csv")


def test_a_format_without_poses(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,finger1:1:x,finger1:1:y,finger1:1:z\n0,1,2,3\n")
    with pytest.raises(RecordingError, match="of the format csv"):
        read_poses(path, {"object": "object"})
