"""Logs as labs have them: two clocks, other devices, clocks that are set, cells that are empty."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.io.proposals import ProposalError
from holdfast.sensors import sensor

TIMES = np.arange(300) / 100
TAXELS = [f"{axis}{k}" for k in range(5) for axis in "xyz"]
READINGS = np.random.default_rng(0).normal(scale=20, size=(300, 15)).round(2)
READINGS[100:] += 300


def imported(path, **options):
    (recording,) = import_recordings(path, sensors={"*": sensor("anyskin")}, **options)
    return recording


def write(path, names, columns):
    rows = [",".join(map(str, row)) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([",".join(names), *rows]) + "\n")
    return path


def test_a_module_has_the_times_that_name_it(tmp_path):
    arrays = {"left": READINGS, "right": READINGS, "time_left": TIMES, "time_right": TIMES + 0.7}
    np.savez(tmp_path / "a.npz", **{k: v.reshape(300, *[5, 3][: v.ndim * 2 - 2]) for k, v in
                                    arrays.items()})  # fmt: skip
    modules = imported(tmp_path / "a.npz").modules
    assert modules["right"].times[0] - modules["left"].times[0] == pytest.approx(0.7)


@pytest.mark.parametrize("column", ["device", "sensor"])
def test_rows_of_another_device_are_left_out(tmp_path, column):
    cells = np.where(np.arange(600)[:, None] % 2, "", np.repeat(READINGS, 2, axis=0).astype(str))
    cells[1::2, :3] = "1.5"
    kind = np.tile(["skin", "ft"], 300)
    path = write(tmp_path / "a.csv", ["time", column, *TAXELS],
                 [np.repeat(TIMES, 2), kind, *cells.T])  # fmt: skip
    recording = imported(path)
    assert {name: len(m.times) for name, m in recording.modules.items()} == {"skin": 300}


def test_rows_of_a_faster_device_are_no_samples(tmp_path):
    cells = np.full((1500, 15), "", dtype="U16")
    cells[::5] = READINGS.astype(str)
    force = np.arange(1500)
    path = write(tmp_path / "a.csv", ["time", *TAXELS, "ft_fx"],
                 [np.arange(1500) / 500, *cells.T, force])  # fmt: skip
    module = imported(path).modules["finger1"]
    assert (len(module.times), np.diff(module.times)[0]) == (300, pytest.approx(0.01))


@pytest.mark.parametrize("jump", [1, 100])
def test_a_clock_that_jumps_by_days_is_proposed_away(tmp_path, jump):
    times = np.where(np.arange(300) < jump, 0.0, 1.7e9) + TIMES
    path = write(tmp_path / "a.csv", ["time", *TAXELS], [times, *READINGS.T])
    with pytest.raises(ProposalError, match=r"--columns time=100Hz"):
        imported(path)


def test_times_that_fall_say_how_they_are_sorted(tmp_path):
    path = write(tmp_path / "a.csv", ["time", *TAXELS], [TIMES[::-1], *READINGS.T])
    with pytest.raises(RecordingError, match=r"sort_values\('time'\)"):
        imported(path)


def test_labels_that_are_numbers_are_not_used(tmp_path):
    path = write(tmp_path / "a.csv", ["time", *TAXELS, "label"],
                 [TIMES, *READINGS.T, np.arange(300) % 2])  # fmt: skip
    assert imported(path).modules["finger1"].labels == ()


def test_null_in_a_cell_is_no_reading(tmp_path):
    rows = [dict(zip(["time", *TAXELS], [t, *r], strict=True))
            for t, r in zip(TIMES.tolist(), READINGS.tolist(), strict=True)]  # fmt: skip
    rows[50]["x2"] = None
    (tmp_path / "a.jsonl").write_text("\n".join(map(json.dumps, rows)))
    cells = READINGS.tolist()
    cells[50] = None
    pq.write_table(pa.table({"tactile": cells, "timestamp": TIMES}), tmp_path / "a.parquet")
    (parquet,) = import_recordings(tmp_path / "a.parquet", sensors={"tactile": sensor("anyskin")})
    for recording, n_lost in ((imported(tmp_path / "a.jsonl"), 1), (parquet, 15)):
        (module,) = recording.modules.values()
        assert (len(module.times), np.isnan(module.readings[50]).sum()) == (300, n_lost)
