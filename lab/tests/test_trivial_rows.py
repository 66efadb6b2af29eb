"""The rows of the trivial baseline that benchmarks print."""

import importlib.util
from pathlib import Path

from holdfast_lab.report.result_tables import Row

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "slips.py"


def load_script():
    spec = importlib.util.spec_from_file_location("slips", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_never_a_slip_finds_nothing_and_has_no_false_alarm():
    script = load_script()
    figures = {"before [%]": 17.0, script.N_SLIPS: 12, "AUC": 0.9, "held [min]": 3.5}
    rows = [
        Row(dict(zip(script.LINES, (fitted, "m", "t"), strict=True)) | {"figure": name}, x, None, 4)
        for fitted in ("a", "b")
        for name, x in figures.items()
    ]
    never = list(script.never_rows(rows))
    assert all(script.NEVER.items() <= row.keys.items() for row in never)
    assert {row.keys["figure"]: row.ours for row in never} == {
        "before [%]": 0.0, script.N_SLIPS: 12, "AUC": 0.5, "held [min]": 3.5
    }  # fmt: skip
    assert {(row.n, row.interval) for row in never} == {(4, None)}
