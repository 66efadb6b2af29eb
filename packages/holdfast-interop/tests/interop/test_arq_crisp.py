import sys
from contextlib import suppress

import h5py
import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, Cause
from holdfast.errors import MissingExtra, RecordingError
from holdfast.io import import_recordings

pytestmark = pytest.mark.slow

SHAPE = (18, 3, 4)
GROUP = "GGCNN2/Solder/Pose1/Exp1"


def write(path, codes, n_taxels=18, name="GGCNN2/Solder/Pose1/Exp1", **changes):
    n = len(codes)
    data = {
        "tactile_data_raw": np.arange(n_taxels * 3 * n).reshape(n_taxels, 3, n).astype(float),
        "tactile_timestamps": 1000.0 + 5.5 * np.arange(n),
        "tactile_slips_label": np.array(codes),
    }
    with h5py.File(path, "a") as file:
        for key, values in (data | changes).items():
            if values is not None:
                file[f"{name}/{key}"] = values


def test_every_experiment_is_a_recording(tmp_path):
    for experiment in (1, 2, 10):
        write(tmp_path / "a.h5", [4, 5], name=f"GGCNN2/Solder/Pose1/Exp{experiment}")
    recordings = list(import_recordings(tmp_path))
    assert [recording.name for recording in recordings] == [
        f"GGCNN2_Solder_Pose1_Exp{k}" for k in (1, 2, 10)
    ]
    first = recordings[0]
    assert first.metadata == {
        "source": "ARQ-CRISP",
        "planner": "GGCNN2",
        "object": "Solder",
        "pose": "Pose1",
        "repeat": "Exp1",
    }
    module = first.modules["finger1"]
    np.testing.assert_allclose(module.times, [1.0, 1.0055])
    assert module.readings[1, 2].tolist() == [13, 15, 17]


def test_the_documented_layout_of_2021(tmp_path):
    """A file for each object; GGCNN2/OBJECT/PoseN/ExpM holds float64 data and int64 labels."""
    codes = np.array([0, 3, 4, 5, 2, 0], dtype="<i8")
    arrays = {
        "tactile_data_raw": 32000.0 + np.arange(18 * 3 * 6).reshape(18, 3, 6),
        "tactile_timestamps": 1.6e12 + np.array([0.0, 5.546, 11.092, 16.638, 22.184, 27.73]),
        "tactile_slips_label": codes,
        "tactile_changes_label": (codes > 0).astype("<i8"),
    }
    for thing in ("brush", "screwDriver", "SpoolSolder"):
        with h5py.File(tmp_path / f"slipDataset_{thing}_tactile.h5", "w") as file:
            for pose in (1, 2):
                for experiment in (1, 10, 2):
                    group = file.create_group(f"GGCNN2/{thing}/Pose{pose}/Exp{experiment}")
                    for name, values in arrays.items():
                        group.create_dataset(name, data=values)
    recordings = list(import_recordings(tmp_path))
    assert [recording.name for recording in recordings[-6:]] == [
        f"GGCNN2_screwDriver_Pose{pose}_Exp{k}" for pose in (1, 2) for k in (1, 2, 10)
    ]
    assert {recording.metadata["object"] for recording in recordings} == {
        "brush", "screwDriver", "SpoolSolder",
    }  # fmt: skip
    module = recordings[0].modules["finger1"]
    assert module.readings.dtype == np.uint16
    assert module.readings[1].tolist() == arrays["tactile_data_raw"][:, :, 1].tolist()
    assert module.rate == pytest.approx(180.31, abs=0.01)
    assert module.label_states.tolist() == [
        NO_CONTACT, UNSTABLE, STABLE, UNSTABLE, UNSTABLE, NO_CONTACT,
    ]  # fmt: skip


@pytest.mark.parametrize(("n_taxels", "name"), [(18, "uskin-3x6"), (24, "uskin-4x6")])
def test_both_sensors(tmp_path, n_taxels, name):
    write(tmp_path / "a.h5", [4, 5], n_taxels)
    (recording,) = import_recordings(tmp_path / "a.h5")
    assert recording.modules["finger1"].sensor.name == name


def test_labels_of_known_states(tmp_path):
    codes = [0, 3, 0, 4, 0, 6, 1, 0, 5, 0, 2, 0]
    write(tmp_path / "a.h5", codes)
    (recording,) = import_recordings(tmp_path / "a.h5")
    module = recording.modules["finger1"]
    assert module.label_states.tolist() == [
        *(NO_CONTACT, UNSTABLE, STABLE, STABLE, STABLE, UNKNOWN),
        *(UNSTABLE, STABLE, UNSTABLE, STABLE, UNSTABLE, NO_CONTACT),
    ]
    causes = [label.cause for label in module.labels if label.cause]
    assert causes == [Cause.CLOSING, Cause.SLIP, Cause.SLIP, Cause.RELEASED]


def test_rest_of_unknown_state_has_no_label(tmp_path):
    write(tmp_path / "a.h5", [0, 4, 5, 0])
    (recording,) = import_recordings(tmp_path / "a.h5")
    states = recording.modules["finger1"].label_states
    assert states.tolist() == [UNKNOWN, STABLE, UNSTABLE, UNKNOWN]


@pytest.mark.parametrize(
    ("n_taxels", "changes", "text"),
    [
        (20, {}, "20 taxels given; 18 (3 x 6, 2021) or 24 (4 x 6, 2023) expected"),
        (
            18,
            {"tactile_timestamps": np.arange(3.0)},
            "tactile_data_raw of shape (n_taxels, 3, 3) expected, (18, 3, 2) given",
        ),
        (18, {"tactile_slips_label": np.array([1])}, "1 labels given for 2 samples"),
        (18, {"tactile_slips_label": np.array([1, 7])}, "labels 0 to 6 expected, 7 given"),
        (18, {"tactile_timestamps": np.zeros(2)}, "times stand still at sample 1: 0 s after 0 s;"),
    ],
)
def test_bad_input_gives_one_line(tmp_path, n_taxels, changes, text):
    path = tmp_path / "a.h5"
    write(path, [0, 4], n_taxels, **changes)
    with pytest.raises(RecordingError) as caught:
        list(import_recordings(path))
    assert str(caught.value).startswith(f"{path}: GGCNN2/Solder/Pose1/Exp1: {text}")


def test_files_that_are_not_a_data_set(tmp_path):
    path = tmp_path / "a.h5"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:a2aef56b\n")
    for place, form in ((path, "arq-crisp"), (path, None), (tmp_path, None)):
        with pytest.raises(RecordingError) as caught:
            list(import_recordings(place, form))
        assert str(caught.value) == (
            f"{path} is a pointer of Git LFS (63 bytes), not the data: in a clone, `git lfs pull` "
            "fetches them"
        )
    path.write_text("hello")
    with pytest.raises(RecordingError, match=r"a\.h5 is not an HDF5 file$"):
        list(import_recordings(path))
    path.unlink()
    write(path, [0, 1], tactile_data_raw=None)
    with pytest.raises(RecordingError, match="no group with tactile_data_raw in it"):
        list(import_recordings(path, "arq-crisp"))
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(RecordingError, match="is damaged or not a data set of ARQ-CRISP"):
        list(import_recordings(path, "arq-crisp"))


def test_without_h5py_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingExtra, match=r"h5py, which is not installed: .*hdf5"):
        import_recordings(tmp_path, "arq-crisp")


def external_storage(group, name, other):
    group.create_dataset(name, SHAPE, "f8", external=[(str(other), 0, h5py.h5f.UNLIMITED)])


def external_link(group, name, other):
    with h5py.File(other, "w") as file:
        file["x"] = np.zeros(SHAPE)
    group[name] = h5py.ExternalLink(str(other), "x")


def virtual(group, name, other):
    with h5py.File(other, "w") as file:
        file["x"] = np.zeros(SHAPE)
    layout = h5py.VirtualLayout(SHAPE, "f8")
    layout[:] = h5py.VirtualSource(str(other), "x", SHAPE)
    group.create_virtual_dataset(name, layout)


def soft_link(group, name, other):
    group.file["x"] = np.zeros(SHAPE)
    group[name] = h5py.SoftLink("/x")


@pytest.mark.parametrize("store", [external_storage, external_link, virtual, soft_link])
@pytest.mark.parametrize("name", ["tactile_data_raw", "tactile_timestamps", "tactile_slips_label"])
def test_only_arrays_in_the_file_itself_are_read(tmp_path, store, name):
    other = tmp_path / "secret"
    other.write_bytes(b"secret" * 1000)
    write(tmp_path / "a.h5", [4, 5, 4, 4], **{name: None})
    with h5py.File(tmp_path / "a.h5", "a") as file:
        store(file[GROUP], name, other)
    with pytest.raises(RecordingError, match=f"{GROUP}/{name} is no array stored in this file"):
        list(import_recordings(tmp_path / "a.h5", "arq-crisp"))


def test_a_group_in_another_file_is_not_found(tmp_path):
    write(tmp_path / "other.h5", [4, 5])
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["link"] = h5py.ExternalLink(str(tmp_path / "other.h5"), f"/{GROUP}")
    with pytest.raises(RecordingError, match="no group with tactile_data_raw"):
        list(import_recordings(tmp_path / "a.h5", "arq-crisp"))


def test_texts_and_huge_arrays_are_refused(tmp_path):
    write(tmp_path / "a.h5", [4, 5, 4, 4], tactile_timestamps=["a", "b", "c", "d"])
    with pytest.raises(RecordingError, match="numbers expected in tactile_timestamps, <U1 given"):
        list(import_recordings(tmp_path / "a.h5", "arq-crisp"))
    write(tmp_path / "b.h5", [4, 5, 4, 4], tactile_data_raw=None)
    with h5py.File(tmp_path / "b.h5", "a") as file:
        shape = (18, 3, 10**8)
        file[GROUP].create_dataset("tactile_data_raw", shape, "f8", chunks=(18, 3, 100))
    with pytest.raises(RecordingError, match=r"in memory, .* are allowed for a file of"):
        list(import_recordings(tmp_path / "b.h5", "arq-crisp"))


@pytest.mark.slow
def test_a_flipped_bit_raises_no_other_error(tmp_path):
    write(tmp_path / "a.h5", [4, 5, 4, 4])
    raw = (tmp_path / "a.h5").read_bytes()
    chance = np.random.default_rng(0)
    for place in chance.integers(8, len(raw), 400):
        damaged = bytearray(raw)
        damaged[place] ^= 1 << chance.integers(8)
        (tmp_path / "b.h5").write_bytes(damaged)
        with suppress(RecordingError):
            list(import_recordings(tmp_path / "b.h5", "arq-crisp"))
