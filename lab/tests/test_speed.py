import json

import numpy as np
import pytest
from holdfast_lab.speed import benchmark, pywt_loop, scipy_features, tsflex_task

from holdfast.cli import main
from holdfast.cli.terminal.console import print_json
from holdfast.features import DEFAULT_WINDOW, haar_features
from holdfast_lab import speed

pytestmark = pytest.mark.slow


def test_json(capsys):
    pytest.importorskip("pywt")
    assert main(["bench", "--samples", "1000", "--updates", "1000", "--json"]) == 0
    out, err = capsys.readouterr()
    report = json.loads(out)
    assert report["batch"]["speedup_over_pywt"] > 0
    assert report["hand_update"]["speedup_over_pywt_sklearn"] > 0
    assert err == "measuring: about half a minute\n"


def test_the_table(capsys, monkeypatch):
    monkeypatch.setattr(speed, "find_spec", lambda name: None)
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


@pytest.fixture(scope="module")
def force():
    walk = np.random.default_rng(0).normal(size=(400, 3)).cumsum(axis=0)
    return walk + np.array([300.0, 0.0, 0.0])


def test_the_pywt_loop_computes_the_same(force):
    pytest.importorskip("pywt")
    expected = haar_features(force, DEFAULT_WINDOW)
    np.testing.assert_allclose(pywt_loop(force), expected, rtol=0, atol=1e-9 * 300)
    assert np.isnan(expected[: DEFAULT_WINDOW - 1, 5]).all()


def test_scipy_computes_the_same(force):
    full = slice(DEFAULT_WINDOW - 1, None)
    expected = haar_features(force, DEFAULT_WINDOW)[full]
    np.testing.assert_allclose(scipy_features(force)[full], expected, rtol=0, atol=1e-9 * 300)


def test_tsflex_computes_the_same(force):
    pytest.importorskip("tsflex")
    (frame,) = tsflex_task(force)()
    table = {name.split("__")[1]: column for name, column in frame.items()}
    expected = haar_features(force, DEFAULT_WINDOW)[DEFAULT_WINDOW - 1 :]
    for name, column in (("m", 4), ("sigma", 5)):
        values = table[name].to_numpy()
        # Its windows end before the instant that they are stamped with: the last one is missing.
        np.testing.assert_allclose(values, expected[: len(values), column], rtol=0, atol=1e-9 * 300)
        assert len(expected) - len(values) <= 1


@pytest.fixture(scope="module")
def found():
    return benchmark(n_samples=2000, n_updates=1000)


def test_the_report_has_the_fields_of_the_contract(found, capsys):
    print_json(found)
    report = json.loads(capsys.readouterr().out)
    assert set(report) >= {"machine", "batch", "hand_update"}
    assert {"seconds_per_sample", "ratio_to_copy", "speedup_over_pywt"} <= set(report["batch"])
    assert {"p50", "p99", "p999", "speedup_over_pywt_sklearn"} <= set(report["hand_update"])
    assert report["machine"]["versions"]["holdfast"]
    assert report["batch"]["n_samples"] == 2000
    assert report["hand_update"]["n_updates"] == 1000


def test_figures_are_finite_and_consistent(found):
    batch, update = found["batch"], found["hand_update"]
    assert batch["ratio_to_copy"] == pytest.approx(
        batch["seconds_per_sample"] / batch["seconds_per_sample_copy"]
    )
    assert 0 < update["p50"] <= update["p99"] <= update["p999"] < np.inf
    assert update["speedup_over_pywt_sklearn"] == pytest.approx(
        update["seconds_pywt_sklearn"] / update["p50"]
    )


def test_peers_that_are_missing_are_left_out(monkeypatch):
    monkeypatch.setattr(speed, "find_spec", lambda name: None)
    found = benchmark(n_samples=2000, n_updates=1000)
    assert found["batch"]["speedup_over_pywt"] is None
    assert found["batch"]["speedup_over_tsflex"] is None
    assert found["hand_update"]["speedup_over_pywt_sklearn"] is None
    assert found["batch"]["speedup_over_scipy"] > 0
