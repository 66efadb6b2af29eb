"""Logs of XELA's server, as a terminal or a script saves its messages."""

import json

import numpy as np
import pytest

from holdfast.devices.sources.xela import messages
from holdfast.errors import RecordingError
from holdfast.io import import_recordings

N = 50
COUNTS = np.random.default_rng(3).integers(30_000, 36_000, (N, 2, 24, 3))


def lines(n=N):
    for k in range(n):
        sensors = {
            str(s + 1): {
                "time": 1000 + k / 100, "sensor": str(s + 1), "model": "uSPa46", "taxels": 24,
                "data": ",".join(f"{count:04X}" for count in COUNTS[k, s].ravel()),
            }
            for s in (0, 1)
        }  # fmt: skip
        head = {"message": k + 1, "time": 1000 + k / 100, "version": "1.8.0b_208601"}
        yield json.dumps(head | sensors)


def check(recording):
    assert list(recording.modules) == ["finger1", "finger2"]
    for s, module in enumerate(recording.modules.values()):
        assert module.sensor.name == "uskin-4x6"
        np.testing.assert_allclose(np.diff(module.times), 0.01, atol=1e-6)
        np.testing.assert_array_equal(module.readings, COUNTS[:, s])


@pytest.mark.parametrize("between", ["", "[2026-01-14T13:40:06] [JSON]\n", "# \u00b5\n\n"])
def test_a_log_is_read_by_the_live_decoder(tmp_path, between):
    path = tmp_path / "grasp.jsonl"
    path.write_text("".join(f"{between}{line}\n" for line in lines()), "utf-8")
    (recording,) = import_recordings(path)
    check(recording)
    assert recording.name == "grasp"
    assert recording.metadata["server_version"] == "1.8.0b_208601"


def test_messages_that_are_lost_or_damaged_are_counted(tmp_path):
    kept = [*lines()]
    damaged = [*kept[:10], kept[10][:300] + "}", *kept[11:20], *kept[25:]]
    path = tmp_path / "cut.txt"
    path.write_text("\n".join(damaged) + "\n" + kept[-1][:100], "utf-8")
    (recording,) = import_recordings(path)
    assert recording.modules["finger1"].n_samples == N - 6
    assert recording.metadata["n_lost"] == 6


def test_the_logs_of_a_folder(tmp_path):
    for name in ("b10.jsonl", "b9.log"):
        (tmp_path / name).write_text("\n".join(lines(20)), "utf-8")
    (tmp_path / "notes.txt").write_text("hello")
    (tmp_path / "other.json").write_text('{"type": "tactile", "data": [1, 2, 3]}')
    assert [path.name for path in messages.parts(tmp_path)] == ["b9.log", "b10.jsonl"]
    assert [one.name for one in import_recordings(tmp_path)] == ["b9", "b10"]


def test_what_is_no_log(tmp_path):
    path = tmp_path / "a.jsonl"
    for text in ("", '{"data": [1, 2, 3]}\n', "{" + " " * 2**21, '{"message": 1, "time": 1}\n'):
        path.write_text(text)
        assert not messages.can_read(path)
    with pytest.raises(RecordingError, match="no log"):
        messages.parts(tmp_path)
    with pytest.raises(RecordingError, match="no samples"):
        list(messages.read(path))
    path.write_text("\n".join(lines(2)) + "\n{" + " " * 2**20)
    with pytest.raises(RecordingError, match="1048576"):
        list(messages.read(path))
