import doctest
from pathlib import Path

from holdfast.cli import main

PAGE = Path(__file__).parents[2] / "docs" / "sensors.md"


def test_the_page_runs_and_draws(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    failed, tried = doctest.testfile(str(PAGE), module_relative=False)
    assert (failed, tried > 5) == (0, True)
    assert main(["sensors", "pair.json", "--plot", "pair.svg"]) == 0
    assert main(["sensors", "finger.urdf", "--base", "tip", "--plot", "finger.svg"]) == 0
