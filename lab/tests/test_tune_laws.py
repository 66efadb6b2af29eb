"""The rule by which `benchmarks/tune_laws.py` chooses settings, and its list of settings."""

import importlib.util
import json
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "tune_laws.py"


def load_script():
    spec = importlib.util.spec_from_file_location("tune_laws", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


script = load_script()


def row(dropped, false, force):
    numbers = {
        "dropped": dropped,
        "false_reactions_per_minute": false,
        "force_ratio_mean": force,
    }
    return {field: {"value": value} for field, value in numbers.items()}


@pytest.mark.parametrize(
    ("rows", "best"),
    [
        ({"a": row(5.0, 0.9, 2.2), "b": row(0.0, 1.0, 2.1), "c": row(0.0, 0.0, 2.4)}, "b"),
        ({"a": row(5.1, 0.0, 1.5), "b": row(4.9, 0.5, 2.5)}, "b"),
        ({"a": row(0.0, 7.0, 2.0), "b": row(0.0, 3.0, 2.5)}, "b"),
        ({"a": row(12.0, 0.0, 2.0), "b": row(8.0, 9.0, 2.5)}, "b"),
    ],
    ids=["least force", "drops first", "fewest false", "fewest drops"],
)
def test_the_rule(rows, best):
    assert script.best_of(rows) == best


def test_each_law_has_the_same_number_of_settings():
    assert len({len(settings) for _, settings in script.SETTINGS.values()}) == 1
    for kind, settings in script.SETTINGS.values():
        for setting in settings:
            kind(**setting)


def test_a_run_that_was_stopped_continues(tmp_path, monkeypatch, capsys):
    ran = []

    def invented(law, kind, setting, number, seed):
        ran.append(number)
        return script.TrialResult(
            number=number, law=script.name_of(law, setting), object="can", unseen=False,
            kind="pull", n_fingers=4, held=True, dropped=False, slip=0.001, force_ratio=2.0,
            quiet_time=60.0)  # fmt: skip

    monkeypatch.setattr(script, "run_setting", invented)
    path, n = tmp_path / "out.jsonl", len(script.SETTINGS["pr2"][1])
    script.run_settings(path, ["pr2"], 1, 100)
    script.run_settings(path, ["pr2"], 2, 100)
    assert ran == [0] * n + [1] * n
    script.print_tables(path, ["pr2"])
    assert "| **pr2 threshold_factor=1.0 fall=0.0** | 2 | 0.0 | 2.00 | 0.0 | 1.0 |" in (
        capsys.readouterr().out
    )
    assert all(json.loads(line)["held"] for line in path.read_text().splitlines())
