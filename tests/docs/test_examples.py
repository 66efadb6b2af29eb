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


NOTEBOOKS = ("first_look", "ten_lines")


@pytest.fixture(scope="module", params=NOTEBOOKS)
def notebook(request):
    return json.loads((EXAMPLES / f"{request.param}.ipynb").read_text("utf-8"))


def test_the_notebooks_are_all_that_there_are():
    assert sorted(path.stem for path in EXAMPLES.glob("*.ipynb")) == sorted(NOTEBOOKS)
    assert max(path.stat().st_size for path in EXAMPLES.glob("*.ipynb")) < 500_000


def shown_table(cell):
    """Return the table that a cell showed when the notebook was stored."""
    texts = ("".join(one.get("data", {}).get("text/plain", "")) for one in cell["outputs"])
    return next((text for text in texts if not text.startswith("<")), "")


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
    assert all(printed(cell) or pictures(cell) or shown_table(cell) for cell in cells)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    shown = [one for cell in cells for one in pictures(cell)]
    assert len(shown) >= 2
    for picture in shown:
        assert picture.startswith(b"\x89PNG")
        assert mpl.image.imread(io.BytesIO(picture)).std() > 0.05  # not empty


def test_the_notebook_has_no_times_or_paths(notebook):
    assert not any("execution" in cell["metadata"] for cell in notebook["cells"])
    for cell in notebook["cells"]:
        for output in cell.get("outputs", ()):
            data = output.get("data", {}).items()
            texts = {kind: text for kind, text in data if kind not in (PNG, "text/html")}
            shown = json.dumps({**output, "data": texts})
            assert not re.search(r"[/\\]\w+[/\\]|0x[0-9a-f]{6}|\d\d:\d\d", shown)


def test_the_notebook_runs_again_and_shows_what_it_says(notebook, capsys, monkeypatch):
    from matplotlib import pyplot as plt

    plt.switch_backend("agg")
    names = {"__name__": "__main__"}
    for number, cell in enumerate(notebook["cells"]):
        if cell["cell_type"] != "code":
            continue
        source = "".join(cell["source"])
        *_, last = source.splitlines()
        ends_in_a_value = not last.startswith("print") and not last.endswith(";")
        body = source.removesuffix(last) if ends_in_a_value else source
        exec(compile(body, f"cell {number}", "exec"), names)
        value = eval(last, names) if ends_in_a_value else None
        if shown_table(cell):
            assert repr(value) == shown_table(cell)
        elif ends_in_a_value:
            assert value._repr_png_().startswith(b"\x89PNG")
        elif pictures(cell):  # of pyplot
            assert plt.gcf().axes
            plt.close("all")
        words = re.compile(r"[\d.]+")
        assert words.sub("", capsys.readouterr().out) == words.sub("", printed(cell))
    if "metrics" in names:
        hand = names["metrics"].events.hand
        assert (hand.n_events, hand.missed["0.1"]) == (6, 0)
        assert names["metrics"].pooled.accuracy > 90


def test_the_short_notebook_has_ten_lines():
    cells = json.loads((EXAMPLES / "ten_lines.ipynb").read_text("utf-8"))["cells"]
    code = [line for cell in cells if cell["cell_type"] == "code" for line in cell["source"]]
    assert len([line for line in code if line.strip()]) == 10
