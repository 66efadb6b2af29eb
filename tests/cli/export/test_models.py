import json
import shutil

import pytest

from command_line import Verb
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.slow


run = Verb("export").run


def test_the_sizes_are_printed(capsys, tmp_path):
    words = ("builtin:noise-floor", tmp_path / "model.h", "--sensor", "uskin-4x4", "--fingers", 2)
    code, out, err = run(capsys, *words)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].endswith("model.h: the detector of finger1, finger2")
    assert [line.split()[0] for line in lines[1:]] == ["state", "constants", "code"]


def test_json_has_the_sizes(capsys, tmp_path):
    save_recording(synthetic_recording("made", 0, ("thumb",)), tmp_path / "made.parquet")
    words = ("builtin:any", tmp_path / "model.h", "--like", tmp_path / "made.parquet", "--float")
    code, out, _ = run(capsys, *words, "--json")
    document = json.loads(out)
    assert code == 0 and document["fingers"] == ["thumb"]
    assert document["state_size"] > 10_000 and "track.time" in document["double_fields"]
    assert (document["code_size"] is None) == (shutil.which("cc") is None)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("builtin:any", "model.h"), "for any finger: a recording of the hand (--like)"),
        (("builtin:any", "model.h", "--sensor", "gtac"), "either --like RECORDING or both"),
        (("builtin:any", "model.h", "--like", "none.parquet"), "none.parquet"),
        (("builtin:any", "model.c", "--sensor", "gtac", "--fingers", "1"), "exported as .h"),
        (("builtin:any", "model.onnx"), "after 0.3.0 (commit f7d623e5 has it): holdfast export"),
        (("builtin:none", "model.h"), "unknown model 'builtin:none'"),
    ],
)
def test_bad_input_is_one_line(capsys, tmp_path, monkeypatch, words, expected):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *words)
    assert (code, out, err.count("\n")) == (2, "", 1) and expected in err
    assert list(tmp_path.iterdir()) == []
