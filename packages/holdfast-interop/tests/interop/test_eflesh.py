import os
import re
import zipfile

import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import import_recordings

pytestmark = pytest.mark.slow

N = 20
VALUES = np.arange(N * 30, dtype="<f4").reshape(N, 30)


def write(path, values=VALUES, *, pickle=b"torch\nFloatStorage\n.", **members):
    """Write a tensor as torch does, without torch."""
    data = values if isinstance(values, bytes) else values.tobytes()
    content = {"data.pkl": pickle, "byteorder": b"little", "data/0": data, "version": b"3\n"}
    with zipfile.ZipFile(path, "w") as archive:
        for name, part in (content | members).items():
            if part is not None:
                archive.writestr(f"{path.stem}/{name}", part)
    return path


def refusal(path):
    with pytest.raises(RecordingError) as caught:
        list(import_recordings(path, "eflesh"))
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_a_folder_of_sequences_with_labels(tmp_path):
    for number in (10, 9, 11):
        write(tmp_path / f"seq_{number}.pt")
    (tmp_path / "labels.csv").write_text("sequence,slip\n9,1\n10,0\n")
    recordings = list(import_recordings(tmp_path))
    assert [recording.name for recording in recordings] == ["seq_9", "seq_10", "seq_11"]
    assert [recording.metadata.get("slipped") for recording in recordings] == [True, False, None]
    first = recordings[0]
    assert list(first.modules) == ["finger1", "finger2"]
    one, two = first.modules.values()
    assert (one.sensor.name, one.unit, one.readings.dtype) == ("anyskin", "count", np.float32)
    assert one.readings[1, 1].tolist() == [33, 34, 35]
    assert two.readings[0, 0].tolist() == [15, 16, 17]
    np.testing.assert_allclose(one.times, np.arange(N) / 100)
    assert first.metadata["starts_loaded"]
    assert first.metadata["clock"] == "none; 100 Hz assumed"


def test_labels_as_the_authors_have_them(tmp_path):
    for number in (0, 2, 3):
        write(tmp_path / f"seq_{number}.pt")
    (tmp_path / "labels").write_text("1\n0\n0\r\n")
    slipped = [recording.metadata.get("slipped") for recording in import_recordings(tmp_path)]
    assert slipped == [True, False, None]
    (tmp_path / "labels").write_text("1\n\n2\n")
    assert f"{tmp_path / 'labels'}, line 2" in refusal(tmp_path / "seq_0.pt")


class Bomb:
    """Creates a file if it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


def test_nothing_is_unpickled(tmp_path):
    import pickle

    target = tmp_path / "unpickled"
    pickle.loads(pickle.dumps(Bomb(target)))
    assert target.exists(), "the bomb of this test does not work"
    target.unlink()
    for content in (pickle.dumps(Bomb(target), 2), None, b"", b"\x00\xff" * 10):
        (recording,) = import_recordings(write(tmp_path / "seq_1.pt", pickle=content))
        assert recording.modules["finger1"].n_samples == N
        assert not target.exists()


@pytest.mark.parametrize(
    ("values", "members", "text"),
    [
        (VALUES[:, :29], {}, "2320 bytes"),
        (b"", {}, "0 bytes"),
        (VALUES, {"data/1": b"1234"}, "2 tensors"),
        (VALUES, {"data/0": None}, "0 tensors"),
        (VALUES, {"byteorder": b"big"}, "b'big'"),
        (VALUES.astype("<f8"), {"pickle": b"torch\nDoubleStorage\n"}, "DoubleStorage"),
    ],
)
def test_tensors_of_another_form(tmp_path, values, members, text):
    path = write(tmp_path / "seq_1.pt", values, **members)
    assert re.search(rf"seq_1\.pt: .*{text}", refusal(path))


def test_cut_and_damaged_files(tmp_path):
    path = write(tmp_path / "seq_1.pt")
    data = path.read_bytes()
    for size in range(1, len(data), len(data) // 9):
        path.write_bytes(data[:size])
        assert refusal(path).startswith(f"{path} is cut or damaged: ")
    offset = data.index(VALUES.tobytes()[:64]) + 100
    path.write_bytes(data[:offset] + bytes([data[offset] ^ 1]) + data[offset + 1 :])
    assert refusal(path).startswith(f"{path} is cut or damaged: ")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sequence,slip\n1,2\n", "row 2"),
        ("sequence,slip\n1,1\n1,0\n", "row 3"),
        ("sequence,slip\nx,1\n", "row 2, column 'sequence'"),
        ("number,slip\n1,1\n", "'sequence'"),
        ("", "is empty"),
    ],
)
def test_labels_of_another_form(tmp_path, text, message):
    path = write(tmp_path / "seq_1.pt")
    (tmp_path / "labels.csv").write_text(text)
    assert re.search(rf"labels\.csv.*{message}", refusal(path))


def test_the_real_recordings(data_folder):
    recordings = list(import_recordings(data_folder / "eflesh_slip"))
    assert len(recordings) == 69
    assert sum(recording.metadata["slipped"] for recording in recordings) == 52
    for recording in recordings:
        assert [module.n_samples for module in recording.modules.values()] == [300, 300]
        assert recording.duration == pytest.approx(2.99)
