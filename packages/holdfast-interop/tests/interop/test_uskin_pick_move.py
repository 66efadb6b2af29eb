import re

import numpy as np
import pytest

from holdfast.errors import RecordingError
from holdfast.io import import_recordings, load_recording, save_recording

N = 12


def write(path, names, values):
    lines = [",".join(names), *(",".join(map(str, row)) for row in values)]
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture
def folder(tmp_path):
    """A made recording of twelve samples: two stable, four of slip, six lost."""
    folder = tmp_path / "data_sample_1"
    folder.mkdir()
    k = np.arange(N)
    taxels = [f"txl{t + 1}_{axis}" for t in range(16) for axis in "xyz"]
    for finger in (1, 2):
        values = 1000.0 * finger + np.arange(48) + k[:, None]
        write(folder / f"xela_sensor{finger}.csv", taxels, values)
    robot = [f"position_joint{j + 1}" for j in range(7)]
    robot += [f"velocity_joint{j + 1}" for j in range(7)]
    robot += [f"ee_T_{row}{column}" for column in range(4) for row in range(4)]
    robot += ["v_x", "v_y", "time"]
    values = np.arange(33) + 100.0 * k[:, None]
    values[:, -1] = k / 64
    write(folder / "robot_state.csv", robot, values)
    marker = [f"marker_position_{axis}" for axis in "xyz"]
    marker += [f"marker_quaternion_{axis}" for axis in "xyzw"]
    poses = np.tile([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7], (N, 1))
    poses[6:] = 10.0
    write(folder / "marker.csv", marker, poses)
    write(folder / "slip_label.csv", ["slip", "fail"], np.stack([k >= 2, k >= 6], axis=1) * 1.0)
    write(folder / "meta_data.csv", ["dropped", "notes"], [[0, "fine"]])
    return folder


def test_all_comes_along(folder):
    (recording,) = import_recordings(folder.parent)
    assert recording.name == "data_sample_1"
    assert list(recording.modules) == ["finger1", "finger2"]
    first, second = recording.modules.values()
    assert (first.sensor.name, first.unit, first.readings.dtype) == ("uskin-4x4", "count", "uint16")
    assert first.readings[3, 2].tolist() == [1009, 1010, 1011]
    assert second.readings[0, 0].tolist() == [2000, 2001, 2002]
    np.testing.assert_allclose(first.times, np.arange(N) / 64)
    assert recording.metadata == {
        "object": "box",
        "source": "imanlab/proactive-slip-control",
        "starts_loaded": True,
        "dropped": 0,
        "notes": "fine",
    }
    truth = recording.truth.hand
    np.testing.assert_array_equal(truth["marker_pose"][0], [0.1, 0.2, 0.3, 0.7, 0.4, 0.5, 0.6])
    assert np.isnan(truth["marker_pose"][6:]).all()
    np.testing.assert_array_equal(truth["robot_joints"][0], np.arange(7))
    np.testing.assert_array_equal(truth["robot_joint_velocities"][0], np.arange(7, 14))
    np.testing.assert_array_equal(truth["robot_ee_pose"][0], np.arange(14, 30).reshape(4, 4).T)
    np.testing.assert_array_equal(truth["robot_velocity"][1], [130, 131])


def narrow(text):
    return "\n".join(line.rpartition(",")[0] for line in text.splitlines())


BAD = [
    ("xela_sensor2.csv", None, "No such file"),
    ("xela_sensor1.csv", lambda t: "", "is empty"),
    ("xela_sensor1.csv", lambda t: t.splitlines()[0], "no samples"),
    ("xela_sensor1.csv", narrow, "47 columns"),
    ("xela_sensor1.csv", lambda t: t.replace("txl4_y", "txl4_q"), "'txl4_y'"),
    (
        "xela_sensor1.csv",
        lambda t: t.replace("1013.0", "oops", 1),
        "row 2, column 'txl5_y'",
    ),
    ("xela_sensor1.csv", lambda t: t[:-10] + "\n", "row 13: 47 cells"),
    ("xela_sensor2.csv", lambda t: t[: t.rindex("\n", 0, -2) + 1], "11 rows"),
    ("slip_label.csv", lambda t: t.replace("1.0", "2.0", 1), "'slip' and 'fail'"),
    ("robot_state.csv", lambda t: t.replace(f"{2 / 64}", f"{1 / 64}"), "still at sample 2"),
    ("robot_state.csv", lambda t: t.replace(f"{2 / 64}", "0.001"), "back at sample 2"),
]


@pytest.mark.parametrize(("file", "change", "text"), BAD)
def test_bad_input_is_named(folder, file, change, text):
    path = folder / file
    if change is None:
        path.unlink()
    else:
        path.write_text(change(path.read_text()))
    named = folder if file == "robot_state.csv" else path
    with pytest.raises(RecordingError, match=f"{named}.*{text}"):
        list(import_recordings(folder, "uskin-pick-move"))


def test_the_real_recordings(data_folder, tmp_path, assert_same):
    recordings = list(import_recordings(data_folder / "uskin_pick_move"))
    counts = [recording.modules["finger1"].n_samples for recording in recordings]
    assert counts == [404, 354, 323, 285, 270]
    states = [np.bincount(r.modules["finger2"].label_states, minlength=4) for r in recordings]
    assert [s[2] for s in states] == [0, 0, 0, 104, 42]
    assert [s[1] for s in states] == [0, 0, 0, 101, 0]
    assert all(re.match(r"data_sample_2022-02-\d\d-", recording.name) for recording in recordings)
    for suffix in ("parquet", "mcap"):
        path = tmp_path / f"{recordings[3].name}.{suffix}"
        save_recording(recordings[3], path)
        assert_same(load_recording(path), recordings[3])
