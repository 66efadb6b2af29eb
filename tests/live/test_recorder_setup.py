"""What a recording of a source is named and holds; `tests/cli/test_record.py` has the rest."""

import pytest

from holdfast.devices.sources import open_source
from holdfast.errors import OutputError, SourceError
from holdfast.io import save_recording
from holdfast.live.recorder_setup import (
    arrivals_for,
    create_recorder,
    recording,
    recording_path,
    typed_metadata,
)
from holdfast.synthetic import synthetic_recording


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("3", 3), ("-3", -3), ("0.25", 0.25), ("can", "can"), ("", ""), ("1e5", "1e5"),
        ("9" * 15, 999_999_999_999_999), ("9" * 16, "9" * 16), ("\u0663", "\u0663"),
    ],
)  # fmt: skip
def test_texts_of_numbers_become_numbers(text, value):
    pairs = typed_metadata("", "2", [f"x={text}"])
    assert pairs == {"case": "2", "x": value}
    assert type(pairs["x"]) is type(value)


@pytest.mark.parametrize(
    ("settings", "name"),
    [(["x"], "'x'"), (["=1"], "'=1'"), (["x=1", "x=2"], "x is"), (["object=ball"], "object is")],
)
def test_settings_of_another_form(settings, name):
    with pytest.raises(ValueError, match=f"^--set.*{name}"):
        typed_metadata("can", "", settings)


@pytest.mark.parametrize(
    ("source", "object_name", "start"),
    [
        ("xela://auto", "", "xela-20"),
        ("twin:?object=can", "a can/..", "a_can-20"),
        ("ros2:///topic", "...", "grasp-20"),
    ],
)
def test_names_in_a_folder(tmp_path, source, object_name, start):
    path = recording_path(source, tmp_path, object_name, force=False)
    assert path.parent == tmp_path
    assert path.name.startswith(start) and path.suffix == ".mcap"


def test_a_recording_gives_its_name(tmp_path):
    assert recording_path("data/grasp.parquet", tmp_path / "new", "can", force=False) == (
        tmp_path / "new" / "grasp.mcap"
    )
    with pytest.raises(ValueError, match=r"new.csv: .*holdfast import"):
        recording_path("xela://auto", tmp_path / "new.csv", "", force=False)


@pytest.fixture
def source(tmp_path):
    save_recording(synthetic_recording("grasp", 1), tmp_path / "grasp.parquet")
    with open_source(str(tmp_path / "grasp.parquet"), speed=0) as opened:
        yield opened


def test_a_file_without_samples_is_removed(tmp_path, source):
    recorder = create_recorder(source, tmp_path / "new" / "a.mcap", {})
    assert recorder.path.exists()
    with (
        pytest.raises(SourceError, match="sent no samples"),
        recording(source, recorder),
    ):
        pass
    assert not recorder.path.exists()


def test_what_was_recorded_before_a_failure_is_named(tmp_path, source):
    recorder = create_recorder(source, tmp_path / "a.mcap", {})
    hint = f"the disk; see the recorded part with: holdfast info {recorder.path}"
    with pytest.raises(OutputError, match=f"^{hint}$"), recording(source, recorder):
        for arrival in arrivals_for(source, 0.5, 0):
            recorder.put(arrival, wait=True)
        raise OutputError("the disk")
    assert recorder.path.exists()
