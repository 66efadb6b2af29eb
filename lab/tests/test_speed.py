import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from holdfast.features import DEFAULT_WINDOW, haar_features

pytestmark = pytest.mark.slow

path = Path(__file__).parents[2] / "benchmarks" / "speed.py"
spec = importlib.util.spec_from_file_location("speed", path)
speed = importlib.util.module_from_spec(spec)
spec.loader.exec_module(speed)


@pytest.fixture(scope="module")
def force():
    walk = np.random.default_rng(0).normal(size=(400, 3)).cumsum(axis=0)
    return walk + np.array([300.0, 0.0, 0.0])


def test_the_pywt_loop_computes_the_same(force):
    pytest.importorskip("pywt")
    expected = haar_features(force, DEFAULT_WINDOW)
    np.testing.assert_allclose(speed.pywt_loop(force), expected, rtol=0, atol=1e-9 * 300)
    assert np.isnan(expected[: DEFAULT_WINDOW - 1, 5]).all()


def test_scipy_computes_the_same(force):
    full = slice(DEFAULT_WINDOW - 1, None)
    expected = haar_features(force, DEFAULT_WINDOW)[full]
    np.testing.assert_allclose(speed.scipy_features(force)[full], expected, rtol=0, atol=1e-9 * 300)


def test_tsflex_computes_the_same(force):
    pytest.importorskip("tsflex")
    (frame,) = speed.tsflex_task(force)()
    table = {name.split("__")[1]: column for name, column in frame.items()}
    expected = haar_features(force, DEFAULT_WINDOW)[DEFAULT_WINDOW - 1 :]
    for name, column in (("m", 4), ("sigma", 5)):
        values = table[name].to_numpy()
        # Its windows end before the instant that they are stamped with: the last one is missing.
        np.testing.assert_allclose(values, expected[: len(values), column], rtol=0, atol=1e-9 * 300)
        assert len(expected) - len(values) <= 1


@pytest.fixture(scope="module")
def found():
    return speed.benchmark(n_samples=2000, n_updates=1000)


def test_json_has_the_fields_of_the_contract(found, capsys, monkeypatch):
    monkeypatch.setattr(speed, "benchmark", lambda *numbers: found)
    monkeypatch.setattr("sys.argv", ["speed.py", "--json"])
    speed.main()
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
    found = speed.benchmark(n_samples=2000, n_updates=1000)
    assert found["batch"]["speedup_over_pywt"] is None
    assert found["batch"]["speedup_over_tsflex"] is None
    assert found["hand_update"]["speedup_over_pywt_sklearn"] is None
    assert found["batch"]["speedup_over_scipy"] > 0
