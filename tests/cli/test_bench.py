import json

import pytest

from holdfast.cli import main


def test_json(capsys):
    pytest.importorskip("pywt")
    assert main(["bench", "--samples", "1000", "--updates", "1000", "--json"]) == 0
    out, err = capsys.readouterr()
    report = json.loads(out)
    assert report["batch"]["speedup_over_pywt"] > 0
    assert report["hand_update"]["speedup_over_pywt_sklearn"] > 0
    assert err == "measuring: about half a minute\n"


def test_a_table_for_people(capsys, monkeypatch):
    from holdfast import benchmark

    monkeypatch.setattr(benchmark, "find_spec", lambda name: None)
    assert main(["bench", "--samples", "1000", "--updates", "1000"]) == 0
    out = capsys.readouterr().out
    assert "batch features of 1,000 samples, window 14" in out
    assert "pywt: not installed" in out
    assert "update of a hand, 4 fingers of 30 taxels" in out


@pytest.mark.parametrize("words", [["--samples", "10"], ["--updates", "10"]])
def test_too_little_to_measure(capsys, words):
    assert main(["bench", *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    samples, updates = ("10", "20000") if words[0] == "--samples" else ("10000000", "10")
    assert err == (
        f"holdfast: at least 1000 samples and updates expected, {samples}, {updates} given\n"
    )
