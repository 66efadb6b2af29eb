import base64
import io
import json
import re
import runpy
import sys

import matplotlib as mpl
import matplotlib.image
import pytest

from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

from . import blocks

EXAMPLES = blocks.ROOT / "examples"
SCRIPTS = sorted(path.name for path in EXAMPLES.glob("*.py"))
PNG = "image/png"
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


@pytest.fixture(scope="module")
def notebook():
    return json.loads((EXAMPLES / "first_look.ipynb").read_text("utf-8"))


def printed(cell):
    """Return what a cell printed when the notebook was stored."""
    return "".join("".join(one.get("text", "")) for one in cell["outputs"])


def pictures(cell):
    """Return the stored pictures of a cell."""
    data = [one.get("data", {}).get("image/png", "") for one in cell["outputs"]]
    return [base64.b64decode("".join(one)) for one in data if one]


def test_the_notebook_is_stored_with_its_outputs_and_pictures(notebook):
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    assert len({cell["id"] for cell in notebook["cells"]}) == len(notebook["cells"])
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(printed(cell) or pictures(cell) for cell in cells)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    shown = [one for cell in cells for one in pictures(cell)]
    assert len(shown) >= 3
    for picture in shown:
        assert picture.startswith(b"\x89PNG")
        assert mpl.image.imread(io.BytesIO(picture)).std() > 0.05  # not empty


def test_the_notebook_is_small_and_has_no_times_or_paths(notebook):
    assert (EXAMPLES / "first_look.ipynb").stat().st_size < 500_000
    assert not any("execution" in cell["metadata"] for cell in notebook["cells"])
    for cell in notebook["cells"]:
        for output in cell.get("outputs", ()):
            texts = {kind: data for kind, data in output.get("data", {}).items() if kind != PNG}
            shown = json.dumps({**output, "data": texts})
            assert not re.search(r"[/\\]\w+[/\\]|0x[0-9a-f]{6}|\d\d:\d\d", shown)


def test_the_notebook_runs_again_and_shows_what_it_says(notebook, capsys):
    names = {"__name__": "__main__"}
    for number, cell in enumerate(notebook["cells"]):
        if cell["cell_type"] != "code":
            continue
        source = "".join(cell["source"])
        exec(compile(source, f"cell {number}", "exec"), names)
        last = source.splitlines()[-1]
        if not last.startswith("print"):  # a notebook shows the value of the last line
            assert eval(last, names)._repr_png_().startswith(b"\x89PNG")
        words = re.compile(r"[\d.]+")
        assert words.sub("", capsys.readouterr().out) == words.sub("", printed(cell))
    hand = names["metrics"].events.hand
    assert (hand.n_events, hand.missed["0.1"]) == (6, 0)
    assert names["metrics"].pooled.accuracy > 90
