"""Tests of benchmarks/real_hands.py, which prints the goals on real recordings."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "real_hands.py"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("real_hands", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def row(recording, method, trained_on, figure, ours):
    return {"recording": recording, "method": method, "trained on": trained_on,
            "figure": figure, "ours": ours}  # fmt: skip


def tables(aucs=(0.9, 0.7), rival=(0.8, 0.74), calm=95.0, without=2.0):
    """Two recordings with slip, and a calm one."""
    rows, pairs = [], []
    for name, auc, other in (("a", aucs[0], rival[0]), ("b", aucs[1], rival[1]), ("c", None, None)):
        own = ("builtin:any", "the twin")
        rows += [
            row(name, *own, "AUC", auc),
            row(name, *own, "stable called STABLE [%]", calm),
            row(name, *own, "without estimate [%]", without),
            row(name, "builtin:any", "the twin, the others", "AUC", 1.0),
            row(name, "features of builtin:any", "the others", "AUC", 1.0),
            row(name, "poor", "the others", "AUC", None if other is None else 0.1),
            row(name, "good", "the others", "AUC", other),
        ]
        if auc is not None:
            for method, value in (("poor", 0.1), ("good", other)):
                pairs += [
                    row(name, method, "the others", "AUC of builtin:any", auc),
                    row(name, method, "the others", "AUC", value),
                    row(name, method, "the others", "difference", auc - value),
                ]
    return {"real_recordings": rows, "real_pairs": pairs}


def test_all_goals_reached(script):
    assert list(script.report(tables())) == [
        "AUC of stable against slip, where all methods have an estimate",
        "  a: 0.900; good 0.800",
        "  b: 0.700; good 0.740",
        "  at least the best on one, within 0.05 of it on the rest: reached",
        "AUC of stable against slip, where builtin:any and the one method have an estimate",
        "  a: 0.900; good 0.800",
        "  b: 0.700; good 0.740",
        "  at least the best on one, within 0.05 of it on the rest: reached",
        "Stable samples called STABLE, recordings without slip",
        "  c: 95.0 %",
        "  at least 90 % in each: reached",
        "Labelled samples without an estimate",
        "  a: 2.0 %",
        "  b: 2.0 %",
        "  c: 2.0 %",
        "  at most 5 % in each: reached",
    ]


@pytest.mark.parametrize(
    ("changes", "n_missed"),
    [
        ({"rival": (0.91, 0.74)}, 2),
        ({"rival": (0.8, 0.76)}, 2),
        ({"calm": 89.0}, 1),
        ({"without": 5.5}, 1),
    ],
)
def test_goals_not_reached(script, changes, n_missed):
    lines = list(script.report(tables(**changes)))
    assert sum(line.endswith("not reached") for line in lines) == n_missed


def test_the_command(script, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["real_hands.py", str(tmp_path)])
    with pytest.raises(SystemExit) as stopped:
        script.main()
    assert stopped.value.code == 2
    assert "study.json does not exist; the folder of a finished study" in capsys.readouterr().err
    summary = tmp_path / "study.json"
    summary.write_text(json.dumps({"tables": {}}))
    with pytest.raises(SystemExit):
        script.main()
    assert "has no real recordings" in capsys.readouterr().err
    summary.write_text(json.dumps({"tables": tables()}))
    script.main()
    assert capsys.readouterr().out.count("reached\n") == 4
