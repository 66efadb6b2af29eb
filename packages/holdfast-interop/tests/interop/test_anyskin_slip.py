import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, Cause
from holdfast.errors import RecordingError
from holdfast.io import import_recordings

MAGS = [f"mag{node}_{axis}" for node in range(1, 6) for axis in "xyz"]
DATES = [f"2025-02-03 10:00:0{k}.000004321" for k in range(4)]


def write(path, flags=(0, 1, 1, 0), times=None, name="log_time", mags=MAGS):
    """Write a file of the documented columns; the reading of sample k and column c is k + c/100."""
    stamps = [[] if times is None else [times[k]] for k in range(len(flags))]
    head = [*([] if times is None else [name]), *mags, "slip"]
    rows = [
        [*stamps[k], *(k + column / 100 for column in range(len(mags))), flag]
        for k, flag in enumerate(flags)
    ]
    path.write_text("\n".join(",".join(map(str, row)) for row in [head, *rows]) + "\n")
    return path


def only(path, form=None):
    (recording,) = import_recordings(path, form)
    return recording


def test_the_documented_columns(tmp_path):
    """Without a time, the rate of the sensor is assumed, and the metadata say so."""
    recording = only(write(tmp_path / "apple.csv"))
    module = recording.modules["finger1"]
    assert (recording.name, module.sensor.name, module.unit) == ("apple", "anyskin", "count")
    assert recording.metadata == {
        "source": "pollen-robotics/anyskin_slip_detection",
        "object": "apple",
        "clock": "none; 100 Hz assumed",
    }
    np.testing.assert_allclose(module.times, [0, 0.01, 0.02, 0.03])
    np.testing.assert_allclose(module.readings[2, 1], [2.03, 2.04, 2.05])
    assert module.label_states.tolist() == [STABLE, UNSTABLE, UNSTABLE, STABLE]
    assert [label.cause for label in module.labels] == [None, Cause.SLIP, None]
    assert "contact is not annotated" in module.labels[0].evidence


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        (DATES, [0, 1, 2, 3]),
        ([f"2025-02-03T10:00:00.00{k}Z" for k in range(4)], [0, 1e-3, 2e-3, 3e-3]),
        ([1738576800123456700 + 4_318_718 * k for k in range(4)], np.arange(4) * 4.318718e-3),
        ([1738576800123.5 + 4.25 * k for k in range(4)], np.arange(4) * 4.25e-3),
        ([10.0, 10.5, 11.0, 11.25], [0, 0.5, 1.0, 1.25]),
    ],
    ids=["dates", "ISO 8601", "ns", "ms", "s"],
)
def test_times_are_counted_from_the_first_sample(tmp_path, times, expected):
    recording = only(write(tmp_path / "ball.csv", times=times))
    np.testing.assert_allclose(recording.modules["finger1"].times, expected, atol=1e-6)
    assert recording.metadata["clock"] == "log_time"


def test_a_folder_has_a_recording_for_each_object(tmp_path):
    for name in ("cup", "apple", "no_slip"):
        write(tmp_path / f"{name}.csv", times=DATES, flags=("False", "True", "", "0"))
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    found = {recording.name: recording for recording in import_recordings(tmp_path)}
    assert list(found) == ["apple", "cup", "no_slip"]
    assert "object" not in found["no_slip"].metadata
    states = found["cup"].modules["finger1"].label_states
    assert states.tolist() == [STABLE, UNSTABLE, UNKNOWN, STABLE]


def test_other_columns_are_ignored_and_labels_may_be_missing(tmp_path):
    path = write(tmp_path / "a.csv", times=DATES, flags=("good", "", "bad", "good"))
    path.write_text(path.read_text().replace(",slip\n", ",note\n"))
    module = only(path).modules["finger1"]
    assert (module.n_samples, module.labels) == (4, ())


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"flags": (0, 2, 0, 0)}, "row 3, column 'slip': '2' given, 0 or 1 expected"),
        (
            {"times": [1, "soon", 3, 4]},
            "row 3, column 'log_time': 'soon' given; a date and time, or a number of seconds",
        ),
        ({"times": [1, "", 3, 4]}, "row 3, column 'log_time': '' given; a date and time"),
        ({"times": [1, 2, "1e300", 4]}, "row 4, column 'log_time': '1e300' given"),
        ({"times": [1, 2, 2, 3]}, "times stand still at sample 2: 1 s after 1 s"),
        ({"times": [1, 5, 2, 3]}, "times go back at sample 2: 1 s after 4 s"),
        ({"mags": MAGS[:-1]}, "column 'mag5_z' is missing; it has 'mag1_x', 'mag1_y'"),
        ({"mags": [*MAGS[:-1], "mag5_w"]}, "column 'mag5_z' is missing"),
    ],
)
def test_bad_input_gives_one_line(tmp_path, changes, text):
    path = write(tmp_path / "a.csv", **changes)
    with pytest.raises(RecordingError) as caught:
        only(path, "anyskin-slip")
    assert str(caught.value).startswith(str(path))
    assert text in str(caught.value) and "\n" not in str(caught.value)


def test_readings_that_are_no_numbers(tmp_path):
    path = write(tmp_path / "a.csv")
    path.write_text(path.read_text().replace("2.05", "high"))
    with pytest.raises(RecordingError, match="row 4, column 'mag2_z': 'high' given, a number"):
        only(path)


def test_no_such_file(tmp_path):
    with pytest.raises(RecordingError, match=r"no anyskin-slip file in .*; CSV files with columns"):
        list(import_recordings(tmp_path, "anyskin-slip"))
