"""The option --in-contact of the verbs."""

import json

import numpy as np
import pytest

from holdfast.cli import main
from holdfast.detection import Model, detect
from holdfast.io import load_dataset, save_recording
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Grasps of which the first seconds are missing."""
    path = tmp_path_factory.mktemp("held")
    for seed in range(3):
        whole = synthetic_recording(f"grasp{seed}", seed, ("thumb", "index"))
        start = int(0.4 * whole.modules["thumb"].n_samples)
        modules = {n: m.slice(start, m.n_samples) for n, m in whole.modules.items()}
        save_recording(type(whole)(whole.name, modules), path / f"grasp{seed}.parquet")
    return path


def test_detect(capsys, folder):
    path = str(folder / "grasp0.parquet")
    words = ["detect", "builtin:noise-floor", path, "--summary", "--json"]
    assert main([*words, "--in-contact"]) == 0
    shares = json.loads(capsys.readouterr().out)["fingers"]["thumb"]["states"]
    (recording,) = load_dataset(path)
    model = Model.load("builtin:noise-floor")
    trace = detect(model, recording, in_contact=True).fingers["thumb"]
    assert shares["STABLE"] == np.mean(trace.state == 3)
    assert trace.state.tolist() != detect(model, recording).fingers["thumb"].state.tolist()


def test_evaluate(capsys, folder):
    shares = []
    for options in ([], ["--in-contact"]):
        command = ["evaluate", "builtin:noise-floor", str(folder), "--json", *options]
        assert main(command) == 0
        document = json.loads(capsys.readouterr().out)
        shares.append(document["pooled"]["without_estimate"])
    assert shares[1] < shares[0]


def test_train_and_tune(capsys, folder, tmp_path):
    model, tuned = str(tmp_path / "model.json"), str(tmp_path / "tuned.json")
    options = ["--trials", "0", "--features", "any", "--in-contact"]
    assert main(["train", str(folder), "-o", model, *options]) == 0
    command = ["tune", model, str(folder), "-o", tuned, "--false-alarms", "60", "--in-contact"]
    assert main(command) == 0
    assert 0 < Model.load(tuned).finger("thumb").stable.threshold < 1
