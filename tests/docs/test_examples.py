import json
import re
import runpy
import sys

import matplotlib as mpl
import pytest

from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

from . import blocks

EXAMPLES = blocks.ROOT / "examples"
SCRIPTS = sorted(path.name for path in EXAMPLES.glob("*.py"))
EXPECTED = {
    "live_changes.py": "UNSTABLE -> STABLE",
    "train_and_evaluate.py": "false alarms per minute of stable label",
    "grid_search.py": "best: {",
    "grip_harder.py": "times its first force",
}


def run(monkeypatch, name, *words):
    monkeypatch.setattr(sys, "argv", [name, *map(str, words)])
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")


def test_every_script_is_in_the_table_and_in_the_test():
    table = (EXAMPLES / "README.md").read_text("utf-8")
    assert set(SCRIPTS) == set(EXPECTED)
    for path in EXAMPLES.iterdir():
        own = f"{path.name}/" if path.is_dir() else path.name
        assert own in ("README.md", "__pycache__/") or f"]({own})" in table


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_without_arguments(folder, capsys, monkeypatch, name):
    run(monkeypatch, name)
    printed = capsys.readouterr().out
    assert EXPECTED[name] in printed
    assert not re.search(r"\d\.\d{7}|\d{9}", printed)  # no number of many digits
    assert list(folder.iterdir()) == []


def test_a_script_with_recordings_of_ones_own(folder, capsys, monkeypatch):
    for seed in range(3):
        recording = synthetic_recording(f"g{seed}", seed, ("thumb",))
        save_recording(recording, folder / f"{recording.name}.parquet")
    run(monkeypatch, "train_and_evaluate.py", folder, folder / "model.json")
    assert "3 recordings" in capsys.readouterr().out
    assert (folder / "model.json").exists()


def test_the_notebook(monkeypatch):
    monkeypatch.setattr(mpl, "get_backend", lambda: "agg")
    notebook = json.loads((EXAMPLES / "first_look.ipynb").read_text("utf-8"))
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    assert len({cell["id"] for cell in notebook["cells"]}) == len(notebook["cells"])
    names = {"__name__": "__main__"}
    for number, cell in enumerate(notebook["cells"]):
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
    assert 50 < names["metrics"].pooled.accuracy <= 100
    assert len(names["figure"].axes) == 1
