import json
import re
import runpy
import sys

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


def shown_table(cell):
    """Return the table that a cell showed when the notebook was stored."""
    texts = ("".join(one.get("data", {}).get("text/plain", "")) for one in cell["outputs"])
    return next((text for text in texts if not text.startswith("<")), "")


def printed(cell):
    """Return what a cell printed when the notebook was stored."""
    return "".join("".join(one.get("text", "")) for one in cell["outputs"])


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
        elif any("image/png" in one.get("data", {}) for one in cell["outputs"]):  # of pyplot
            assert plt.gcf().axes
            plt.close("all")
        words = re.compile(r"[\d.]+")
        assert words.sub("", capsys.readouterr().out) == words.sub("", printed(cell))
    if "metrics" in names:
        hand = names["metrics"].events.hand
        assert (hand.n_events, hand.missed["0.1"]) == (6, 0)
        assert names["metrics"].pooled.accuracy > 90
