import json
import math

import pytest

from holdfast.cli import main
from holdfast.control.trial import run
from holdfast.control.trial.run import TrialResult


@pytest.fixture
def quick(monkeypatch):
    """Trials that take no time."""

    def run_trial(trial, law, model):
        return TrialResult(
            number=trial.number, law=law, object=trial.grasp.object, unseen=trial.unseen,
            kind=trial.load.kind, n_fingers=trial.n_fingers, held=True, dropped=law == "fixed",
            slip=math.inf if law == "fixed" else 0.001, slipped=True,
            reaction=math.inf if law == "fixed" else 0.03, force_ratio=1.4, peak_ratio=1.1,
            quiet_time=2.0,
        )  # fmt: skip

    monkeypatch.setattr(run, "run_trial", run_trial)


def test_trial_json_has_every_law(tmp_path, capsys, quick):
    assert main(["trial", "--out", str(tmp_path / "out"), "--n", "6", "--jobs", "1"]) == 0
    document = json.loads((tmp_path / "out/trial.json").read_text())
    assert list(document["laws"]) == ["fixed", "pr2", "wong-zhu", "friction-margin", "holdfast"]
    for row in document["laws"].values():
        assert row["n"] == 6
        for name in ("dropped", "slip_median", "reaction_median", "force_ratio_mean"):
            assert row[name].keys() == {"value", "interval"}
    assert document["laws"]["fixed"]["slip_median"]["value"] is None
    assert document["seed"] == 0
    assert "numpy" in document["versions"]
    assert len(document["trials"]) == 30
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[2].split() == ["fixed", "6", "100.0", "inf", "inf", "1.40", "0.0"]
    assert lines[6].split() == ["holdfast", "6", "0.0", "1.00", "30", "1.40", "0.0"]


def test_json_goes_to_stdout(tmp_path, capsys, quick):
    words = [
        "trial",
        "--out",
        str(tmp_path),
        "--n",
        "2",
        "--laws",
        "fixed",
        "--jobs",
        "1",
        "--json",
    ]
    assert main(words) == 0
    assert list(json.loads(capsys.readouterr().out)["laws"]) == ["fixed"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--laws", "magic"], "unknown law 'magic'; there are fixed"),
        (["--n", "0"], "--n: at least 1 trial expected, 0 given"),
        (["--engine", "moon"], "unknown engine 'moon'"),
        (["--model", "nothing.json"], "nothing.json"),
    ],
)
def test_bad_input_is_one_line(tmp_path, capsys, words, message):
    assert main(["trial", "--out", str(tmp_path / "out"), *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_results_are_not_overwritten(tmp_path, capsys, quick):
    (tmp_path / "trial.json").write_text("mine")
    assert main(["trial", "--out", str(tmp_path), "--n", "1", "--jobs", "1"]) == 2
    assert "--force" in capsys.readouterr().err
    assert (tmp_path / "trial.json").read_text() == "mine"
