import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.writer import Writer

from holdfast.errors import RecordingError
from holdfast.io import Dataset, load_dataset, save_recording


@pytest.fixture
def folder(make_recording, tmp_path):
    for k, name in enumerate(("b", "a", "c")):
        suffix = "mcap" if name == "c" else "parquet"
        save_recording(make_recording(150, seed=k, name=name), tmp_path / f"{name}.{suffix}")
    return tmp_path


def test_recordings_come_sorted_by_name(folder):
    dataset = load_dataset(folder)
    assert len(dataset) == 3
    assert dataset.names == ("a", "b", "c")
    assert [recording.name for recording in dataset] == ["a", "b", "c"]
    assert dataset[-1].name == "c"
    assert dataset[1:].names == ("b", "c")
    assert isinstance(dataset[1:], Dataset)


def test_other_files_are_ignored(folder):
    (folder / "model.json").write_text("{}")
    (folder / "b.labels.json.bak").write_text("{}")
    (folder / ".hidden.parquet").write_text("")
    (folder / "sub.parquet").mkdir()
    pq.write_table(pa.table({"a": [1]}), folder / "table.parquet")
    with (folder / "ros.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        writer.finish()
    assert load_dataset(folder).names == ("a", "b", "c")


def test_a_damaged_recording_is_not_ignored(folder):
    (folder / "a.parquet").write_bytes((folder / "a.parquet").read_bytes()[:-100])
    dataset = load_dataset(folder)
    assert dataset.names == ("a", "b", "c")
    with pytest.raises(RecordingError, match=r"a\.parquet is cut"):
        dataset[0]


def test_parquet_is_taken_before_mcap(folder, make_recording):
    save_recording(make_recording(150, name="b"), folder / "b.mcap")
    assert [path.name for path in load_dataset(folder).paths] == [
        "a.parquet",
        "b.parquet",
        "c.mcap",
    ]


def test_a_file_is_a_dataset_of_one(folder):
    assert load_dataset(folder / "c.mcap").names == ("c",)


def test_missing_and_empty_folders(tmp_path):
    with pytest.raises(RecordingError, match="none"):
        load_dataset(tmp_path / "none")
    (tmp_path / "a.txt").write_text("")
    with pytest.raises(RecordingError, match=rf"{tmp_path} \(1 .*`holdfast import`"):
        load_dataset(tmp_path)


def test_a_folder_of_recordings_in_the_folder_is_named(folder):
    deep = folder / "demo" / "recordings"
    deep.mkdir(parents=True)
    (folder / "a.parquet").rename(deep / "a.parquet")
    with pytest.raises(RecordingError, match=str(deep)):
        load_dataset(folder / "demo")


def test_recordings_can_be_declared_to_begin_in_contact(folder):
    assert "starts_loaded" not in load_dataset(folder)[0].metadata
    dataset = load_dataset(folder, in_contact=True)
    marked, plain = dataset[1:][0], load_dataset(folder)[1]
    assert marked.metadata == {**plain.metadata, "starts_loaded": True}
    assert marked.digest == plain.digest
    assert load_dataset(dataset.paths[0], in_contact=True)[0].metadata["starts_loaded"] is True
